// Step 3 of 3: the whole method on your own image, pose and keypoint types, used as they are. Eigen is all this file needs.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include <apso/apso.hpp>
#include <apso/testing/conformance.hpp>
#include <apso/testing/synthetic.hpp>

// Types as they come: raw depth in millimetres, the pose of a tracker that stores world to camera, corners of a detector.
struct MillimetreImage {
  int columns, lines;
  std::vector<std::uint16_t> values;
};
struct TrackerPose {
  Eigen::Quaterniond q_camera_world = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_camera_world = Eigen::Vector3d::Zero();
};
struct Corner {
  double u, v, strength;
};

// [traits]
// What apso needs to know of them.
template <>
struct apso::image_traits<MillimetreImage> {
  using value_type = std::uint16_t;
  static int width(const MillimetreImage& m) { return m.columns; }
  static int height(const MillimetreImage& m) { return m.lines; }
  static value_type at(const MillimetreImage& m, int x, int y) { return row(m, y)[x]; }
  static const value_type* row(const MillimetreImage& m, int y) { return m.values.data() + std::ptrdiff_t{y} * m.columns; }
};
template <>
struct apso::pose_traits<TrackerPose> {  // T_world_camera, from what the tracker stores: its inverse
  using scalar = double;
  static Eigen::Matrix3d rotation(const TrackerPose& T) { return T.q_camera_world.conjugate().toRotationMatrix(); }
  static Eigen::Vector3d translation(const TrackerPose& T) { return -(T.q_camera_world.conjugate() * T.p_camera_world); }
  static TrackerPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    const Eigen::Quaterniond q(R.transpose());
    return {q, -(q * t)};
  }
};
template <>
struct apso::keypoint_traits<Corner> {
  static float x(const Corner& k) { return static_cast<float>(k.u); }
  static float y(const Corner& k) { return static_cast<float>(k.v); }
  static float response(const Corner& k) { return static_cast<float>(k.strength); }
};
// [/traits]

static MillimetreImage in_millimetres(const apso::Image<float>& depth) {
  MillimetreImage m{depth.width(), depth.height(), {}};
  for (std::size_t i = 0; i < depth.size(); ++i) m.values.push_back(static_cast<std::uint16_t>(1000 * depth.data()[i] + 0.5F));
  return m;
}

int main() {
  // [conformance]
  // Do the traits mean what apso thinks they mean? The report is empty if so.
  const std::string complaints = apso::testing::check_pose_type<TrackerPose>().text();
  if (!complaints.empty()) return std::printf("%s", complaints.c_str()), 1;
  // [/conformance]

  // A recording, and a tracker that is played by the truth until its features fail at frame 40 and its pose is 5 cm off.
  const apso::testing::SyntheticSequence sequence("static_halfsphere");
  apso::testing::SyntheticFrame frame;
  double error = 1;
  apso::BasicPipeline<TrackerPose> pipeline(sequence.camera());
  for (int i = 0; i <= 40; ++i) {
    sequence.render(i, frame);
    const MillimetreImage depth = in_millimetres(frame.depth);
    TrackerPose tracked = apso::from_pose<TrackerPose>(frame.T_world_camera);
    std::vector<Corner> corners;
    if (i == 40) tracked.p_camera_world.x() += 0.05;
    for (int k = 0; i < 40 && k < 600; ++k) corners.push_back({8.0 + 20 * (k % 32), 8.0 + 24.0 * (k / 32), 40.0});
    // [pipeline]
    // nothing of yours is converted by you, and nothing is kept after a call
    pipeline.observe(apso::frame(frame.timestamp, frame.intensity, apso::scaled(depth, 0.001F), sequence.camera()), tracked);
    pipeline.assess(corners, apso::none, {tracked, tracked, true});
    const auto& report = pipeline.conclude();
    const TrackerPose& refined = report.T_world_camera;  // your type again
    // [/pipeline]
    const Eigen::Vector3d truth = apso::inverse(frame.T_world_camera).translation();
    error = (refined.p_camera_world - truth).norm();
    if (i == 40) std::printf("frame %d is %s, %s\n", i, apso::to_string(report.state), report.refined ? "refined" : "not refined");
  }
  std::printf("error %.4f m instead of 0.05 m\n", error);
  return error < 0.02 ? 0 : 1;
}
