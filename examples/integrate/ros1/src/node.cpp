// ROS 1: colour image, depth image and camera info in; pose, diagnostics and overlay out. The same as the node for ROS 2.
#include <exception>
#include <memory>
#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "messages.hpp"
#include "rgbd_slam.hpp"

namespace {

class RgbdNode {
 public:
  RgbdNode() : private_("~") {
    private_.param("motion", settings_.motion, true);
    private_.param("refinement", settings_.refinement, true);
    private_.param("overlay", settings_.overlay, true);
    private_.param("world_frame", world_frame_, std::string("world"));
    pose_ = private_.advertise<geometry_msgs::PoseStamped>("pose", 10);
    diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
    overlay_ = private_.advertise<sensor_msgs::Image>("overlay", 1);
    info_ = node_.subscribe("rgb/camera_info", 1, &RgbdNode::on_info, this);
    colour_ = node_.subscribe("rgb/image_rect_color", 5, &RgbdNode::on_colour, this);
    depth_ = node_.subscribe("depth_registered/image_rect", 5, &RgbdNode::on_depth, this);
  }

 private:
  using Image = sensor_msgs::ImageConstPtr;

  void on_info(const sensor_msgs::CameraInfoConstPtr& m) {
    if (slam_) return;
    // of the rectified image: P holds fx 0 cx Tx 0 fy cy Ty 0 0 1 0
    const apso::Pinhole camera{m->P[0], m->P[5], m->P[2], m->P[6], static_cast<int>(m->width), static_cast<int>(m->height)};
    try {
      slam_ = std::make_unique<apso_ros::RgbdSlam>(camera, settings_);
    } catch (const std::exception& e) {
      ROS_ERROR("camera_info cannot be used: %s", e.what());
    }
  }
  void on_colour(const Image& m) {
    pairing_.add_colour(m->header.stamp.toSec(), m);
    on_image();
  }
  void on_depth(const Image& m) {
    pairing_.add_depth(m->header.stamp.toSec(), m);
    on_image();
  }
  void on_image() {
    double t = 0;
    Image colour, depth;
    while (pairing_.take(t, colour, depth)) {
      if (!slam_) continue;  // no camera_info yet
      try {
        apso_ros::to_grey(*colour, grey_);
        apso_ros::to_depth(*depth, metres_);
        publish(*colour, slam_->process(t, grey_, metres_));
      } catch (const std::exception& e) {
        ROS_ERROR("frame skipped: %s", e.what());
      }
    }
  }

  void publish(const sensor_msgs::Image& colour, const apso_ros::SlamFrame& frame) {
    if (frame.has_pose) {
      geometry_msgs::PoseStamped p;
      p.header.stamp = colour.header.stamp;
      p.header.frame_id = world_frame_;
      const Eigen::Vector3d t = frame.T_world_camera.translation();
      const Eigen::Quaterniond q(Eigen::Matrix3d(frame.T_world_camera.linear()));
      p.pose.position.x = t.x(), p.pose.position.y = t.y(), p.pose.position.z = t.z();
      p.pose.orientation.x = q.x(), p.pose.orientation.y = q.y(), p.pose.orientation.z = q.z(), p.pose.orientation.w = q.w();
      pose_.publish(p);
    }
    using Status = diagnostic_msgs::DiagnosticStatus;
    Status status;
    status.name = "apso: frame quality";
    status.message = frame.state;
    status.level = !frame.has_pose ? Status::ERROR : frame.trustworthy ? Status::OK : Status::WARN;
    for (const auto& [name, value] : frame.values) {
      diagnostic_msgs::KeyValue kv;
      kv.key = name;
      kv.value = std::to_string(value);
      status.values.push_back(kv);
    }
    diagnostic_msgs::DiagnosticArray all;
    all.header.stamp = colour.header.stamp;
    all.status.push_back(status);
    diagnostics_.publish(all);
    if (!frame.overlay_bgr.empty()) {
      sensor_msgs::Image picture;
      picture.header = colour.header;
      apso_ros::from_bgr(frame.overlay_bgr, frame.overlay_width, frame.overlay_height, picture);
      overlay_.publish(picture);
    }
  }

  ros::NodeHandle node_, private_;
  apso_ros::SlamSettings settings_;
  std::string world_frame_;
  std::unique_ptr<apso_ros::RgbdSlam> slam_;
  apso_ros::Pairing<Image> pairing_;
  apso::Image<std::uint8_t> grey_;
  apso::Image<float> metres_;
  ros::Publisher pose_, diagnostics_, overlay_;
  ros::Subscriber info_, colour_, depth_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "apso");
  RgbdNode node;
  ros::spin();
  return 0;
}
