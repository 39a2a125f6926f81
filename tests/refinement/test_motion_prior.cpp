// A feature pose joined with the prediction: the weights by hand, and a camera that is followed through noise.
#include <cmath>
#include <random>

#include <doctest/doctest.h>

#include <apso/refinement/motion_prior.hpp>

#include "../foreign_types.hpp"

using namespace apso;

namespace {
Pose shifted(double x) { return make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, 0, 0)); }

/// Has seen predictions that were off by so much.
MotionPrior learned(double metres, int frames = 9) {
  MotionPrior prior;
  for (int i = 0; i < frames; ++i) prior.learn(Pose::Identity(), shifted(metres));
  return prior;
}
Matrix6 information(double sigma) { return Matrix6::Identity() / (kFeatureInformationShare * sigma * sigma); }  // believed: 1 / sigma^2

// One coordinate: variances of the features, of the pose before and of the motion.
double share_of_features(double f, double before, double motion) { return (before + motion) / (f + before + motion); }
double variance_of_both(double f, double before, double motion) { return f * (before + motion) / (f + before + motion); }
}  // namespace

TEST_CASE("a prior that has seen too little, or that goes on from a guess, is not asked") {
  CHECK_FALSE(MotionPrior().ready());
  MotionPrior prior = learned(.01, 4);
  prior.refined();
  CHECK_FALSE(prior.ready());
  prior.learn(Pose::Identity(), shifted(.01));
  CHECK(prior.ready());
  prior.lost();
  CHECK_FALSE(prior.ready());
  prior.predicted();
  CHECK_FALSE(prior.ready());
  prior.measured(Matrix6::Zero());
  CHECK(prior.ready());
  prior.reset();
  prior.refined();
  CHECK_FALSE(prior.ready());
}

TEST_CASE("features and prediction count by their variances, and so does the pose before") {
  const double f = .006 * .006;                    // [m^2]
  const double q = std::pow(3 * .004 / 1.538, 2);  // what predictions were off in a direction, and three times that
  MotionPrior prior = learned(.004);
  prior.refined();  // exact
  double c = 0;
  for (int frame = 0; frame < 6; ++frame) {
    CAPTURE(frame);
    const Pose T = prior.join(shifted(.02), Pose(Pose::Identity()), information(.006));
    CHECK(T(0, 3) == doctest::Approx(.02 * share_of_features(f, c, q)).epsilon(1e-3));
    c = variance_of_both(f, c, q);
  }
  prior.predicted();  // nothing was measured: less is known of it
  CHECK(prior.join(shifted(.02), Pose(Pose::Identity()), information(.006))(0, 3) ==
        doctest::Approx(.02 * share_of_features(f, c + q, q)).epsilon(1e-3));
  prior.measured(information(.006));  // within the gate of blend(), so that it is a little better known than the features say
  const double gate = kBlendGateTranslation * kBlendGateTranslation;
  CHECK(prior.join(shifted(.02), Pose(Pose::Identity()), information(.006))(0, 3) ==
        doctest::Approx(.02 * share_of_features(f, f * gate / (f + gate), q)).epsilon(1e-3));
}

TEST_CASE("the rotation is that of the features") {
  MotionPrior prior = learned(.001);
  prior.refined();
  const Pose T_feature = compose(shifted(.02), se3_exp((Twist() << 0, 0, 0, .03, -.02, .01).finished()));
  const Pose T = prior.join(T_feature, Pose(Pose::Identity()), information(.006));
  CHECK((T.linear() - T_feature.linear()).norm() < 1e-9);
  CHECK(T(0, 3) < .01);
}

TEST_CASE("a direction that the features leave open is the prediction's") {
  MotionPrior prior = learned(.004);
  prior.refined();
  Matrix6 F = information(.001);
  F(2, 2) = 1e-9;
  const Pose T_feature = make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(.02, 0, .05));
  const Pose T = prior.join(T_feature, Pose(Pose::Identity()), F);
  CHECK(T(0, 3) > .019);
  CHECK(std::abs(T(2, 3)) < 1e-6);
}

TEST_CASE("a camera is followed more closely through noisy features than by them, and no error of the prediction is carried on") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> one(0, 1);
    const auto noise = [&](double v, double w) {
      return se3_exp(
          (Twist() << v * one(random), v * one(random), v * one(random), w * one(random), w * one(random), w * one(random)).finished());
    };
    MotionPrior prior;
    const Twist velocity = (Twist() << .02, .005, -.01, .01, -.02, .005).finished();
    Pose T_true = Pose::Identity(), T_camera = Pose::Identity();
    double features = 0, filtered = 0;
    for (int i = 0; i < 300; ++i) {
      const Pose T_motion = se3_exp(velocity);
      T_true = compose(T_true, T_motion);
      const Pose T_predicted = compose(compose(T_camera, T_motion), noise(.002, .001));
      if (i < 50) {  // trusted
        T_camera = T_true;
        prior.learn(T_predicted, T_camera);
        prior.refined();
        continue;
      }
      const Pose T_feature = compose(T_true, noise(.01, .005));
      T_camera = prior.join(T_feature, T_predicted, information(.01));
      features += std::pow(translation_norm(se3_log(compose(inverse(T_true), T_feature))), 2);
      filtered += std::pow(translation_norm(se3_log(compose(inverse(T_true), T_camera))), 2);
    }
    CHECK(filtered < .6 * features);
  }
}

TEST_CASE_TEMPLATE("a pose comes back as the type it came in", PoseT, foreign::DualQuaternionPose, foreign::RowMajor3x4Pose) {
  MotionPrior own = learned(.004), theirs;
  for (int i = 0; i < 9; ++i) theirs.learn(from_pose<PoseT>(Pose::Identity()), from_pose<PoseT>(shifted(.004)));
  own.refined();
  theirs.refined();
  const PoseT T = theirs.join(from_pose<PoseT>(shifted(.02)), from_pose<PoseT>(Pose::Identity()), information(.006));
  CHECK((to_pose(T).matrix() - own.join(shifted(.02), Pose(Pose::Identity()), information(.006)).matrix()).norm() < 1e-6);
}
