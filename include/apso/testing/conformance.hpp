/// \file
/// Checks that the traits you wrote for your own types mean what the library thinks they mean. Needs no test framework:
/// every check returns a report, which is empty when all is well.
///
/// \code
/// CHECK(apso::testing::check_pose_type<MyPose>().text() == "");
/// \endcode
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/detection.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// What a conformance check found.
struct ConformanceReport {
  std::vector<std::string> failures;  ///< one sentence each; empty = conforms

  [[nodiscard]] bool passed() const { return failures.empty(); }
  /// All failures, one a line.
  [[nodiscard]] std::string text() const {
    std::string all;
    for (const std::string& f : failures) all += f + '\n';
    return all;
  }
  /// Notes a failure unless `ok`; each sentence is kept once.
  void expect(bool ok, const std::string& sentence) {
    if (ok) return;
    for (const std::string& f : failures) {
      if (f == sentence) return;
    }
    failures.push_back(sentence);
  }
};

/// Rigid motions that bring out mistakes: the identity, tiny and large rotations about skew axes, angles next to pi.
[[nodiscard]] inline std::vector<Pose> conformance_poses() {
  std::vector<Pose> poses{identity_pose()};
  const double angles[] = {1e-9, 1e-4, 0.1, 1.0, 2.5, 3.14159};
  int i = 0;
  for (const double angle : angles) {
    ++i;
    Eigen::Vector3d axis(std::sin(1.0 * i), std::cos(2.0 * i), std::sin(3.0 * i + 1.0));
    axis.normalize();
    Twist xi;
    xi.head<3>() = Eigen::Vector3d(0.3 * i, -0.7, 1.1 / i);
    xi.tail<3>() = angle * axis;
    poses.push_back(se3_exp(xi));
  }
  return poses;
}

