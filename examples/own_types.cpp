// Step 3 of 3: your own image and pose types, used directly. This file needs only Eigen.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include <apso/apso.hpp>
#include <apso/testing/conformance.hpp>
#include <apso/testing/synthetic.hpp>

// Types as they come: a depth image in millimetres, and the pose of a tracker that stores world to camera.
struct MillimetreImage {
  int columns, lines;
  std::vector<std::uint16_t> values;
};
struct TrackerPose {
  Eigen::Quaterniond q_camera_world;
  Eigen::Vector3d p_camera_world;
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
struct apso::pose_traits<TrackerPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const TrackerPose& T) { return T.q_camera_world.toRotationMatrix(); }
  static Eigen::Vector3d translation(const TrackerPose& T) { return T.p_camera_world; }
  static TrackerPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) { return {Eigen::Quaterniond(R), t}; }
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

  const apso::testing::SyntheticSequence sequence("static_halfsphere");
  apso::testing::SyntheticFrame reference;
  apso::testing::SyntheticFrame current;
  sequence.render(20, reference);
  sequence.render(23, current);

  apso::PairOptions options;
  options.depth_unit = 0.001;  // millimetres
  const apso::PairAlignment result =
      apso::align(reference.intensity, in_millimetres(reference.depth), current.intensity,
                  in_millimetres(current.depth), sequence.camera(), apso::Pose::Identity(), options);

  const apso::Pose T_camera_world = result.T_current_reference * apso::inverse(reference.T_world_camera);
  const TrackerPose corrected = apso::from_pose<TrackerPose>(T_camera_world);
  const Eigen::Vector3d p = corrected.p_camera_world;
  std::printf("%s: world in the current camera at %.3f %.3f %.3f m\n", apso::to_string(result.status), p.x(), p.y(), p.z());
  const double error = (p - apso::inverse(current.T_world_camera).translation()).norm();
  std::printf("error %.4f m\n", error);
  return apso::succeeded(result.status) && error < 0.02 ? 0 : 1;
}
