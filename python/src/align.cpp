// align and blend.
#include <memory>
#include <optional>
#include <string>

#include <pybind11/stl.h>

#include <apso/align.hpp>
#include <apso/blend.hpp>

#include "arrays.hpp"
#include "module.hpp"
#include "options.hpp"

namespace apso_python {
namespace {

using Alignment = apso::PairAlignment<apso::Pose>;

Alignment align(const py::array& I0, const py::array& D0, const py::array& I1, const py::array& D1, const py::object& K,
                const std::optional<double>& depth_unit, const py::object& guess, const py::dict& options) {
  const ArrayFrame first(I0, D0, "I0", "D0", depth_unit);
  const ArrayFrame second(I1, D1, "I1", "D1", depth_unit);
  if (first.shape() != second.shape()) {
    throw py::value_error("I0 has shape " + first.shape() + " and I1 has shape " + second.shape() + ": expected the same shape");
  }
  const apso::Pinhole camera = camera_of(K, first.width(), first.height());
  const apso::Pose T = guess.is_none() ? apso::identity_pose() : rigid_pose_of(guess, "guess");
  apso::PairOptions o;
  set_options(o, options);
  const auto reference = first.at(0, camera);
  const auto current = second.at(0, camera);
  const py::gil_scoped_release release;
  return apso::align(reference, current, T, o);
}

py::array_t<double> blend(const py::object& T_feature, const py::object& T_direct, double w, const py::object& feature_information,
                          const py::object& direct_information) {
  const apso::Pose F = pose_of(T_feature, "T_feature");
  const apso::Pose D = pose_of(T_direct, "T_direct");
  if (feature_information.is_none() != direct_information.is_none()) {
    throw py::value_error("feature_information and direct_information: give both or none");
  }
  if (feature_information.is_none()) return array_of(apso::blend(F, D, w));
  return array_of(apso::blend(F, D, w, matrix_of<apso::Matrix6>(feature_information, "feature_information", 6),
                              matrix_of<apso::Matrix6>(direct_information, "direct_information", 6)));
}

}  // namespace

void add_align(py::module_& m) {
  py::class_<Alignment>(m, "Alignment", "Motion between two frames, as apso.align found it.")
      .def_property_readonly(
          "ok", [](const Alignment& a) { return apso::succeeded(a.status); }, "True if T may be used; otherwise T is the guess.")
      .def_property_readonly(
          "status", [](const Alignment& a) { return apso::to_string(a.status); }, "How it ended, e.g. 'Converged', 'NoOverlap'.")
      .def_property_readonly(
          "T", [](const Alignment& a) { return array_of(a.T_current_reference); },
          "T_current_reference, 4x4: maps points of the first camera into the second [m].")
      .def_readonly("confidence", &Alignment::confidence, "How far T can be trusted, [0, 1]; above 0.5 it is probably right.")
      .def_property_readonly(
          "information", [](const Alignment& a) { return array_of(a.detail.information); },
          "6x6, of the increment (v, w) in the second camera [1/m^2, 1/rad^2]; 0 in open directions.")
      .def_property_readonly(
          "covariance", [](const Alignment& a) { return array_of(a.detail.covariance); },
          "6x6, the inverse of the information on the directions that are determined [m^2, m rad, rad^2].")
      .def_property_readonly(
          "open_directions", [](const Alignment& a) { return a.detail.degenerate_count; },
          "Directions of motion that the images leave open, 0 to 6.")
      .def_property_readonly(
          "ambiguous", [](const Alignment& a) { return a.detail.ambiguous; },
          "Whether another motion explains the images as well, because a pattern repeats.")
      .def_property_readonly(
          "valid_share", [](const Alignment& a) { return a.detail.valid_share; }, "Share of the pixels that were compared, [0, 1].")
      .def_property_readonly(
          "iterations", [](const Alignment& a) { return a.detail.iterations; }, "Iterations over all pyramid levels.")
      .def_property_readonly(
          "cost", [](const Alignment& a) { return a.detail.cost; }, "Final mean robust cost.")
      .def_readonly("backward_translation", &Alignment::backward_translation,
                    "With options={'backward': True}: difference to the way back [m].")
      .def_readonly("backward_rotation", &Alignment::backward_rotation, "The same for the rotation [rad].")
      .def("__repr__", [](const Alignment& a) {
        return "<apso.Alignment " + std::string(apso::to_string(a.status)) + ", confidence " +
               std::string(py::str(py::float_(a.confidence))) + ">";
      });
  m.def("align", &align, py::arg("I0"), py::arg("D0"), py::arg("I1"), py::arg("D1"), py::arg("K"), py::kw_only(),
        py::arg("depth_unit") = py::none(), py::arg("guess") = py::none(), py::arg("options") = py::dict(),
        R"(Find the camera motion between two RGB-D frames by direct alignment.

I0, I1: (height, width), grey: uint8 or uint16, or float32 in [0, 1].
D0, D1: (height, width), depth registered to the grey images: float32 in metres, or uint8 or uint16 with depth_unit.
    0, negative, NaN and infinity are no measurement.
K: (3, 3) matrix of the undistorted camera of both frames, or (fx, fy, cx, cy), in pixels.
depth_unit: metres per unit of D0 and D1, e.g. 1/5000 for TUM files, 0.001 for millimetres.
guess: (4, 4), T_current_reference to begin with; the identity if None.
options: settings by name, e.g. {"alignment.alpha": 1.5, "backward": True}.

The arrays are read where they lie, in any row stride, without the interpreter lock: do not change them meanwhile.
Returns an Alignment. A failure is alignment.ok == False; wrong arguments raise ValueError or TypeError.)");
  m.def("blend", &blend, py::arg("T_feature"), py::arg("T_direct"), py::arg("w") = 0.5, py::arg("feature_information") = py::none(),
        py::arg("direct_information") = py::none(),
        R"(Join two estimates of one pose, T_world_camera, both (4, 4).

w: weight of T_feature, [0, 1]; 1 gives T_feature and 0 gives T_direct, bit by bit.
feature_information, direct_information: (6, 6), of increments (v, w) in the camera frame [1/m^2, 1/rad^2], 0 in directions
    about which a pose knows nothing. Without them the poses are joined along the screw between them.

Returns the pose, (4, 4). A pose that is no rigid motion (NaN, say) is not used; ValueError when both are none.)");
}

}  // namespace apso_python
