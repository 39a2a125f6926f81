// Pipeline and Tracker: the whole method, frame by frame.
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include <apso/track.hpp>

#include "arrays.hpp"
#include "module.hpp"
#include "options.hpp"

namespace apso_python {
namespace {

/// Height and width of images, (height, width).
apso::Pinhole camera_of_shape(const py::object& K, const std::pair<int, int>& shape) { return camera_of(K, shape.second, shape.first); }

void check_shape(const ArrayFrame& frame, const apso::Pinhole& camera) {
  if (frame.width() == camera.width && frame.height() == camera.height) return;
  throw py::value_error("I has shape " + frame.shape() + " and the camera has shape (" + std::to_string(camera.height) + ", " +
                        std::to_string(camera.width) + "): expected the same shape");
}

/// A mask that may be None. Integers: nonzero is dynamic; floats: probabilities.
class MaybeMask {
 public:
  MaybeMask(const py::object& object, const char* name, const apso::Pinhole& camera, bool probabilities) {
    if (object.is_none()) return;
    py::array array = py::array::ensure(object);
    if (!array) throw py::error_already_set();
    if (array.dtype().kind() == 'b') array = array.attr("view")("uint8");  // the same bytes
    image_.emplace(array, name);
    if (probabilities && !image_->floating()) throw py::type_error(std::string(name) + " must be float32 in [0, 1]");
    if (image_->width() != camera.width || image_->height() != camera.height) {
      throw py::value_error(std::string(name) + " has shape " + image_->shape() + " and the camera has shape (" +
                            std::to_string(camera.height) + ", " + std::to_string(camera.width) + "): expected the same shape");
    }
  }
  [[nodiscard]] bool given() const { return image_.has_value(); }
  [[nodiscard]] bool floating() const { return image_ && image_->floating(); }
  [[nodiscard]] apso::AnyImage any() const { return image_ ? image_->any() : apso::AnyImage(); }

 private:
  std::optional<ArrayImage> image_;
};

py::array_t<float> copy_of(const apso::ImageView<const float>& view) {
  py::array_t<float> out({static_cast<py::ssize_t>(view.height), static_cast<py::ssize_t>(view.width)});
  for (int y = 0; y < view.height; ++y) {
    std::memcpy(out.mutable_data(y, 0), view.row(y), sizeof(float) * static_cast<std::size_t>(view.width));
  }
  return out;
}

class PythonPipeline {
 public:
  PythonPipeline(const py::object& K, const std::pair<int, int>& shape, const py::dict& options)
      : pipeline_(camera_of_shape(K, shape), options_of(options)) {}

  py::array_t<float> observe(double timestamp, const py::array& I, const py::array& D, const py::object& T_prior, const py::object& tracks,
                             const py::object& detections, const py::object& mask, const std::optional<double>& depth_unit) {
    const ArrayFrame frame(I, D, "I", "D", depth_unit);
    check_shape(frame, pipeline_.camera());
    const apso::Pose prior = rigid_pose_of(T_prior, "T_prior");
    const MaybeMask given(mask, "mask", pipeline_.camera(), false);
    std::optional<std::vector<apso::PointTrack>> points;
    std::optional<std::vector<apso::Detection>> objects;
    if (!tracks.is_none()) points = tracks_of(tracks);
    if (!detections.is_none()) objects = detections_of(detections);
    const auto now = frame.at(timestamp, pipeline_.camera());
    {
      const py::gil_scoped_release release;
      const auto* t = points ? &*points : nullptr;
      const auto* d = objects ? &*objects : nullptr;
      if (!given.given()) {
        pipeline_.observe(now, prior, t, d);
      } else {
        pipeline_.observe(now, prior, t, d, probabilities(given));
      }
    }
    return dynamic_probability();
  }
  PythonAssessment assess(const py::object& T_feature, const py::object& T_predicted, bool ok, const py::object& keypoints,
                          const py::object& tracks, const py::object& information) {
    apso::FeaturePose<> pose;
    pose.T_world_feature = pose_of(T_feature, "T_feature");
    pose.T_world_predicted = T_predicted.is_none() ? pose.T_world_feature : rigid_pose_of(T_predicted, "T_predicted");
    pose.ok = ok;
    if (!information.is_none()) pose.information = matrix_of<apso::Matrix6>(information, "information", 6);
    std::optional<std::vector<apso::Keypoint>> corners;
    std::optional<std::vector<apso::PointTrack>> points;
    if (!keypoints.is_none()) corners = keypoints_of(keypoints);
    if (!tracks.is_none()) points = tracks_of(tracks);
    const py::gil_scoped_release release;
    if (corners && points) return {pipeline_.assess(*corners, *points, pose)};
    if (corners) return {pipeline_.assess(*corners, apso::none, pose)};
    if (points) return {pipeline_.assess(apso::none, *points, pose)};
    return {pipeline_.assess(apso::none, apso::none, pose)};
  }
  apso::FrameReport conclude() {
    const py::gil_scoped_release release;
    return pipeline_.conclude();
  }
  void correct(const py::function& pose_of) {
    pipeline_.correct([&](double timestamp, const apso::Pose& T) -> std::optional<apso::Pose> {
      const py::object now = pose_of(timestamp, array_of(T));
      if (now.is_none()) return std::nullopt;
      return rigid_pose_of(now, "what pose_of returns");
    });
  }
  void reset() { pipeline_.reset(); }
  [[nodiscard]] py::array_t<float> dynamic_probability() const { return copy_of(pipeline_.observation().mask.probability); }
  [[nodiscard]] double dynamic_ratio() const { return pipeline_.observation().dynamic_ratio; }

