// Two small trajectories whose errors were computed by another route: oracle/make_oracle.py, which wrote both files and
// printed the numbers below. Unlike the published recordings they are always here.
#include <cmath>
#include <string>

#include <doctest/doctest.h>

#include <apso/evaluate.hpp>
#include <apso/io/tum_text.hpp>

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
