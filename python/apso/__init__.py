"""Direct RGB-D alignment, quality of frames, and evaluation of trajectories, for scenes where people and things move.

Images are NumPy arrays of shape (height, width), read where they lie: uint8, uint16 or float32, of any positive strides. Grey float32
is in [0, 1]; depth float32 is in metres, integers say their unit (depth_unit). The camera K is a 3x3 matrix without distortion, or
(fx, fy, cx, cy), in pixels. Poses are 4x4 arrays; T_a_b maps points of b into a: x_a = R x_b + t, in metres. The camera looks
along z, x is right and y is down. Functions run without the interpreter lock.
"""
from ._apso import (
    Alignment,
    Assessment,
    Evaluation,
    FeatureResult,
    PartChange,
    Pipeline,
    Report,
    Statistics,
    Tracker,
    __version__,
    align,
    blend,
    evaluate,
    score,
)

__all__ = [
    "Alignment",
    "Assessment",
    "Evaluation",
    "FeatureResult",
    "PartChange",
    "Pipeline",
    "Report",
    "Statistics",
    "Tracker",
    "__version__",
    "align",
    "blend",
    "evaluate",
    "score",
]
