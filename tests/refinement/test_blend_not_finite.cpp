// What a blend gives for poses, weights and information that are not finite.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include <apso/refinement/blend.hpp>

#include "../foreign_types.hpp"

using namespace apso;

namespace {
const double kNaN = std::numeric_limits<double>::quiet_NaN();

Pose at(double x) {
  Pose T = Pose::Identity();
  T.translation().x() = x;
  return T;
}
// Each is no pose: one element NaN or infinite, or finite and no rotation.
std::vector<Pose> broken_poses() {
  std::vector<Pose> all;
  for (int k = 0; k < 12; ++k) {
    for (const double bad : {kNaN, std::numeric_limits<double>::infinity(), 1e308}) {
      all.push_back(at(0));
      all.back()(k % 3, k / 3) = bad;
    }
  }
  return all;
}
}  // namespace

TEST_CASE("a pose that is none leaves the blend to the other one, and two of them are refused") {
  const Pose good = at(0.01);
  Matrix6 information = Matrix6::Identity();
  for (const Pose& broken : broken_poses()) {
    for (const double w : {0.0, 0.3, 1.0, kNaN}) {
      CHECK(blend(good, broken, w).matrix() == good.matrix());
      CHECK(blend(broken, good, w).matrix() == good.matrix());
      CHECK(blend(broken, good, w, BlendForm::Decoupled).matrix() == good.matrix());
      CHECK(blend(good, broken, w, information, information).matrix() == good.matrix());
      CHECK(blend(broken, good, w, information, information).matrix() == good.matrix());
      CHECK_THROWS_AS(static_cast<void>(blend(broken, broken, w)), contract_error);
    }
    const Blended<> feature = blend(good, broken, good, BlendEvidence{0.9, 1.0});
    CHECK(feature.T_world_camera.matrix() == good.matrix());
    CHECK(feature.w_eff == 1);
    CHECK(feature.gated);
    const Blended<> direct = blend(broken, good, good, BlendEvidence{0.0, 0.0});  // nothing speaks for it but that it is one
    CHECK(direct.T_world_camera.matrix() == good.matrix());
    CHECK(direct.w_eff == 0);
    CHECK(direct.gated);
    CHECK_THROWS_AS(static_cast<void>(blend(broken, broken, good, BlendEvidence{})), contract_error);
    // of two poses that are too far apart the feature pose is taken when the prediction says nothing
    CHECK(blend(good, at(5), broken, BlendEvidence{0.9, 1.0}).T_world_camera.matrix() == good.matrix());
    // poses of a host
    const auto T = from_pose<foreign::RowMajor3x4Pose>(good);
    const auto none = from_pose<foreign::RowMajor3x4Pose>(broken);
    CHECK(to_pose(blend(T, none, 0.0)).matrix() == to_pose(T).matrix());
    CHECK(to_pose(blend(none, T, T, BlendEvidence{}).T_world_camera).matrix() == to_pose(T).matrix());
  }
}

TEST_CASE("a weight or evidence that is NaN counts as the worst, information that is NaN as not told") {
  const Pose T_f = at(0.01);
  const Pose T_d = at(0);
  CHECK(blend(T_f, T_d, kNaN).matrix() == T_d.matrix());
  CHECK(difference_weight(kNaN, 2.0) == doctest::Approx(std::exp(-2.0)));
  CHECK(effective_weight(0.2, kNaN) == 1);
  CHECK(blend(T_f, T_d, T_d, BlendEvidence{0.5, kNaN}).T_world_camera.matrix() == T_f.matrix());

  BlendEvidence e{0.5, 0.8, 0.9};
  e.direct_information = 1e4 * Matrix6::Identity();
  const Pose untold = blend(T_f, T_d, T_d, e).T_world_camera;
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity(), -1.0, 1e300}) {
    for (int k = 0; k < 36; ++k) {
      e.feature_information = 1e4 * Matrix6::Identity();
      e.feature_information(k / 6, k % 6) = bad;
      if (bad > 0 && std::isfinite(bad) && k / 6 == k % 6) continue;  // sure of one direction
      if (std::abs(bad) < 1e4 && k / 6 != k % 6) continue;            // a correlation
      CAPTURE(bad);
      CAPTURE(k);
      CHECK(blend(T_f, T_d, T_d, e).T_world_camera.matrix() == untold.matrix());
    }
  }
  e.feature_information = Matrix6::Zero();
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity()}) {
    e.direct_information = 1e4 * Matrix6::Identity();
    e.direct_information(2, 2) = bad;
    const Pose T = blend(T_f, T_d, T_d, e).T_world_camera;
    CHECK(is_rigid(T));
    CHECK(T.translation().x() >= 0);
    CHECK(T.translation().x() <= 0.01);
  }
}
