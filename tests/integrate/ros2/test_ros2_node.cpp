// The node of examples/integrate/ros2, with rclcpp and the messages played by stand-ins.
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <apso/testing/synthetic.hpp>

#include "../../../examples/integrate/ros2/src/rgbd_node.hpp"

using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;

namespace {
constexpr int W = 320;
constexpr int H = 240;

builtin_interfaces::msg::Time stamp(double t) {
  builtin_interfaces::msg::Time s;
  s.sec = static_cast<std::int32_t>(std::floor(t));
  s.nanosec = static_cast<std::uint32_t>(std::lround(1e9 * (t - s.sec)));
  return s;
}
Image colour(const apso::testing::SyntheticFrame& f) {
  Image m;
  m.header.stamp = stamp(f.timestamp);
  m.width = W;
  m.height = H;
  m.encoding = "rgb8";
  m.step = 3 * W;
  m.data.assign(f.rgb.data(), f.rgb.data() + 3 * W * H);
  return m;
}
Image depth_in_millimetres(const apso::testing::SyntheticFrame& f, double delay) {
  Image m;
  m.header.stamp = stamp(f.timestamp + delay);
  m.width = W;
  m.height = H;
  m.encoding = "16UC1";
  m.is_bigendian = 1;  // as the driver may send it
  m.step = 2 * W + 5;  // rows padded to an odd number of bytes
  m.data.assign(m.step * H, 0);
  for (int y = 0; y < H; ++y) {
    for (int x = 0; x < W; ++x) {
      const auto mm = static_cast<unsigned>(std::lround(1000 * f.depth(x, y)));
      std::uint8_t* p = m.data.data() + m.step * static_cast<std::size_t>(y) + 2 * static_cast<std::size_t>(x);
      p[0] = static_cast<std::uint8_t>(mm >> 8);
      p[1] = static_cast<std::uint8_t>(mm & 0xFF);
    }
  }
  return m;
}
CameraInfo info(const apso::Pinhole& c) {
  CameraInfo m;
  m.width = W;
  m.height = H;
  m.p = {c.fx, 0, c.cx, 0, 0, c.fy, c.cy, 0, 0, 0, 1, 0};
  return m;
}
apso::testing::SyntheticSequence recording(const std::string& name) {
  apso::testing::SyntheticOptions o;
  o.width = W;
  o.height = H;
  o.frames = 12;
  return apso::testing::SyntheticSequence(name, o);
}
}  // namespace

TEST_CASE("images in, pose, diagnostics and overlay out") {
  rclcpp::Bus::get() = {};
  rclcpp::Bus& bus = rclcpp::Bus::get();
  apso_ros::RgbdNode node;
  const auto sequence = recording("static_xyz");
  apso::testing::SyntheticFrame frame;
  std::vector<apso::Pose> truth;
  sequence.render(0, frame);
  bus.send("rgb/image_rect_color", colour(frame));
  bus.send("depth_registered/image_rect", depth_in_millimetres(frame, 0));
  CHECK(bus.sent<geometry_msgs::msg::PoseStamped>("~/pose").empty());  // no camera_info yet
  bus.send("rgb/camera_info", info(sequence.camera()));
  for (int i = 0; i < 12; ++i) {
    sequence.render(i, frame);
    truth.push_back(frame.T_world_camera);
    if (i == 5) bus.send("depth_registered/image_rect", depth_in_millimetres(frame, -0.5));  // belongs to nothing
    bus.send("rgb/image_rect_color", colour(frame));
    bus.send("depth_registered/image_rect", depth_in_millimetres(frame, 0.004));
  }
  for (const std::string& e : bus.errors) MESSAGE(e);
  CHECK(bus.errors.empty());
  const auto& poses = bus.sent<geometry_msgs::msg::PoseStamped>("~/pose");
  REQUIRE(poses.size() == 12);
  const auto& last = poses.back();
  CHECK(last.header.frame_id == "world");
  CHECK(last.header.stamp.nanosec == stamp(frame.timestamp).nanosec);
  const Eigen::Vector3d moved = (apso::inverse(truth.front()) * truth.back()).translation();
  const Eigen::Vector3d seen(last.pose.position.x, last.pose.position.y, last.pose.position.z);
  CHECK(moved.norm() > 0.02);
  CHECK((seen - moved).norm() < 0.02);

  const auto& diagnostics = bus.sent<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics");
  REQUIRE(diagnostics.size() == 12);
  const auto& status = diagnostics.back().status.at(0);
  CHECK(status.message == "INITIALISING");
  bool has_total = false;
  for (const auto& kv : status.values) {
    const double v = std::stod(kv.value);
    CHECK(v >= 0);
    CHECK(v <= 1);
    has_total = has_total || kv.key == "S_total";
  }
  CHECK(has_total);
  const auto& overlays = bus.sent<Image>("~/overlay");
  REQUIRE(overlays.size() == 12);
  CHECK(overlays.back().encoding == "bgr8");
  CHECK(overlays.back().data.size() == overlays.back().step * overlays.back().height);
  CHECK(overlays.back().width >= W);
}