 private:
  static apso::PipelineOptions options_of(const py::dict& options) {
    apso::PipelineOptions o;
    set_options(o, options);
    return o;
  }
  /// The mask as probabilities, in memory that stays until the next frame.
  const apso::Image<float>& probabilities(const MaybeMask& mask) {
    apso::copy_to_float(mask.any(), 1.0, mask_);
    if (mask.floating()) return mask_;
    for (int y = 0; y < mask_.height(); ++y) {
      for (int x = 0; x < mask_.width(); ++x) mask_(x, y) = mask_(x, y) != 0 ? 1.0F : 0.0F;
    }
    return mask_;
  }
  apso::Pipeline pipeline_;
  apso::Image<float> mask_;
};

class PythonTracker {
 public:
  PythonTracker(const py::object& K, const std::pair<int, int>& shape, const py::dict& options)
      : camera_(camera_of_shape(K, shape)), tracker_(camera_, options_of(options)) {}

  void begin(double timestamp, const py::array& I, const py::array& D, const py::object& keypoints,
             const py::array_t<std::uint8_t, py::array::c_style>& descriptors, const py::object& tracks,
             const std::optional<double>& depth_unit) {
    const ArrayFrame frame(I, D, "I", "D", depth_unit);
    check_shape(frame, camera_);
    const std::vector<apso::Keypoint> corners = keypoints_of(keypoints);
    if (descriptors.ndim() != 2 || descriptors.shape(1) != 32 || descriptors.shape(0) != static_cast<py::ssize_t>(corners.size())) {
      throw py::value_error("descriptors has shape " + shape_text(descriptors) + ": expected (" + std::to_string(corners.size()) +
                            ", 32), one of 32 bytes for each keypoint");
    }
    std::vector<apso::Descriptor> bytes(corners.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) std::memcpy(&bytes[i], descriptors.data(static_cast<py::ssize_t>(i), 0), 32);
    std::vector<apso::PointTrack> points;
    if (!tracks.is_none()) points = tracks_of(tracks);
    const auto now = frame.at(timestamp, camera_);
    const py::gil_scoped_release release;
    tracker_.begin(now, corners, bytes, points);
  }
  apso::FeatureResult estimate(const py::object& dynamic_probability) {
    const MaybeMask mask(dynamic_probability, "dynamic_probability", camera_, true);
    const py::gil_scoped_release release;
    return tracker_.estimate(mask.any());
  }
  void commit(const py::object& T_world_camera, const py::object& dynamic_probability, bool keyframe_allowed) {
    const apso::Pose T = rigid_pose_of(T_world_camera, "T_world_camera");
    const MaybeMask mask(dynamic_probability, "dynamic_probability", camera_, true);
    const py::gil_scoped_release release;
    tracker_.commit(T, mask.any(), keyframe_allowed);
  }
  apso::PartChange reconnect() {
    const py::gil_scoped_release release;
    return tracker_.reconnect();
  }

