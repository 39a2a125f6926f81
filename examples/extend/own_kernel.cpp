// A robust kernel and a noise model of your own, in one file of yours: both are compiled into the loops over the pixels and run at
// the speed of apso's own. Eigen is all this file needs.
#include <cmath>
#include <cstdio>

#include <apso/refinement/aligner.hpp>
#include <apso/testing/synthetic.hpp>

// [kernel]
// C of the paper's eq. (15): a kernel that is quadratic up to k and lets go of what is further off than 3 k.
// T is a double, or several floats at once (apso::BasicLanes<n>): functions by their names, and select() where a formula branches.
struct Hampel {
  double k = 2;

  // w(s) = rho'(s)/s of the squared residual s2, s in standard deviations
  template <class T>
  T weight(const T& s2) const {
    using std::sqrt;
    const T s = sqrt(s2);
    return apso::select(s2 <= T(k * k), T(1), apso::select(s2 <= T(9 * k * k), (T(3 * k) - s) / (T(2) * s), T(0)));
  }
  template <class T>
  T rho(const T& s2) const {
    using std::min;
    using std::sqrt;
    const T left = T(3 * k) - min(sqrt(s2), T(3 * k));
    return apso::select(s2 <= T(k * k), T(0.5) * s2, T(1.5 * k * k) - T(0.25) * left * left);
  }
};
// [/kernel]

// [noise]
// w_I and w_D of eq. (15), squared: a camera of constant noise, and a time-of-flight sensor whose noise grows with the distance.
struct TimeOfFlight {
  double sigma_intensity = 0.02;  // [0,1]
  double sigma_depth = 0.004;     // at a distance of 1 m [m]

  template <class T>
  T squared_weight_intensity(const apso::NoiseInput<T>&) const {
    return T(1 / (sigma_intensity * sigma_intensity));
  }
  template <class T>
  T squared_weight_depth(const apso::NoiseInput<T>& p) const {
    using std::max;
    const T z = max(p.z_warped, T(0.1));
    return T(1 / (sigma_depth * sigma_depth)) / (z * z);
  }
};
// [/noise]

int main() {
  const apso::testing::SyntheticSequence sequence("static_xyz");
  apso::testing::SyntheticFrame first, second;
  sequence.render(20, first);
  sequence.render(24, second);
  apso::FramePyramid reference, current;
  reference.build(first.rgbd(), sequence.camera(), {}, {}, apso::PyramidRole::Reference);
  current.build(second.rgbd(), sequence.camera(), {}, {}, apso::PyramidRole::Current);
  const auto error = [&](const apso::AlignmentResult& r) {
    if (!apso::succeeded(r.status)) return 1.0;
    return (r.T_world_camera.translation() - second.T_world_camera.translation()).norm();
  };

  // [use]
  apso::BasicDirectAligner<Hampel, TimeOfFlight> aligner;
  const apso::AlignmentResult result = aligner.align({{&reference, first.T_world_camera, 1.0}}, current, {first.T_world_camera});
  // [/use]
  apso::DirectAligner usual;
  const double its = error(usual.align({{&reference, first.T_world_camera, 1.0}}, current, {first.T_world_camera}));
  std::printf("%s, error %.4f m (by the kernel and noise model of apso %.4f m)\n", apso::to_string(result.status), error(result), its);
  return error(result) < 0.01 ? 0 : 1;
}
