/// \file
/// Numeric derivatives, for checking analytic ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include <Eigen/Core>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Jacobian of f: R^n -> R^m at x by central differences, J(i,j) = (f_i(x + h e_j) - f_i(x - h e_j)) / (2 h).
/// The error is of the order h^2 f''' + eps |f| / h; the default h suits functions of order 1 in double.
/// \param f     callable taking an Eigen::VectorXd and returning a double or an Eigen vector of fixed or dynamic size
/// \param x     point of differentiation, n values
/// \param step  h for an element of magnitude up to 1, larger elements use step * |x_j|
template <class F>
[[nodiscard]] Eigen::MatrixXd numeric_jacobian(F&& f, const Eigen::VectorXd& x, double step = 1e-5) {
  expects(step > 0, "numeric_jacobian: step must be > 0");
  const auto value = [&f](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    if constexpr (std::is_convertible_v<decltype(f(at)), double>) {
      return Eigen::VectorXd::Constant(1, static_cast<double>(f(at)));
    } else {
      return Eigen::VectorXd(f(at).template cast<double>());
    }
  };
  Eigen::VectorXd moved = x;
  Eigen::MatrixXd jacobian;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const double h = step * std::max(1.0, std::abs(x[j]));
    const double up = x[j] + h;
    const double down = x[j] - h;
    moved[j] = up;
    const Eigen::VectorXd f_up = value(moved);
    moved[j] = down;
    const Eigen::VectorXd f_down = value(moved);
    moved[j] = x[j];
    if (j == 0) jacobian.resize(f_up.size(), x.size());
    jacobian.col(j) = (f_up - f_down) / (up - down);  // up - down is what was really stepped, after rounding
  }
  return jacobian;
}

}  // namespace testing
APSO_NAMESPACE_END
