/// \file
/// OpenCV's types at apso's doors: cv::Mat_<T> is an image, cv::Affine3 and a 4x4 cv::Matx are poses, cv::KeyPoint is a
/// keypoint. An untyped cv::Mat says its pixel type only at run time, so as_image<T>(mat) checks it once.
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>

#include <opencv2/core.hpp>
#include <opencv2/core/affine.hpp>

#include <apso/config.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

template <class T>
struct image_traits<cv::Mat_<T>, std::enable_if_t<std::is_arithmetic_v<T>>> {
  using value_type = T;
  static int width(const cv::Mat_<T>& image) { return image.cols; }
  static int height(const cv::Mat_<T>& image) { return image.rows; }
  static value_type at(const cv::Mat_<T>& image, int x, int y) { return image(y, x); }
  static const value_type* row(const cv::Mat_<T>& image, int y) { return image[y]; }
};

template <class Scalar>
struct pose_traits<cv::Affine3<Scalar>> {
  using scalar = Scalar;
  using matrix = Eigen::Matrix<Scalar, 3, 3>;
  using vector = Eigen::Matrix<Scalar, 3, 1>;
  static matrix rotation(const cv::Affine3<Scalar>& T) {
    matrix R;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = T.matrix(i, j);
    }
    return R;
  }
  static vector translation(const cv::Affine3<Scalar>& T) { return vector(T.matrix(0, 3), T.matrix(1, 3), T.matrix(2, 3)); }
  static cv::Affine3<Scalar> make(const matrix& R, const vector& t) {
    cv::Affine3<Scalar> T = cv::Affine3<Scalar>::Identity();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) T.matrix(i, j) = R(i, j);
      T.matrix(i, 3) = t(i);
    }
    return T;
  }
};

template <class Scalar>
struct pose_traits<cv::Matx<Scalar, 4, 4>> {
  using scalar = Scalar;
  using matrix = Eigen::Matrix<Scalar, 3, 3>;
  using vector = Eigen::Matrix<Scalar, 3, 1>;
  static matrix rotation(const cv::Matx<Scalar, 4, 4>& T) {
    matrix R;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = T(i, j);
    }
    return R;
  }
  static vector translation(const cv::Matx<Scalar, 4, 4>& T) { return vector(T(0, 3), T(1, 3), T(2, 3)); }
  static cv::Matx<Scalar, 4, 4> make(const matrix& R, const vector& t) {
    cv::Matx<Scalar, 4, 4> T = cv::Matx<Scalar, 4, 4>::eye();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) T(i, j) = R(i, j);
      T(i, 3) = t(i);
    }
    return T;
  }
};

template <>
struct keypoint_traits<cv::KeyPoint> {
  static float x(const cv::KeyPoint& k) { return k.pt.x; }
  static float y(const cv::KeyPoint& k) { return k.pt.y; }
  static float response(const cv::KeyPoint& k) { return k.response; }
  static float angle(const cv::KeyPoint& k) { return k.angle < 0 ? 0.0F : k.angle; }  // OpenCV's -1: not computed
  static int octave(const cv::KeyPoint& k) { return k.octave & 0xFF; }                // some detectors pack a layer above the octave
};

namespace opencv {

/// View of a single-channel matrix. The matrix must outlive the view.
/// Throws contract_error when the matrix is empty or its type is not T with one channel.
template <class T>
[[nodiscard]] ImageView<const T> as_image(const cv::Mat& mat) {
  static_assert(std::is_arithmetic_v<T>, "apso: as_image<T> needs an arithmetic pixel type, e.g. as_image<float>(mat)");
  expects(!mat.empty() && mat.dims == 2, "as_image: the matrix is empty or not two-dimensional");
  const int wanted = cv::traits::Type<T>::value;
  if (mat.type() != wanted) {
    contract_violation("as_image: the matrix has type " + cv::typeToString(mat.type()) + ", expected " + cv::typeToString(wanted));
  }
  return {mat.ptr<T>(), mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

/// View of an 8-bit matrix of three channels (blue, green, red). The matrix must outlive the view.
/// Throws contract_error when the matrix is empty, of another type, or has rows padded by a part of a pixel.
[[nodiscard]] inline ImageView<const Bgr8> as_colour(const cv::Mat& mat) {
  expects(!mat.empty() && mat.dims == 2, "as_colour: the matrix is empty or not two-dimensional");
  expects(mat.type() == CV_8UC3, "as_colour: the matrix must have the type CV_8UC3");
  expects(mat.step[0] % sizeof(Bgr8) == 0, "as_colour: the rows are padded by a part of a pixel; clone the matrix");
  return {reinterpret_cast<const Bgr8*>(mat.data), mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step[0] / sizeof(Bgr8))};
}

/// Matrix header over the pixels of a view; copies nothing. OpenCV has no read-only matrix: do not write to it.
template <class T>
[[nodiscard]] cv::Mat as_mat(const ImageView<T>& image) {
  using Value = std::remove_const_t<T>;
  if (image.empty()) return {};
  return {image.height, image.width, cv::traits::Type<Value>::value, const_cast<Value*>(image.data),
          static_cast<std::size_t>(image.stride) * sizeof(Value)};
}

}  // namespace opencv
APSO_NAMESPACE_END