/// Rotation and translation survive make() for many poses, and rotations are orthonormal with determinant +1.
template <class PoseT>
[[nodiscard]] ConformanceReport check_pose_type() {
  check_pose<PoseT>();
  using S = typename pose_traits<PoseT>::scalar;
  // A type may store the rotation as a quaternion: a few roundings of numbers up to 1 are allowed.
  const double tolerance = 32.0 * static_cast<double>(Eigen::NumTraits<S>::epsilon());
  ConformanceReport report;
  for (const Pose& wanted : conformance_poses()) {
    const Pose got = to_pose(from_pose<PoseT>(wanted));
    const Eigen::Matrix3d R = got.linear();
    const double scale = 1.0 + wanted.translation().norm();
    report.expect((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() <= tolerance && R.determinant() > 0,
                  "rotation(make(R, t)) is not a rotation matrix");
    report.expect((R - wanted.linear()).norm() <= tolerance,
                  "rotation(make(R, t)) differs from R (transposed, or a different order of axes?)");
    report.expect((got.translation() - wanted.translation()).norm() <= tolerance * scale,
                  "translation(make(R, t)) differs from t (inverse pose, or a different unit?)");
  }
  return report;
}

/// As above, and the pose moves points as x_a = R x_b + t.
/// \param apply how your type maps a point: `Eigen::Vector3d apply(const PoseT&, const Eigen::Vector3d&)`
template <class PoseT, class Apply>
[[nodiscard]] ConformanceReport check_pose_type(Apply&& apply) {
  ConformanceReport report = check_pose_type<PoseT>();
  using S = typename pose_traits<PoseT>::scalar;
  const double tolerance = 64.0 * static_cast<double>(Eigen::NumTraits<S>::epsilon());
  const Eigen::Vector3d x_b(0.4, -1.2, 2.0);
  for (const Pose& T_a_b : conformance_poses()) {
    const Eigen::Vector3d x_a = apply(from_pose<PoseT>(T_a_b), x_b);
    const Eigen::Vector3d wanted = T_a_b * x_b;
    report.expect((x_a - wanted).norm() <= tolerance * (1.0 + wanted.norm()),
                  "the pose does not map points as x_a = R x_b + t (is it the inverse?)");
  }
  return report;
}

/// Sizes are positive, and `row` (if any) reads the same pixels as `at`.
/// \param image any image that is not empty, best with a width different from its height
template <class ImageT>
[[nodiscard]] ConformanceReport check_image_type(const ImageT& image) {
  check_image<ImageT>();
  using Traits = image_traits<ImageT>;
  using Value = typename Traits::value_type;
  ConformanceReport report;
  const int width = Traits::width(image);
  const int height = Traits::height(image);
  report.expect(width > 0 && height > 0, "width(image) and height(image) must be > 0 for the image given");
  if (!report.passed()) return report;
  if constexpr (has_row_v<ImageT>) {
    for (int y = 0; y < height; ++y) {
      const Value* row = Traits::row(image, y);
      report.expect(row != nullptr, "row(image, y) is null");
      if (row == nullptr) return report;
      for (int x = 0; x < width; ++x) {
        const Value a = static_cast<Value>(Traits::at(image, x, y));
        const bool both_nan = a != a && row[x] != row[x];
        report.expect(a == row[x] || both_nan, "row(image, y)[x] differs from at(image, x, y)");
      }
    }
  }
  return report;
}

/// As above, and `at(image, x, y)` gives the value that `expected(x, y)` says is there (finds swapped x and y).
template <class ImageT, class Expected>
[[nodiscard]] ConformanceReport check_image_type(const ImageT& image, Expected&& expected) {
  ConformanceReport report = check_image_type(image);
  using Traits = image_traits<ImageT>;
  for (int y = 0; y < Traits::height(image); ++y) {
    for (int x = 0; x < Traits::width(image); ++x) {
      report.expect(static_cast<double>(Traits::at(image, x, y)) == static_cast<double>(expected(x, y)),
                    "at(image, x, y) is not the pixel of column x and row y (x and y swapped?)");
    }
  }
  return report;
}

/// project(z unproject(p)) returns p for pixels all over the image and several depths, points behind the camera are
/// refused, and rays have z = 1.
template <class CameraT>
[[nodiscard]] ConformanceReport check_camera_type(const CameraT& camera, int width, int height) {
  check_camera<CameraT>();
  using Traits = camera_traits<CameraT>;
  ConformanceReport report;
  for (int j = 0; j <= 4; ++j) {
    for (int i = 0; i <= 4; ++i) {
      const Eigen::Vector2d pixel((width - 1) * i / 4.0, (height - 1) * j / 4.0);
      const Eigen::Vector3d ray = Traits::unproject(camera, pixel);
      report.expect(std::abs(ray.z() - 1.0) <= 1e-9, "unproject(camera, pixel) must be scaled to z = 1");
      for (const double z : {0.3, 1.0, 5.0}) {
        const Eigen::Vector3d X = z * ray;
        Eigen::Vector2d back(-1e9, -1e9);
        report.expect(Traits::project(camera, X, back), "project(camera, X, pixel) refuses a point in front of the camera");
        report.expect((back - pixel).norm() <= 1e-3, "project(z * unproject(pixel)) does not return the pixel");
      }
    }
  }
  Eigen::Vector2d ignored(0, 0);
  report.expect(!Traits::project(camera, Eigen::Vector3d(0.1, 0.1, -1.0), ignored),
                "project(camera, X, pixel) must return false for points behind the camera");
  return report;
}

/// The members give the position and response that `expected` says are there, and values in their documented ranges.
/// \param keypoint any keypoint of your type
/// \param expected the same keypoint by hand; its angle and octave are compared only if your traits offer them
template <class KeypointT>
[[nodiscard]] ConformanceReport check_keypoint_type(const KeypointT& keypoint, const Keypoint& expected) {
  check_keypoint<KeypointT>();
  ConformanceReport report;
  const Keypoint got = to_keypoint(keypoint);
  report.expect(got.x == expected.x && got.y == expected.y, "x(keypoint), y(keypoint) are not its position (swapped?)");
  report.expect(got.response == expected.response, "response(keypoint) differs from what is expected");
  report.expect(got.response >= 0, "response(keypoint) must be >= 0");
  report.expect(got.angle >= 0 && got.angle < 360, "angle(keypoint) must be in [0, 360) degrees");
  report.expect(got.octave >= 0, "octave(keypoint) must be >= 0");
  if constexpr (detail::detected_as_v<float, detail::keypoint_angle_t, KeypointT>) {
    report.expect(got.angle == expected.angle, "angle(keypoint) differs from what is expected (radians?)");
  }
  if constexpr (detail::detected_as_v<int, detail::keypoint_octave_t, KeypointT>) {
    report.expect(got.octave == expected.octave, "octave(keypoint) differs from what is expected");
  }
  return report;
}

/// The box is the expected one, in pixels as corner and size, and probabilities are in [0,1].
/// \param detection any detection of your type
/// \param box the same box by hand
template <class DetectionT>
[[nodiscard]] ConformanceReport check_detection_type(const DetectionT& detection, const Box& box) {
  check_detection<DetectionT>();
  ConformanceReport report;
  const Detection got = to_detection(detection);
  const double tolerance = 1e-3;  // [px]: boxes come as centres, corners or fractions of the image
  const auto near = [&](float a, float b) { return std::abs(static_cast<double>(a) - static_cast<double>(b)) <= tolerance; };
  report.expect(near(got.box.x, box.x) && near(got.box.y, box.y),
                "box(detection) does not begin at its top left corner (centre given, or fractions of the image?)");
  report.expect(near(got.box.width, box.width) && near(got.box.height, box.height),
                "box(detection) has another size (right and bottom instead of width and height?)");
  report.expect(got.score >= 0 && got.score <= 1, "score(detection) must be in [0,1] (percent?)");
  const float p = got.motion_probability;
  report.expect(std::isnan(p) || (p >= 0 && p <= 1), "motion_probability(detection) must be in [0,1], or NaN if not known");
  return report;
}

}  // namespace testing
APSO_NAMESPACE_END