 private:
  static apso::LandmarkTrackerOptions options_of(const py::dict& options) {
    apso::LandmarkTrackerOptions o;
    set_options(o, options);
    return o;
  }
  apso::Pinhole camera_;
  apso::LandmarkTracker tracker_;
};

}  // namespace

void add_pipeline(py::module_& m) {
  using Report = apso::FrameReport;
  py::class_<Report>(m, "Report", "What the pipeline concluded about a frame. Poses are T_world_camera, 4x4 [m].")
      .def_readonly("timestamp", &Report::timestamp, "[s]")
      .def_property_readonly(
          "state", [](const Report& r) { return apso::to_string(r.state); }, "'INITIALISING', 'GOOD', 'BAD' or 'LOST'.")
      .def_property_readonly(
          "T", [](const Report& r) { return array_of(r.T_world_camera); }, "The final pose; in state LOST only the prediction.")
      .def_property_readonly(
          "T_feature", [](const Report& r) { return array_of(r.T_world_feature); }, "The pose that was given to assess().")
      .def_property_readonly(
          "T_direct", [](const Report& r) { return array_of(r.T_world_direct); }, "Of direct alignment, if refined.")
      .def_readonly("refined", &Report::refined, "A direct pose was trusted: T joins it with T_feature.")
      .def_readonly("keyframe_allowed", &Report::keyframe_allowed, "A map may learn from this frame.")
      .def_property_readonly("assessment", [](const Report& r) { return PythonAssessment{r.assessment}; });
  py::class_<PythonPipeline>(m, "Pipeline", R"(The whole method for one camera: what moves, can the frame be trusted, where is the camera?

For each frame call observe(), assess() and conclude(), in this order, with the pose of a feature tracker of yours or of Tracker.
Nothing of an array is kept after a call. One thread at a time may use a Pipeline; different ones run in parallel.)")
      .def(py::init<const py::object&, const std::pair<int, int>&, const py::dict&>(), py::arg("K"), py::arg("shape"),
           py::arg("options") = py::dict(),
           R"(K: (3, 3), or (fx, fy, cx, cy), in pixels. shape: (height, width) of the images.
options: settings by name, e.g. {"refine": "bad_only", "assessor.decision.th_differ": 0.6}.)")
      .def("observe", &PythonPipeline::observe, py::arg("timestamp"), py::arg("I"), py::arg("D"), py::arg("T_prior"), py::kw_only(),
           py::arg("tracks") = py::none(), py::arg("detections") = py::none(), py::arg("mask") = py::none(),
           py::arg("depth_unit") = py::none(),
           R"(What moves? Returns the dynamic probability, (height, width), float32 in [0, 1].

timestamp: [s]. I, D, depth_unit: as in apso.align. T_prior: (4, 4), best guess of T_world_camera.
tracks, detections: as in apso.score. mask: (height, width), bool or integers (nonzero = dynamic), or float32 probabilities.)")
      .def("assess", &PythonPipeline::assess, py::arg("T_feature"), py::kw_only(), py::arg("T_predicted") = py::none(),
           py::arg("ok") = true, py::arg("keypoints") = py::none(), py::arg("tracks") = py::none(), py::arg("information") = py::none(),
           R"(Can the frame be trusted? Returns an Assessment.

T_feature: (4, 4), T_world_camera of a feature tracker. T_predicted: that of its motion model, T_feature if None.
ok: feature tracking succeeded. keypoints, tracks: as in apso.score.
information: (6, 6) of T_feature, translation first [1/m^2, 1/rad^2]; None: not known.)")
      .def("conclude", &PythonPipeline::conclude, "Refines the pose of the frame and remembers what is right. Returns a Report.")
      .def("correct", &PythonPipeline::correct, py::arg("pose_of"),
           R"(Follows a map that has moved (bundle adjustment, a loop, parts that were joined).

Call it before observe(). pose_of(timestamp, T): the pose, (4, 4), that the frame of this time, which had T, has now. None: it
moves along with the latest frame, and so does all that pose_of is not asked for.)")
      .def("reset", &PythonPipeline::reset, "Forgets everything.")
      .def_property_readonly("dynamic_probability", &PythonPipeline::dynamic_probability, "Of the last frame, (height, width), float32.")
      .def_property_readonly("dynamic_ratio", &PythonPipeline::dynamic_ratio, "Share of the last frame that moves, [0, 1].");
  using Change = apso::PartChange;
  py::class_<Change>(m, "PartChange", "What became of the part of the map that the poses lie in, and of these.")
      .def_property_readonly(
          "event", [](const Change& c) { return apso::to_string(c.event); }, "'none', 'left', 'joined' or 'closed' (a loop).")
      .def_readonly("part", &Change::part, "That the poses to come lie in; the first is 0.")
      .def_readonly("before", &Change::before, "That the poses up to now lie in.")
      .def_property_readonly(
          "T_part_before", [](const Change& c) { return array_of(c.T_part_before); },
          "After 'joined': takes the poses of `before` to `part`, 4x4 [m].")
      .def_property_readonly("moves_poses", &Change::moves_poses,
                             "After 'joined' and 'closed': poses of `before` have moved, as moved() tells.")
      .def(
          "moved",
          [](const Change& c, double timestamp, const py::object& T) {
            return array_of(c.moved(timestamp, rigid_pose_of(T, "T_world_camera")));
          },
          py::arg("timestamp"), py::arg("T_world_camera"),
          "Where a pose of `before`, (4, 4), of this time [s] is now. After 'none' and 'left' where it was.");
  using Result = apso::FeatureResult;
  py::class_<Result>(m, "FeatureResult", "A pose of Tracker.")
      .def_readonly("ok", &Result::ok)
      .def_property_readonly(
          "T", [](const Result& r) { return array_of(r.T_world_camera); }, "T_world_camera, 4x4 [m].")
      .def_property_readonly(
          "T_predicted", [](const Result& r) { return array_of(r.T_world_predicted); }, "That of the motion model, 4x4 [m].")
      .def_property_readonly(
          "information", [](const Result& r) { return array_of(r.information); }, "6x6, translation first [1/m^2, 1/rad^2].");
  py::class_<PythonTracker>(
      m, "Tracker", R"(A small feature tracker with a local map, for keypoints and binary descriptors of any detector (ORB of OpenCV, say).

For each frame call begin(), estimate() as often as a better mask is known, and commit() with the final pose.)")
      .def(py::init<const py::object&, const std::pair<int, int>&, const py::dict&>(), py::arg("K"), py::arg("shape"),
           py::arg("options") = py::dict(), "K: (3, 3), or (fx, fy, cx, cy), in pixels. shape: (height, width) of the images.")
      .def("begin", &PythonTracker::begin, py::arg("timestamp"), py::arg("I"), py::arg("D"), py::arg("keypoints"), py::arg("descriptors"),
           py::kw_only(), py::arg("tracks") = py::none(), py::arg("depth_unit") = py::none(),
           "Takes the features of a new frame. keypoints: (N, 2 to 5). descriptors: (N, 32), uint8. tracks: (M, 6). As in apso.score.")
      .def("estimate", &PythonTracker::estimate, py::arg("dynamic_probability") = py::none(),
           "Pose of the frame begun. dynamic_probability: (height, width), float32 in [0, 1]; None: nothing moves.")
      .def("commit", &PythonTracker::commit, py::arg("T_world_camera"), py::arg("dynamic_probability") = py::none(), py::kw_only(),
           py::arg("keyframe_allowed") = true, "Ends the frame with its final pose, (4, 4).")
      .def(
          "reconnect", &PythonTracker::reconnect,
          R"(After each commit(), where a map of several parts is wanted: a camera that is lost for a second begins a new one, and loops are
closed. Returns a PartChange: after 'left' call Pipeline.reset(); if it moves_poses, Pipeline.correct(change.moved).)");
}

}  // namespace apso_python
