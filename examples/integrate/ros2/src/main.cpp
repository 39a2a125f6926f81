#include "rgbd_node.hpp"

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<apso_ros::RgbdNode>());
  rclcpp::shutdown();
  return 0;
}
