// What the comparison asks of an alignment, ours or a peer's.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <apso/math/se3.hpp>

#include "alignment_pairs.hpp"

struct Outcome {
  bool good = false;  ///< the method's own verdict
  apso::Pose T_current_reference = apso::Pose::Identity();
};

class Method {
 public:
  virtual ~Method() = default;
  [[nodiscard]] virtual std::string name() const = 0;           ///< for the table
  [[nodiscard]] virtual std::string key() const { return {}; }  ///< in the line of ratios; empty = not in it
  [[nodiscard]] virtual int width() const { return 640; }       ///< of the finest image that it aligns [px]
  virtual void camera(const apso::Pinhole& camera) = 0;
  /// Everything that depends on one frame alone.
  virtual void prepare_reference(const pairs::Image8& frame) = 0;
  virtual void prepare_current(const pairs::Image8& frame) = 0;
  virtual Outcome solve(const apso::Pose& T_current_reference_guess) = 0;
};
using Methods = std::vector<std::unique_ptr<Method>>;

void add_opencv(Methods& methods);  ///< RgbdOdometry, RgbdICPOdometry of OpenCV's contributed modules
void add_open3d(Methods& methods);  ///< hybrid odometry of Open3D, tensor and legacy
void add_difodo(Methods& methods);  ///< range flow of MRPT, depth alone
