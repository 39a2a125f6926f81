// MRPT's DIFODO: range flow on depth alone, five levels from 320x240 to 20x15. It expects square pixels and a centred
// principal point, so the image is shifted by whole pixels; its filter, which pulls to the last velocity, is off: pairs
// have none. It starts at rest and gives no verdict.
#include <algorithm>
#include <cmath>

#include <mrpt/vision/CDifodo.h>

#include "alignment_method.hpp"

namespace {
class Solver : public mrpt::vision::CDifodo {
 public:
  void setup(const apso::Pinhole& c) {
    constexpr unsigned kLevels = 5;
    cam_mode = 1;
    downsample = 2;
    fast_pyramid = false;  // the fast one of version 2.5 throws
    m_width = static_cast<unsigned>(c.width) / downsample;
    m_height = static_cast<unsigned>(c.height) / downsample;
    cols = m_width;
    rows = m_height;
    ctf_levels = kLevels;
    fovh = static_cast<float>(2 * std::atan(0.5 * c.width / c.fx));
    fovv = static_cast<float>(2 * std::atan(0.5 * c.height / c.fy));
    shift_x_ = static_cast<int>(std::lround(c.cx - 0.5 * (c.width - 1)));
    shift_y_ = static_cast<int>(std::lround(c.cy - 0.5 * (c.height - 1)));
    previous_speed_const_weight = 0;
    previous_speed_eig_weight = 0;
    depth_wf.setZero(static_cast<int>(m_height), static_cast<int>(m_width));
    for (auto* pyramid :
         {&depth, &depth_old, &depth_inter, &xx, &xx_old, &xx_inter, &yy, &yy_old, &yy_inter, &depth_warped, &xx_warped, &yy_warped}) {
      pyramid->resize(kLevels);
      for (unsigned i = 0; i < kLevels; ++i) {
        (*pyramid)[i].setZero(static_cast<int>(m_height >> i), static_cast<int>(m_width >> i));
      }
    }
    weights.setSize(static_cast<int>(rows), static_cast<int>(cols));
    transformations.resize(kLevels);
    for (auto& t : transformations) t.setSize(4, 4);
    start();
  }
  void start() {
    cam_pose = cam_oldpose = mrpt::poses::CPose3D();
    kai_abs = kai_loc = kai_loc_old = {};
  }
  /// The nearest of four pixels, as its own drivers do.
  void load(const pairs::Image8& f) {
    for (int y = 0; y < static_cast<int>(m_height); ++y) {
      for (int x = 0; x < static_cast<int>(m_width); ++x) {
        const int u = 2 * x + shift_x_;
        const int v = 2 * y + shift_y_;
        const bool inside = u >= 0 && v >= 0 && u < f.depth.width() && v < f.depth.height();
        const float z = inside ? f.depth(u, v) : 0.0F;
        depth_wf(y, x) = z > 0 && z < 1e3F ? z : 0.0F;  // false for NaN
      }
    }
  }
  void build() { buildCoordinatesPyramid(); }
  void loadFrame() override {}

 private:
  int shift_x_ = 0;
  int shift_y_ = 0;
};

class Difodo : public Method {
 public:
  std::string name() const override { return "MRPT DIFODO (320x240, depth)"; }
  std::string key() const override { return "difodo"; }
  int width() const override { return 320; }
  void camera(const apso::Pinhole& c) override { solver_.setup(c); }
  void prepare_reference(const pairs::Image8& f) override {
    solver_.load(f);
    solver_.build();
  }
  void prepare_current(const pairs::Image8& f) override { solver_.load(f); }
  /// The pyramid of the current frame is part of its solver.
  Outcome solve(const apso::Pose&) override {
    solver_.start();
    solver_.odometryCalculation();
    // its axes: depth, columns, rows
    Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
    P(0, 2) = P(1, 0) = P(2, 1) = P(3, 3) = 1;
    Eigen::Matrix4d T;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) T(r, c) = solver_.cam_pose.getHomogeneousMatrixVal<mrpt::math::CMatrixDouble44>()(r, c);
    }
    apso::Pose T_reference_current;
    T_reference_current.matrix() = P.transpose() * T * P;
    Outcome o;
    o.good = true;
    o.T_current_reference = apso::inverse(T_reference_current);
    return o;
  }

 private:
  Solver solver_;
};
}  // namespace

void add_difodo(Methods& methods) { methods.push_back(std::make_unique<Difodo>()); }