TEST_CASE("a damaged or unknown message is reported and skipped, and the next one is processed") {
  rclcpp::Bus::get() = {};
  rclcpp::Bus& bus = rclcpp::Bus::get();
  bus.parameters["overlay"] = false;
  apso_ros::RgbdNode node;
  const auto sequence = recording("static_static");
  CameraInfo wrong = info(sequence.camera());
  wrong.p[0] = 0;
  bus.send("rgb/camera_info", wrong);
  REQUIRE(bus.errors.size() == 1);
  CHECK(bus.errors[0].find("camera_info cannot be used: apso: Pinhole: fx and fy must be > 0") == 0);
  bus.send("rgb/camera_info", info(sequence.camera()));
  apso::testing::SyntheticFrame frame;
  for (int i = 0; i < 4; ++i) {
    sequence.render(i, frame);
    Image c = colour(frame);
    Image d = depth_in_millimetres(frame, 0);
    if (i == 1) c.encoding = "bayer_rggb8";
    if (i == 2) d.data.resize(100);
    bus.send("rgb/image_rect_color", c);
    bus.send("depth_registered/image_rect", d);
  }
  REQUIRE(bus.errors.size() == 3);
  CHECK(bus.errors[1].find("encoding 'bayer_rggb8'") != std::string::npos);
  CHECK(bus.errors[2].find("the buffer is smaller than the image") != std::string::npos);
  CHECK(bus.sent<geometry_msgs::msg::PoseStamped>("~/pose").size() == 2);
  CHECK(bus.sent<Image>("~/overlay").empty());
}

TEST_CASE("every encoding that is promised gives the same grey image and depth") {
  apso::Image<std::uint8_t> grey;
  for (const std::string encoding : {"mono8", "mono16", "rgb8", "bgr8", "rgba8", "bgra8"}) {
    const std::size_t step = encoding == "mono8" ? 1 : encoding == "mono16" ? 2 : encoding.size() == 4 ? 3 : 4;
    Image m;
    m.width = 5;
    m.height = 3;
    m.encoding = encoding;
    m.step = static_cast<std::uint32_t>(5 * step + 1);
    m.data.assign(m.step * 3, 7);
    for (std::size_t y = 0; y < 3; ++y) {
      for (std::size_t x = 0; x < 5; ++x) {
        for (std::size_t c = 0; c < step; ++c) m.data[m.step * y + step * x + c] = static_cast<std::uint8_t>(10 * y + x);
      }
    }
    apso_ros::to_grey(m, grey);
    CAPTURE(encoding);
    for (int y = 0; y < 3; ++y) {
      for (int x = 0; x < 5; ++x) CHECK(int(grey(x, y)) == 10 * y + x);  // equal channels: grey is their value
    }
  }
  // red, green and blue have their own weights, in either order
  for (const std::string encoding : {"rgb8", "bgr8"}) {
    Image m;
    m.width = m.height = 1;
    m.encoding = encoding;
    m.step = 3;
    m.data = encoding == "rgb8" ? std::vector<std::uint8_t>{255, 0, 0} : std::vector<std::uint8_t>{0, 0, 255};
    apso_ros::to_grey(m, grey);
    CHECK(int(grey(0, 0)) == 77);
  }
  Image m;
  m.width = 2;
  m.height = 1;
  m.encoding = "32FC1";
  m.step = 8;
  const float metres[2] = {1.5F, std::numeric_limits<float>::quiet_NaN()};
  m.data.resize(8);
  std::memcpy(m.data.data(), metres, 8);
  m.is_bigendian = apso_ros::machine_is_big_endian() ? 1 : 0;
  apso::Image<float> depth;
  apso_ros::to_depth(m, depth);
  CHECK(depth(0, 0) == 1.5F);
  CHECK_FALSE(apso::depth_valid(depth(1, 0), {}));
}
