// Real trajectories whose errors were computed by evo and by the scripts of the TUM RGB-D benchmark.
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <string>

#include <doctest/doctest.h>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/io/tum_text.hpp>

namespace {
/// Folder of the trajectories. Their licences do not allow to bring them along; without them the cases below are skipped,
/// and CTest says so (tests.cmake).
std::string trajectories() {
  const char* variable = std::getenv("APSO_DATA_DIR");
  return (variable != nullptr ? std::string(variable) : std::string(APSO_SOURCE_DIR) + "/../shared/data") + "/trajectories/";
}
bool no_trajectories() { return !std::ifstream(trajectories() + "groundtruth/fr2_desk.txt").good(); }
/// Equal to the six decimals that were published.
void as_published(double value, double published) {
  INFO("value " << value << ", published " << published);
  CHECK(std::abs(value - published) <= 0.51e-6);
}
}  // namespace

TEST_CASE("published: ATE of evo 1.x, nearest stamp within 0.01 s" * doctest::skip(no_trajectories())) {
  const std::string folder = trajectories();
  struct Row {
    const char* estimate;
    const char* groundtruth;
    std::size_t pairs;
    double rmse, mean, median, std, max;
  };
  for (const Row& row : {
           Row{"fr3_walking_xyz_orbslam3", "fr3_walking_xyz", 826, 0.665905, 0.541956, 0.468050, 0.386929, 1.751150},
           Row{"fr3_walking_xyz_lccrf", "fr3_walking_xyz", 826, 0.022131, 0.019175, 0.017276, 0.011050, 0.073283},
           Row{"fr2_desk_ORB", "fr2_desk", 2174, 0.008119, 0.007492, 0.007415, 0.003129, 0.024300},
           Row{"fr1_xyz_rgbdslam", "fr1_xyz", 785, 0.013470, 0.012024, 0.011183, 0.006071, 0.034760},
       }) {
    CAPTURE(row.estimate);
    apso::AteOptions options;
    options.association = apso::AssociationRule::Evo;
    const apso::AteResult r = apso::ate(apso::read_trajectory(folder + "groundtruth/" + row.groundtruth + ".txt"),
                                        apso::read_trajectory(folder + "estimated/" + row.estimate + ".txt"), options);
    CHECK(r.status == apso::Status::Converged);
    CHECK(r.pairs.size() == row.pairs);
    as_published(r.statistics.rmse, row.rmse);
    as_published(r.statistics.mean, row.mean);
    as_published(r.statistics.median, row.median);
    as_published(r.statistics.std, row.std);
    as_published(r.statistics.max, row.max);
    if (std::string(row.estimate) == "fr3_walking_xyz_orbslam3") as_published(r.statistics.min, 0.029696);
  }
}

TEST_CASE("published: ATE and RPE of the TUM scripts on fr2_desk" * doctest::skip(no_trajectories())) {
  const std::string folder = trajectories();
  const apso::Trajectory truth = apso::read_trajectory(folder + "groundtruth/fr2_desk.txt");
  const apso::Trajectory estimate = apso::read_trajectory(folder + "estimated/fr2_desk_ORB.txt");

  const apso::AteResult ate = apso::ate(truth, estimate);
  CHECK(ate.pairs.size() == 2223);
  as_published(ate.statistics.rmse, 0.008144);
  as_published(ate.statistics.mean, 0.007514);

  apso::RpeOptions options;
  const apso::RpeResult second = apso::rpe(truth, estimate, options);
  CHECK(second.pairs.size() == 1998);
  as_published(second.translation.rmse, 0.007161);
  as_published(second.translation.mean, 0.006502);
  as_published(second.translation.median, 0.006218);
  as_published(second.translation.std, 0.003001);
  as_published(second.rotation_deg.rmse, 0.455005);
  as_published(second.rotation_deg.mean, 0.401638);

  options.form = apso::RpeForm::Paper;
  as_published(apso::rpe(truth, estimate, options).translation.rmse, 0.007093);

  options = {};
  options.unit = apso::DeltaUnit::Frames;
  const apso::RpeResult frame = apso::rpe(truth, estimate, options);
  CHECK(frame.pairs.size() == 2060);
  as_published(frame.translation.rmse, 0.003381);
  as_published(frame.rotation_deg.rmse, 0.266378);
}
