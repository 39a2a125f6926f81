// expect: apso: a kernel needs `template <class T> T rho(const T& s2) const`, the cost of the squared residual s2, for T = double and
// apso::BasicLanes<n>
#include <apso/refinement/aligner.hpp>

struct Lorentz {
  template <class T>
  T weight(const T& s2) const {
    return T(1) / (T(1) + s2);
  }
#ifdef CONTROL
  template <class T>
  T rho(const T& s2) const {
    using std::log1p;
    return T(0.5) * log1p(s2);
  }
#endif
};

void use() { apso::BasicDirectAligner<Lorentz> aligner; }
