// Open3D's hybrid RGB-D odometry. Debian builds Open3D without Intel IPP, so that its own RGBDOdometryMultiScale throws
// on the CPU: the multi-scale loop is written here around its functions for one iteration, with smoothing and Sobel
// from OpenCV. Levels, iterations and limits are its defaults.
#include <array>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include <open3d/core/Tensor.h>
#include <open3d/t/geometry/Image.h>
#include <open3d/t/pipelines/kernel/RGBDOdometry.h>
#include <open3d/t/pipelines/odometry/RGBDOdometry.h>

#include "alignment_method.hpp"
#include "peer_open3d_legacy.hpp"

namespace {
namespace o3 = open3d;
using o3::core::Tensor;

Tensor to_tensor(const cv::Mat& m) { return Tensor(reinterpret_cast<const float*>(m.data), {m.rows, m.cols, 1}, o3::core::Float32); }
cv::Mat to_mat(const Tensor& t) {
  return cv::Mat(static_cast<int>(t.GetShape(0)), static_cast<int>(t.GetShape(1)), CV_32F, const_cast<float*>(t.GetDataPtr<float>()));
}

class Open3dHybrid : public Method {
 public:
  std::string name() const override { return "Open3D tensor hybrid"; }
  std::string key() const override { return "open3d_hybrid"; }
  void camera(const apso::Pinhole& c) override {
    for (std::size_t l = 0; l < 3; ++l) {
      const double s = std::pow(0.5, static_cast<double>(l));
      const std::array<double, 9> k{c.fx * s, 0, c.cx * s, 0, c.fy * s, c.cy * s, 0, 0, 1};
      intrinsics_[l] = Tensor(k.data(), {3, 3}, o3::core::Float64);
    }
  }
  void prepare_reference(const pairs::Image8& f) override {
    prepare(f, source_depth_, source_intensity_);
    for (std::size_t l = 0; l < 3; ++l) {
      vertices_[l] = o3::t::geometry::Image(source_depth_[l]).CreateVertexMap(intrinsics_[l], NAN).AsTensor();
    }
  }
  void prepare_current(const pairs::Image8& f) override {
    prepare(f, target_depth_, target_intensity_);
    for (std::size_t l = 0; l < 3; ++l) {
      sobel(target_depth_[l], depth_dx_[l], depth_dy_[l]);
      sobel(target_intensity_[l], intensity_dx_[l], intensity_dy_[l]);
    }
  }
  Outcome solve(const apso::Pose& guess) override {
    namespace odometry = o3::t::pipelines::odometry;
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> start = guess.matrix();
    Tensor T(start.data(), {4, 4}, o3::core::Float64);
    const int iterations[3] = {3, 5, 10};  // finest first
    double fitness = 0;
    Outcome o;
    o.T_current_reference = guess;
    try {
      for (std::size_t l = 3; l-- > 0;) {
        double last_fitness = 0;
        double last_rmse = 0;
        for (int i = 0; i < iterations[l]; ++i) {
          const auto r = odometry::ComputeOdometryResultHybrid(source_depth_[l], target_depth_[l], source_intensity_[l],
                                                               target_intensity_[l], depth_dx_[l], depth_dy_[l], intensity_dx_[l],
                                                               intensity_dy_[l], vertices_[l], intrinsics_[l], T, 0.07F, 0.05F, 0.1F);
          T = r.transformation_.Matmul(T);
          fitness = r.fitness_;
          if (std::abs(fitness - last_fitness) / fitness < 1e-6 && std::abs(r.inlier_rmse_ - last_rmse) / r.inlier_rmse_ < 1e-6) {
            break;
          }
          last_fitness = fitness;
          last_rmse = r.inlier_rmse_;
        }
      }
    } catch (const std::exception&) {  // singular
      return o;
    }
    const auto* m = T.GetDataPtr<double>();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) o.T_current_reference.matrix()(r, c) = m[4 * r + c];
    }
    o.good = fitness > 0.1;  // it gives no verdict of its own
    return o;
  }

 private:
  using Levels = std::array<Tensor, 3>;
  static void prepare(const pairs::Image8& f, Levels& depth, Levels& intensity) {
    const cv::Mat z(f.depth.height(), f.depth.width(), CV_32F, const_cast<float*>(f.depth.data()));
    const cv::Mat grey(f.grey.height(), f.grey.width(), CV_8U, const_cast<std::uint8_t*>(f.grey.data()));
    cv::Mat i;
    grey.convertTo(i, CV_32F, 1.0 / 255);
    o3::t::geometry::Image d = o3::t::geometry::Image(to_tensor(z)).ClipTransform(1.0F, 0.0F, 3.0F, NAN);
    for (std::size_t l = 0; l < 3; ++l) {
      depth[l] = d.AsTensor().Clone();
      intensity[l] = to_tensor(i);
      if (l == 2) break;
      d = d.PyrDownDepth(0.14F, NAN);
      cv::Mat smaller;
      cv::pyrDown(i, smaller);
      i = smaller;
    }
  }
  static void sobel(const Tensor& t, Tensor& dx, Tensor& dy) {
    cv::Mat x, y;
    cv::Sobel(to_mat(t), x, CV_32F, 1, 0, 3);
    cv::Sobel(to_mat(t), y, CV_32F, 0, 1, 3);
    dx = to_tensor(x);
    dy = to_tensor(y);
  }

  std::array<Tensor, 3> intrinsics_;
  Levels source_depth_, source_intensity_, vertices_;
  Levels target_depth_, target_intensity_, depth_dx_, depth_dy_, intensity_dx_, intensity_dy_;
};

// Its pyramids and gradients are made inside the call.
class Open3dLegacyHybrid : public Method {
 public:
  std::string name() const override { return "Open3D legacy hybrid"; }
  std::string key() const override { return "open3d_legacy"; }
  void camera(const apso::Pinhole& c) override { open3d_legacy_camera(peer_.get(), c.width, c.height, c.fx, c.fy, c.cx, c.cy); }
  void prepare_reference(const pairs::Image8& f) override { frame(f, 0); }
  void prepare_current(const pairs::Image8& f) override { frame(f, 1); }
  Outcome solve(const apso::Pose& guess) override {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> start = guess.matrix();
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> found;
    Outcome o;
    o.good = open3d_legacy_solve(peer_.get(), start.data(), found.data()) != 0;
    o.T_current_reference.matrix() = found;
    return o;
  }

 private:
  void frame(const pairs::Image8& f, int is_target) {
    open3d_legacy_frame(peer_.get(), is_target, f.intensity.data(), f.depth.data(), f.depth.width(), f.depth.height());
  }
  struct Destroy {
    void operator()(Open3dLegacy* o) const { open3d_legacy_destroy(o); }
  };
  std::unique_ptr<Open3dLegacy, Destroy> peer_{open3d_legacy_create()};
};
}  // namespace

void add_open3d(Methods& methods) {
  methods.push_back(std::make_unique<Open3dHybrid>());
  methods.push_back(std::make_unique<Open3dLegacyHybrid>());
}
