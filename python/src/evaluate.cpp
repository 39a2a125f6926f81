// evaluate: errors of a trajectory.
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include <apso/evaluate.hpp>

#include "arrays.hpp"
#include "module.hpp"
#include "options.hpp"

namespace apso_python {
namespace {

struct Evaluation {
  apso::AteResult ate;
  apso::RpeResult rpe;
  std::size_t groundtruth_poses = 0;
  std::size_t estimate_poses = 0;
};

/// A trajectory of an (N, 8) array, or of a pair of (N,) stamps and (N, 4, 4) poses.
apso::Trajectory trajectory_of(const py::object& object, const std::string& name) {
  apso::Trajectory out;
  if (py::isinstance<py::tuple>(object) || py::isinstance<py::list>(object)) {
    const auto parts = py::reinterpret_borrow<py::sequence>(object);
    if (parts.size() == 2) {
      const auto stamps = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(parts[0]);
      const auto poses = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(parts[1]);
      if (!stamps || !poses) throw py::error_already_set();
      if (stamps.ndim() != 1 || poses.ndim() != 3 || poses.shape(0) != stamps.shape(0) || poses.shape(1) != 4 || poses.shape(2) != 4) {
        throw py::value_error(name + ": the stamps have shape " + shape_text(stamps) + " and the poses " + shape_text(poses) +
                              ": expected (N,) and (N, 4, 4)");
      }
      for (py::ssize_t i = 0; i < stamps.shape(0); ++i) {
        apso::Pose::MatrixType T;
        for (int r = 0; r < 4; ++r) {
          for (int c = 0; c < 4; ++c) T(r, c) = poses.at(i, r, c);
        }
        if (!apso::is_rigid(apso::Pose(T))) throw py::value_error(name + ": pose " + std::to_string(i) + " is no rigid motion");
        out.push_back({stamps.at(i), apso::Pose(T)});
      }
      return out;
    }
  }
  const auto a = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!a) throw py::error_already_set();
  if (a.ndim() != 2 || a.shape(1) != 8) {
    throw py::value_error(name + " has shape " + shape_text(a) + ": expected (N, 8), timestamp tx ty tz qx qy qz qw, or (stamps, poses)");
  }
  for (py::ssize_t i = 0; i < a.shape(0); ++i) {
    const Eigen::Quaterniond q(a.at(i, 7), a.at(i, 4), a.at(i, 5), a.at(i, 6));
    const double norm = q.norm();
    if (!(norm > 1e-9) || !(norm < 1e9)) throw py::value_error(name + ": the quaternion of pose " + std::to_string(i) + " is none");
    const Eigen::Quaterniond unit(q.w() / norm, q.x() / norm, q.y() / norm, q.z() / norm);
    out.push_back({a.at(i, 0), apso::make_pose(apso::rotation(apso::unit(unit)), {a.at(i, 1), a.at(i, 2), a.at(i, 3)})});
  }
  return out;
}

Evaluation evaluate(const py::object& groundtruth, const py::object& estimate, const std::string& alignment, const std::string& association,
                    double max_difference, const std::string& gravity_axis, double delta, const std::string& unit, const std::string& form,
                    double time_offset) {
  const apso::Trajectory truth = trajectory_of(groundtruth, "groundtruth");
  const apso::Trajectory poses = trajectory_of(estimate, "estimate");
  apso::AteOptions a;
  a.alignment = enum_of<apso::TrajectoryAlignment>(alignment, "alignment");
  a.association = enum_of<apso::AssociationRule>(association, "association");
  a.max_difference = max_difference;
  a.gravity_axis = enum_of<apso::Axis>(gravity_axis, "gravity_axis");
  a.time_offset = time_offset;
  apso::RpeOptions r;
  r.delta = delta;
  r.unit = enum_of<apso::DeltaUnit>(unit, "unit");
  r.form = enum_of<apso::RpeForm>(form, "form");
  r.time_offset = time_offset;
  const py::gil_scoped_release release;
  Evaluation e;
  e.groundtruth_poses = truth.size();
  e.estimate_poses = poses.size();
  e.ate = apso::ate(truth, poses, a);
  if (!apso::succeeded(e.ate.status)) {
    const double limit = max_difference > 0 ? max_difference : apso::default_max_difference(a.association);
    throw py::value_error(std::to_string(e.ate.pairs.size()) + " pairs of poses within " + std::to_string(limit) + " s, need " +
                          std::to_string(apso::pairs_needed(a.alignment)));
  }
  const bool scaled = e.ate.scale != 1;  // a free scale is that of the relative errors, too
  e.rpe = apso::rpe(truth, scaled ? apso::aligned(poses, e.ate) : poses, r);
  return e;
}

}  // namespace

