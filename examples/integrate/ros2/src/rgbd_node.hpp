// ROS 2: colour image, depth image and camera info in; pose, diagnostics and overlay out.
#pragma once

#include <memory>
#include <string>

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <geometry_msgs/msg/pose_stamped.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>

#include "messages.hpp"
#include "rgbd_slam.hpp"

namespace apso_ros {

class RgbdNode : public rclcpp::Node {
 public:
  RgbdNode() : rclcpp::Node("apso") {
    settings_.motion = declare_parameter<bool>("motion", true);
    settings_.refinement = declare_parameter<bool>("refinement", true);
    settings_.overlay = declare_parameter<bool>("overlay", true);
    world_frame_ = declare_parameter<std::string>("world_frame", "world");
    const auto qos = rclcpp::SensorDataQoS();
    pose_ = create_publisher<geometry_msgs::msg::PoseStamped>("~/pose", 10);
    diagnostics_ = create_publisher<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", 10);
    overlay_ = create_publisher<sensor_msgs::msg::Image>("~/overlay", 1);
    info_ = create_subscription<sensor_msgs::msg::CameraInfo>(
        "rgb/camera_info", qos, [this](const sensor_msgs::msg::CameraInfo::ConstSharedPtr m) { on_info(*m); });
    colour_ = create_subscription<sensor_msgs::msg::Image>("rgb/image_rect_color", qos,
                                                           [this](const Image m) { pairing_.add_colour(seconds(*m), m), on_image(); });
    depth_ = create_subscription<sensor_msgs::msg::Image>("depth_registered/image_rect", qos,
                                                          [this](const Image m) { pairing_.add_depth(seconds(*m), m), on_image(); });
  }

 private:
  using Image = sensor_msgs::msg::Image::ConstSharedPtr;

  static double seconds(const sensor_msgs::msg::Image& m) { return m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec; }

  void on_info(const sensor_msgs::msg::CameraInfo& m) {
    if (slam_) return;
    // of the rectified image: P holds fx 0 cx Tx 0 fy cy Ty 0 0 1 0
    camera_ = {m.p[0], m.p[5], m.p[2], m.p[6], static_cast<int>(m.width), static_cast<int>(m.height)};
    try {
      slam_ = std::make_unique<RgbdSlam>(camera_, settings_);
    } catch (const std::exception& e) {
      RCLCPP_ERROR(get_logger(), "camera_info cannot be used: %s", e.what());
    }
  }

  void on_image() {
    double t = 0;
    Image colour, depth;
    while (pairing_.take(t, colour, depth)) {
      if (!slam_) continue;  // no camera_info yet
      try {
        to_grey(*colour, grey_);
        to_depth(*depth, metres_);
        publish(*colour, slam_->process(t, grey_, metres_));
      } catch (const std::exception& e) {
        RCLCPP_ERROR(get_logger(), "frame skipped: %s", e.what());
      }
    }
  }

  void publish(const sensor_msgs::msg::Image& colour, const SlamFrame& frame) {
    if (frame.has_pose) {
      geometry_msgs::msg::PoseStamped p;
      p.header.stamp = colour.header.stamp;
      p.header.frame_id = world_frame_;
      const Eigen::Vector3d t = frame.T_world_camera.translation();
      const Eigen::Quaterniond q(Eigen::Matrix3d(frame.T_world_camera.linear()));
      p.pose.position.x = t.x(), p.pose.position.y = t.y(), p.pose.position.z = t.z();
      p.pose.orientation.x = q.x(), p.pose.orientation.y = q.y(), p.pose.orientation.z = q.z(), p.pose.orientation.w = q.w();
      pose_->publish(p);
    }
    diagnostic_msgs::msg::DiagnosticStatus status;
    status.name = "apso: frame quality";
    status.message = frame.state;
    using Status = diagnostic_msgs::msg::DiagnosticStatus;
    status.level = !frame.has_pose ? Status::ERROR : frame.trustworthy ? Status::OK : Status::WARN;
    for (const auto& [name, value] : frame.values) {
      diagnostic_msgs::msg::KeyValue kv;
      kv.key = name;
      kv.value = std::to_string(value);
      status.values.push_back(kv);
    }
    diagnostic_msgs::msg::DiagnosticArray all;
    all.header.stamp = colour.header.stamp;
    all.status.push_back(status);
    diagnostics_->publish(all);
    if (!frame.overlay_bgr.empty()) {
      sensor_msgs::msg::Image picture;
      picture.header = colour.header;
      from_bgr(frame.overlay_bgr, frame.overlay_width, frame.overlay_height, picture);
      overlay_->publish(picture);
    }
  }

  SlamSettings settings_;
  std::string world_frame_;
  apso::Pinhole camera_;
  std::unique_ptr<RgbdSlam> slam_;
  Pairing<Image> pairing_;
  apso::Image<std::uint8_t> grey_;
  apso::Image<float> metres_;
  rclcpp::Publisher<geometry_msgs::msg::PoseStamped>::SharedPtr pose_;
  rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
  rclcpp::Publisher<sensor_msgs::msg::Image>::SharedPtr overlay_;
  rclcpp::Subscription<sensor_msgs::msg::CameraInfo>::SharedPtr info_;
  rclcpp::Subscription<sensor_msgs::msg::Image>::SharedPtr colour_, depth_;
};

}  // namespace apso_ros
