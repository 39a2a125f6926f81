from typing import Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

__version__: str

Image = npt.NDArray[Any]  # (height, width): uint8, uint16 or float32
Array = npt.NDArray[np.float64]
Numbers = Union[npt.ArrayLike, Sequence[Any]]
Trajectory = Union[npt.ArrayLike, Tuple[npt.ArrayLike, npt.ArrayLike]]  # (N, 8), or (N,) stamps and (N, 4, 4) poses
Options = Dict[str, Union[bool, int, float, str]]

class Alignment:
    @property
    def ok(self) -> bool: ...
    @property
    def status(self) -> str: ...
    @property
    def T(self) -> Array: ...
    @property
    def confidence(self) -> float: ...
    @property
    def information(self) -> Array: ...
    @property
    def covariance(self) -> Array: ...
    @property
    def open_directions(self) -> int: ...
    @property
    def ambiguous(self) -> bool: ...
    @property
    def valid_share(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def cost(self) -> float: ...
    @property
    def backward_translation(self) -> float: ...
    @property
    def backward_rotation(self) -> float: ...

class Assessment:
    @property
    def state(self) -> str: ...
    @property
    def S_total(self) -> float: ...
    @property
    def S_change(self) -> Optional[float]: ...
    @property
    def S_final(self) -> Optional[float]: ...
    @property
    def th_differ(self) -> float: ...
    @property
    def dynamic_ratio(self) -> float: ...
    @property
    def scores(self) -> Dict[str, Optional[float]]: ...
    @property
    def weights(self) -> Dict[str, float]: ...
    @property
    def measured(self) -> Dict[str, float]: ...
    def explain(self) -> str: ...

class Statistics:
    @property
    def rmse(self) -> float: ...
    @property
    def mean(self) -> float: ...
    @property
    def median(self) -> float: ...
    @property
    def std(self) -> float: ...
    @property
    def min(self) -> float: ...
    @property
    def max(self) -> float: ...
    @property
    def count(self) -> int: ...

class Evaluation:
    @property
    def ate(self) -> Statistics: ...
    @property
    def rpe_translation(self) -> Statistics: ...
    @property
    def rpe_rotation(self) -> Statistics: ...
    @property
    def estimate_poses(self) -> int: ...
    @property
    def groundtruth_poses(self) -> int: ...
    @property
    def unique(self) -> bool: ...
    @property
    def T_groundtruth_estimate(self) -> Array: ...
    @property
    def scale(self) -> float: ...
    @property
    def pairs(self) -> npt.NDArray[np.int64]: ...
    @property
    def errors(self) -> Array: ...

class Report:
    @property
    def timestamp(self) -> float: ...
    @property
    def state(self) -> str: ...
    @property
    def T(self) -> Array: ...
    @property
    def T_feature(self) -> Array: ...
    @property
    def T_direct(self) -> Array: ...
    @property
    def refined(self) -> bool: ...
    @property
    def keyframe_allowed(self) -> bool: ...
    @property
    def assessment(self) -> Assessment: ...

class FeatureResult:
    @property
    def ok(self) -> bool: ...
    @property
    def T(self) -> Array: ...
    @property
    def T_predicted(self) -> Array: ...
    @property
    def information(self) -> Array: ...

class Pipeline:
    def __init__(self, K: Numbers, shape: Tuple[int, int], options: Options = ...) -> None: ...
    def observe(
        self,
        timestamp: float,
        I: Image,
        D: Image,
        T_prior: Numbers,
        *,
        tracks: Optional[Numbers] = ...,
        detections: Optional[Numbers] = ...,
        mask: Optional[Image] = ...,
        depth_unit: Optional[float] = ...,
    ) -> npt.NDArray[np.float32]: ...
    def assess(
        self,
        T_feature: Numbers,
        *,
        T_predicted: Optional[Numbers] = ...,
        ok: bool = ...,
        keypoints: Optional[Numbers] = ...,
        tracks: Optional[Numbers] = ...,
        information: Optional[Numbers] = ...,
    ) -> Assessment: ...
    def conclude(self) -> Report: ...
    def reset(self) -> None: ...
    @property
    def dynamic_probability(self) -> npt.NDArray[np.float32]: ...
    @property
    def dynamic_ratio(self) -> float: ...

class Tracker:
    def __init__(self, K: Numbers, shape: Tuple[int, int], options: Options = ...) -> None: ...
    def begin(
        self,
        timestamp: float,
        I: Image,
        D: Image,
        keypoints: Numbers,
        descriptors: npt.NDArray[np.uint8],
        *,
        tracks: Optional[Numbers] = ...,
        depth_unit: Optional[float] = ...,
    ) -> None: ...
    def estimate(self, dynamic_probability: Optional[npt.NDArray[np.float32]] = ...) -> FeatureResult: ...
    def commit(
        self,
        T_world_camera: Numbers,
        dynamic_probability: Optional[npt.NDArray[np.float32]] = ...,
        *,
        keyframe_allowed: bool = ...,
    ) -> None: ...

def align(
    I0: Image,
    D0: Image,
    I1: Image,
    D1: Image,
    K: Numbers,
    *,
    depth_unit: Optional[float] = ...,
    guess: Optional[Numbers] = ...,
    options: Options = ...,
) -> Alignment: ...
def score(
    I: Image,
    D: Image,
    K: Numbers,
    *,
    keypoints: Optional[Numbers] = ...,
    tracks: Optional[Numbers] = ...,
    detections: Optional[Numbers] = ...,
    dynamic_probability: Optional[npt.NDArray[np.float32]] = ...,
    depth_unit: Optional[float] = ...,
    timestamp: float = ...,
    options: Options = ...,
) -> Assessment: ...
def blend(
    T_feature: Numbers,
    T_direct: Numbers,
    w: float = ...,
    feature_information: Optional[Numbers] = ...,
    direct_information: Optional[Numbers] = ...,
) -> Array: ...
def evaluate(
    groundtruth: Trajectory,
    estimate: Trajectory,
    *,
    alignment: str = ...,
    association: str = ...,
    max_difference: float = ...,
    gravity_axis: str = ...,
    delta: float = ...,
    unit: str = ...,
    form: str = ...,
    time_offset: float = ...,
) -> Evaluation: ...