void add_evaluate(py::module_& m) {
  using apso::Statistics;
  py::class_<Statistics>(m, "Statistics", "Summary of a list of errors, in the unit of the errors; all 0 where count is 0.")
      .def_readonly("rmse", &Statistics::rmse)
      .def_readonly("mean", &Statistics::mean)
      .def_readonly("median", &Statistics::median)
      .def_readonly("std", &Statistics::std, "Of the population.")
      .def_readonly("min", &Statistics::min)
      .def_readonly("max", &Statistics::max)
      .def_readonly("count", &Statistics::count, "Pairs that the errors are of.")
      .def("__repr__", [](const Statistics& s) {
        return "<apso.Statistics rmse " + std::string(py::str(py::float_(s.rmse))) + " over " + std::to_string(s.count) + " pairs>";
      });
  py::class_<Evaluation>(m, "Evaluation", "Absolute and relative error of a trajectory.")
      .def_property_readonly(
          "ate", [](const Evaluation& e) { return e.ate.statistics; }, "Position errors after alignment [m].")
      .def_property_readonly(
          "rpe_translation", [](const Evaluation& e) { return e.rpe.translation; }, "[m] per interval.")
      .def_property_readonly(
          "rpe_rotation", [](const Evaluation& e) { return e.rpe.rotation_deg; }, "[deg] per interval.")
      .def_readonly("estimate_poses", &Evaluation::estimate_poses, "Poses of the estimate; ate.count of them have an error.")
      .def_readonly("groundtruth_poses", &Evaluation::groundtruth_poses)
      .def_property_readonly(
          "unique", [](const Evaluation& e) { return e.ate.status == apso::Status::Converged; },
          "False: the positions do not fix the rotation of the alignment (the errors are right).")
      .def_property_readonly(
          "T_groundtruth_estimate", [](const Evaluation& e) { return array_of(e.ate.T_groundtruth_estimate); },
          "4x4: x_groundtruth = R (scale x_estimate) + t.")
      .def_property_readonly(
          "scale", [](const Evaluation& e) { return e.ate.scale; }, "Of the estimate; 1 unless alignment='sim3'.")
      .def_property_readonly(
          "pairs",
          [](const Evaluation& e) {
            py::array_t<std::int64_t> out({static_cast<py::ssize_t>(e.ate.pairs.size()), py::ssize_t{2}});
            auto to = out.mutable_unchecked<2>();
            for (py::ssize_t i = 0; i < to.shape(0); ++i) {
              to(i, 0) = static_cast<std::int64_t>(e.ate.pairs[static_cast<std::size_t>(i)].first);
              to(i, 1) = static_cast<std::int64_t>(e.ate.pairs[static_cast<std::size_t>(i)].second);
            }
            return out;
          },
          "(N, 2): indices of the ground truth and of the estimate.")
      .def_property_readonly(
          "errors",
          [](const Evaluation& e) { return py::array_t<double>(static_cast<py::ssize_t>(e.ate.errors.size()), e.ate.errors.data()); },
          "(N,): position error of each pair [m].")
      .def("__repr__", [](const Evaluation& e) {
        return "<apso.Evaluation ATE rmse " + std::string(py::str(py::float_(e.ate.statistics.rmse))) + " m over " +
               std::to_string(e.ate.pairs.size()) + " of " + std::to_string(e.estimate_poses) + " poses>";
      });
  m.def("evaluate", &evaluate, py::arg("groundtruth"), py::arg("estimate"), py::kw_only(), py::arg("alignment") = "se3",
        py::arg("association") = "tum", py::arg("max_difference") = 0.0, py::arg("gravity_axis") = "z", py::arg("delta") = 1.0,
        py::arg("unit") = "s", py::arg("form") = "tum", py::arg("time_offset") = 0.0,
        R"(Absolute and relative error of an estimated trajectory.

groundtruth, estimate: (N, 8), rows of timestamp tx ty tz qx qy qz qw [s, m], or a pair of (N,) stamps and (N, 4, 4) poses
    T_world_body. Stamps increase.
alignment: 'se3' (rigid), 'sim3' (with a scale), 'yaw' (translation and turn about gravity_axis) or 'none'.
association: 'tum' (one-to-one, < 0.02 s) or 'evo' (nearest, <= 0.01 s); max_difference [s] replaces the limit unless 0.
delta, unit: interval of the relative error; unit 's', 'f' (frames), 'm', 'rad' or 'deg'.
form: 'tum' as evaluate_rpe.py, 'paper' as printed by Sturm et al. and computed by evo.
time_offset: added to the stamps of the estimate [s].

Returns an Evaluation; ValueError when too few poses belong together. numpy.loadtxt(file) reads a TUM file.)");
}

}  // namespace apso_python
