// Two small trajectories whose errors were computed by another route: oracle/make_oracle.py, which wrote both files and
// printed the numbers below. Unlike the published recordings they are always here.
#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include <apso/evaluate.hpp>
#include <apso/io/trajectory_file.hpp>

namespace {
const std::string kFolder = std::string(APSO_SOURCE_DIR) + "/tests/evaluation/oracle/";
void same(double value, double oracle) {
  INFO("value " << value << ", oracle " << oracle);
  CHECK(std::abs(value - oracle) <= 1e-10);
}
}  // namespace

TEST_CASE("ATE and RPE agree with an independent computation") {
  const apso::Trajectory truth = apso::read_trajectory(kFolder + "truth.txt");
  const apso::Trajectory estimate = apso::read_trajectory(kFolder + "estimate.txt");
  const apso::AteResult ate = apso::ate(truth, estimate);
  CHECK(ate.pairs.size() == 77);
  same(ate.statistics.rmse, 0.020235728632);
  same(ate.statistics.mean, 0.019518816266);
  same(ate.statistics.max, 0.025885437185);

  apso::RpeOptions options;
  options.form = apso::RpeForm::Paper;
  const apso::RpeResult rpe = apso::rpe(truth, estimate, options);
  CHECK(rpe.pairs.size() == 61);
  same(rpe.translation.rmse, 0.031275996246);
  same(rpe.rotation_deg.rmse, 0.375478717343);
}

TEST_CASE("the other formats and alignments agree with an independent computation") {
  using apso::TrajectoryAlignment;
  struct Row {
    const char *truth, *estimate;
    TrajectoryAlignment alignment;
    apso::Axis gravity;
    double rmse, mean, max, scale;
  };
  for (const Row& row : {
           Row{"truth_euroc.csv", "estimate_ns.txt", TrajectoryAlignment::Se3, apso::Axis::Z, 0.020235728632, 0.019518816266,
               0.025885437185, 1},
           Row{"truth_euroc.csv", "estimate_ns.txt", TrajectoryAlignment::Sim3, apso::Axis::Z, 0.016928158843, 0.015557940803,
               0.027103180020, 0.987996406},
           Row{"truth_euroc.csv", "estimate_ns.txt", TrajectoryAlignment::Yaw, apso::Axis::Z, 0.651856030668, 0.588145673253,
               0.977121955168, 1},
           Row{"truth_kitti.txt", "estimate_kitti.txt", TrajectoryAlignment::Se3, apso::Axis::Z, 0.163150604935, 0.149082632560,
               0.359669129160, 1},
           Row{"truth_kitti.txt", "estimate_kitti.txt", TrajectoryAlignment::Sim3, apso::Axis::Z, 0.072753627903, 0.069419249888,
               0.154358455743, 1.197629179},
           Row{"truth_kitti.txt", "estimate_kitti.txt", TrajectoryAlignment::Yaw, apso::Axis::Y, 0.243071008702, 0.229111668720,
               0.419957434524, 1},
       }) {
    CAPTURE(row.truth);
    CAPTURE(static_cast<int>(row.alignment));
    apso::AteOptions options;
    options.alignment = row.alignment;
    options.gravity_axis = row.gravity;
    const apso::AteResult r = apso::ate(apso::read_trajectory_file(kFolder + row.truth).trajectory,
                                        apso::read_trajectory_file(kFolder + row.estimate).trajectory, options);
    CHECK(r.pairs.size() == 77);
    // a search finds the smallest rmse to 1e-15, but where it is only to the root of that
    same(r.statistics.rmse, row.rmse);
    CHECK(r.statistics.mean == doctest::Approx(row.mean).epsilon(1e-7));
    CHECK(r.statistics.max == doctest::Approx(row.max).epsilon(1e-7));
    CHECK(r.scale == doctest::Approx(row.scale).epsilon(1e-7));
  }
  apso::RpeOptions options;
  options.form = apso::RpeForm::Paper;
  options.unit = apso::DeltaUnit::Frames;
  const apso::RpeResult rpe = apso::rpe(apso::read_trajectory_file(kFolder + "truth_kitti.txt").trajectory,
                                        apso::read_trajectory_file(kFolder + "estimate_kitti.txt").trajectory, options);
  CHECK(rpe.pairs.size() == 76);
  CHECK(rpe.translation.rmse == doctest::Approx(0.015661511736).epsilon(1e-8));
  CHECK(rpe.rotation_deg.rmse == doctest::Approx(0.361103723319).epsilon(1e-7));
}
