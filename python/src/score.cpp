// score: how good is one frame?
#include <optional>
#include <string>

#include <pybind11/stl.h>

#include <apso/score.hpp>

#include "arrays.hpp"
#include "module.hpp"
#include "options.hpp"

namespace apso_python {
namespace {

template <class Function>
void for_each_score_of(const PythonAssessment& a, Function&& f) {
  apso::for_each_score(a.assessment, [&](const char* name, const std::optional<double>& value, double weight, apso::Better better) {
    f(name, value, weight, better);
  });
}

template <class Maybe>
std::optional<double> number(const Maybe& score) {
  return score ? std::optional<double>(score->value()) : std::nullopt;
}

PythonAssessment score(const py::array& I, const py::array& D, const py::object& K, const py::object& keypoints, const py::object& tracks,
                       const py::object& detections, const py::object& dynamic_probability, const std::optional<double>& depth_unit,
                       double timestamp, const py::dict& options) {
  const ArrayFrame frame(I, D, "I", "D", depth_unit);
  const apso::Pinhole camera = camera_of(K, frame.width(), frame.height());
  apso::AssessorOptions o;
  set_options(o, options);
  std::optional<std::vector<apso::Keypoint>> corners;
  std::optional<std::vector<apso::PointTrack>> points;
  std::optional<std::vector<apso::Detection>> objects;
  if (!keypoints.is_none()) corners = keypoints_of(keypoints);
  if (!tracks.is_none()) points = tracks_of(tracks);
  if (!detections.is_none()) objects = detections_of(detections);
  std::optional<ArrayImage> mask;
  if (!dynamic_probability.is_none()) {
    mask.emplace(py::array::ensure(dynamic_probability), "dynamic_probability");
    if (!mask->floating()) throw py::type_error("dynamic_probability must be float32 in [0, 1]");
    if (mask->width() != frame.width() || mask->height() != frame.height()) {
      throw py::value_error("dynamic_probability has shape " + mask->shape() + " and I has shape " + frame.shape() +
                            ": expected the same shape");
    }
  }
  const auto now = frame.at(timestamp, camera);
  const py::gil_scoped_release release;
  apso::SceneAssessor assessor(camera, o);
  const apso::AnyImage probability = mask ? mask->any() : apso::AnyImage();
  const auto assess = [&](const auto& k, const auto& t, const auto& d) {
    return PythonAssessment{assessor.assess(apso::assessment_input(now, k, t, d, probability))};
  };
  // None is "not looked for", which is not the same as an empty list.
  const auto with_objects = [&](const auto& k, const auto& t) { return objects ? assess(k, t, *objects) : assess(k, t, apso::none); };
  const auto with_tracks = [&](const auto& k) { return points ? with_objects(k, *points) : with_objects(k, apso::none); };
  return corners ? with_tracks(*corners) : with_tracks(apso::none);
}

}  // namespace

void add_score(py::module_& m) {
  using A = PythonAssessment;
  py::class_<A>(m, "Assessment", "How good a frame is, and why. A score that could not be computed is None.")
      .def_property_readonly(
          "state", [](const A& a) { return apso::to_string(a.assessment.state); }, "'INITIALISING', 'GOOD' or 'BAD'.")
      .def_property_readonly(
          "S_total", [](const A& a) { return a.assessment.S_total.value(); }, "The frame by itself, [0, 1], higher is better.")
      .def_property_readonly(
          "S_change", [](const A& a) { return number(a.assessment.S_change); },
          "Change since the reference, [0, 1], lower is better; None for the first frame.")
      .def_property_readonly(
          "S_final", [](const A& a) { return number(a.assessment.S_final); }, "What decides, [0, 1]; None while a reference is searched.")
      .def_property_readonly(
          "S_inn", [](const A& a) { return a.assessment.S_inn.value(); },
          "Factor of S_final, [0, 1]: how well the feature pose agrees with the predicted one; 1 where one is not known.")
      .def_property_readonly(
          "th_differ", [](const A& a) { return a.assessment.th_differ; }, "S_final below it is BAD.")
      .def_property_readonly(
          "dynamic_ratio", [](const A& a) { return a.assessment.dynamic_ratio; }, "Share of the image that moves, [0, 1].")
      .def_property_readonly(
          "scores",
          [](const A& a) {
            py::dict out;
            for_each_score_of(a, [&](const char* name, const std::optional<double>& v, double, apso::Better) { out[name] = v; });
            return out;
          },
          "All scores by name, e.g. scores['S_feature']; None where one is missing.")
      .def_property_readonly(
          "weights",
          [](const A& a) {
            py::dict out;
            for_each_score_of(a, [&](const char* name, const std::optional<double>&, double w, apso::Better) { out[name] = w; });
            return out;
          },
          "Weights of the scores by name.")
      .def_property_readonly(
          "measured",
          [](const A& a) {
            py::dict out;
            apso::for_each_measurement(a.assessment, [&](const std::string& name, double v) { out[py::str(name)] = v; });
            return out;
          },
          "What the scores were computed from, by name; NaN where a score is missing.")
      .def(
          "explain", [](const A& a) { return apso::explain(a.assessment); }, "One sentence: the state and what speaks against the frame.")
      .def("__repr__", [](const A& a) { return "<apso.Assessment " + apso::explain(a.assessment) + ">"; });
  m.def("score", &score, py::arg("I"), py::arg("D"), py::arg("K"), py::kw_only(), py::arg("keypoints") = py::none(),
        py::arg("tracks") = py::none(), py::arg("detections") = py::none(), py::arg("dynamic_probability") = py::none(),
        py::arg("depth_unit") = py::none(), py::arg("timestamp") = 0.0, py::arg("options") = py::dict(),
        R"(Score one RGB-D frame by itself.

I: (height, width), grey: uint8 or uint16, or float32 in [0, 1].
D: (height, width), depth: float32 in metres, or uint8 or uint16 with depth_unit (metres per unit).
K: (3, 3), or (fx, fy, cx, cy), in pixels.
keypoints: (N, 2 to 5), x, y[, response[, angle [deg][, octave]]] in pixels; None: S_feature is missing.
tracks: (N, 6), id, x, y, previous_x, previous_y, age; None: S_mc is missing.
detections: (N, 6 or 7), x, y, width, height [px], score, class_id[, movable]; None: what needs them is missing.
dynamic_probability: (height, width), float32 in [0, 1]; None: everything is static.
timestamp: [s].
options: settings by name, e.g. {"decision.th_differ": 0.6}.

The images are read where they lie, without the interpreter lock. Returns an Assessment; for frame after frame, with
change and decision, use Pipeline.)");
}

}  // namespace apso_python
