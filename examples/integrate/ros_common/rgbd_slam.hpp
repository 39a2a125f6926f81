// The whole method for one camera, behind a small door: what a node of ROS 1 or ROS 2 needs, without a type of ROS, and without
// compiling OpenCV and apso in the file of the node.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <apso/math/se3.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

namespace apso_ros {

struct SlamSettings {
  bool motion = true;      ///< look for what moves
  bool refinement = true;  ///< repair the pose of BAD frames
  bool overlay = true;     ///< draw masks and scores
};

struct SlamFrame {
  bool has_pose = false;
  apso::Pose T_world_camera = apso::Pose::Identity();
  std::string state;                                   ///< INITIALISING, GOOD, BAD, LOST
  bool trustworthy = false;                            ///< GOOD, or BAD and repaired
  std::vector<std::pair<std::string, double>> values;  ///< scores by name, only those that exist
  std::vector<std::uint8_t> overlay_bgr;               ///< interleaved; empty without overlay
  int overlay_width = 0;                               ///< [px]
  int overlay_height = 0;                              ///< [px]
};

class RgbdSlam {
 public:
  explicit RgbdSlam(const apso::Pinhole& camera, const SlamSettings& settings = {});
  ~RgbdSlam();
  /// \param grey,depth of the size of the camera; depth in metres
  SlamFrame process(double timestamp, const apso::Image<std::uint8_t>& grey, const apso::Image<float>& depth);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Finds the depth image that belongs to a colour image: the one nearest in time, at most `tolerance` away [s].
template <class Message>
class Pairing {
 public:
  explicit Pairing(double tolerance = 0.02) : tolerance_(tolerance) {}
  void add_colour(double t, const Message& m) { add(colour_, t, m); }
  void add_depth(double t, const Message& m) { add(depth_, t, m); }
  /// True when a pair is complete; both are taken out, with everything older.
  bool take(double& t, Message& colour, Message& depth) {
    for (std::size_t i = 0; i < colour_.size(); ++i) {
      for (std::size_t j = 0; j < depth_.size(); ++j) {
        const double difference = colour_[i].first - depth_[j].first;
        if (difference > tolerance_ || difference < -tolerance_) continue;
        t = colour_[i].first;
        colour = colour_[i].second;
        depth = depth_[j].second;
        colour_.erase(colour_.begin(), colour_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        depth_.erase(depth_.begin(), depth_.begin() + static_cast<std::ptrdiff_t>(j) + 1);
        return true;
      }
    }
    return false;
  }

 private:
  using Queue = std::vector<std::pair<double, Message>>;
  static void add(Queue& q, double t, const Message& m) {
    if (!q.empty() && t <= q.back().first) q.clear();  // time went back: a recording that starts again
    q.emplace_back(t, m);
    if (q.size() > 8) q.erase(q.begin());
  }
  double tolerance_;
  Queue colour_, depth_;
};

}  // namespace apso_ros
