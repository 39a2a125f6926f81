/// \file
/// Eigen's matrices, arrays, maps and references as images: row y, column x. Row-major ones with contiguous rows have the
/// fast path; column-major ones (Eigen's default) are read pixel by pixel.
#pragma once

#include <type_traits>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/traits/image.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
template <class T>
using eigen_scalar_t = typename T::Scalar;
/// Eigen objects with their coefficients in memory, i.e. no expressions like a + b.
template <class T>
using eigen_dense_t = std::enable_if_t<std::is_base_of_v<Eigen::DenseBase<T>, T>,
                                       decltype(std::declval<const T&>().data(), std::declval<const T&>().outerStride())>;

template <class T>
struct eigen_image {
  using value_type = typename T::Scalar;
  static int width(const T& image) { return static_cast<int>(image.cols()); }
  static int height(const T& image) { return static_cast<int>(image.rows()); }
  static value_type at(const T& image, int x, int y) { return image(y, x); }
};
template <class T>
struct eigen_image_rows : eigen_image<T> {
  static const typename T::Scalar* row(const T& image, int y) { return image.data() + image.outerStride() * y; }
};
template <class T>
inline constexpr bool eigen_has_rows = bool(T::IsRowMajor) && T::InnerStrideAtCompileTime == 1;
}  // namespace detail

template <class T>
struct image_traits<T, std::enable_if_t<detail::detected_v<detail::eigen_dense_t, T>>>
    : std::conditional_t<detail::eigen_has_rows<T>, detail::eigen_image_rows<T>, detail::eigen_image<T>> {};

APSO_NAMESPACE_END
