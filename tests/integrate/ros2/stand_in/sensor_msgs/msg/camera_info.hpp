#pragma once
#include <array>
#include <builtin_interfaces/header.hpp>

namespace sensor_msgs::msg {
struct CameraInfo {
  using SharedPtr = std::shared_ptr<CameraInfo>;
  using ConstSharedPtr = std::shared_ptr<const CameraInfo>;
  std_msgs::msg::Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
  std::array<double, 9> r{};
  std::array<double, 12> p{};
};
}  // namespace sensor_msgs::msg
