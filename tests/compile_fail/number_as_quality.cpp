// expect: Quality
#include <apso/types/score.hpp>

#ifdef CONTROL
apso::Quality use(double x) { return apso::Quality(x); }
#else
apso::Quality use(double x) { return x; }
#endif
