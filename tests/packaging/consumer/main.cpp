// A program that uses the library as a stranger would. With WHOLE it includes everything, in two files that are linked.
#ifdef WHOLE
#include <apso/apso.hpp>
#else
#include <apso/math/se3.hpp>
#include <apso/types/score.hpp>
#endif
#include <apso/version.hpp>

#include <cstdio>

double turned(double angle);  // in second.cpp

int main() {
  const apso::Quality quality = apso::Deviation(0.25).complement();
  const bool ok = quality == apso::Quality(0.75) && turned(0.5) > 0.499999 && turned(0.5) < 0.500001;
  std::printf("apso %s\n", APSO_VERSION);
  return ok ? 0 : 1;
}
