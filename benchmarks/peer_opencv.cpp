// OpenCV's contributed RGB-D odometries, as they are shipped.
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/rgbd/depth.hpp>

#include "alignment_method.hpp"

namespace {
template <class Odometry>
class OpenCvOdometry : public Method {
 public:
  OpenCvOdometry(std::string name, std::string key) : name_(std::move(name)), key_(std::move(key)) {}
  std::string name() const override { return name_; }
  std::string key() const override { return key_; }
  void camera(const apso::Pinhole& c) override {
    const cv::Matx33f k(static_cast<float>(c.fx), 0, static_cast<float>(c.cx), 0, static_cast<float>(c.fy), static_cast<float>(c.cy), 0, 0,
                        1);
    odometry_ = Odometry::create(cv::Mat(k).clone());
  }
  void prepare_reference(const pairs::Image8& f) override {
    source_ = frame(f);
    odometry_->prepareFrameCache(source_, cv::rgbd::OdometryFrame::CACHE_SRC);
  }
  void prepare_current(const pairs::Image8& f) override {
    target_ = frame(f);
    odometry_->prepareFrameCache(target_, cv::rgbd::OdometryFrame::CACHE_DST);
  }
  Outcome solve(const apso::Pose& guess) override {
    cv::Mat init(4, 4, CV_64F);
    cv::Mat found;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) init.at<double>(r, c) = guess.matrix()(r, c);
    }
    Outcome o;
    o.T_current_reference = guess;
    o.good = odometry_->compute(source_, target_, found, init);
    if (found.total() == 16) {
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 4; ++c) o.T_current_reference.matrix()(r, c) = found.at<double>(r, c);
      }
    }
    return o;
  }

 private:
  static cv::Ptr<cv::rgbd::OdometryFrame> frame(const pairs::Image8& f) {
    // OpenCV only reads the images
    const cv::Mat grey(f.grey.height(), f.grey.width(), CV_8U, const_cast<std::uint8_t*>(f.grey.data()));
    const cv::Mat depth(f.depth.height(), f.depth.width(), CV_32F, const_cast<float*>(f.depth.data()));
    return cv::rgbd::OdometryFrame::create(grey, depth);
  }

  std::string name_, key_;
  cv::Ptr<Odometry> odometry_;
  cv::Ptr<cv::rgbd::OdometryFrame> source_, target_;
};
}  // namespace

void add_opencv(Methods& methods) {
  cv::setNumThreads(1);
  methods.push_back(std::make_unique<OpenCvOdometry<cv::rgbd::RgbdOdometry>>("OpenCV RgbdOdometry", "opencv_rgbd"));
  methods.push_back(std::make_unique<OpenCvOdometry<cv::rgbd::RgbdICPOdometry>>("OpenCV RgbdICPOdometry", "opencv_rgbd_icp"));
  methods.push_back(std::make_unique<OpenCvOdometry<cv::rgbd::ICPOdometry>>("OpenCV ICPOdometry (depth)", "opencv_icp"));
}
