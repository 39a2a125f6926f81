// expect: apso: a noise model needs `template <class T> T squared_weight_depth(const apso::NoiseInput<T>&) const`, 1 / variance of the
// depth residual [1/m^2], for T = apso::BasicLanes<n>
#include <apso/refinement/aligner.hpp>

struct Constant {
  template <class T>
  T squared_weight_intensity(const apso::NoiseInput<T>&) const {
    return T(2500);
  }
#ifdef CONTROL
  template <class T>
  T squared_weight_depth(const apso::NoiseInput<T>&) const {
    return T(1e4);
  }
#endif
};

void use() { apso::BasicDirectAligner<apso::RobustKernel, Constant> aligner; }
