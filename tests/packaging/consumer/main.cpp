#include <apso/apso.hpp>

double turned(double angle);  // in second.cpp

int main() {
  const apso::Quality quality = apso::Deviation(0.25).complement();
  const bool ok = quality == apso::Quality(0.75) && turned(0.5) > 0.499999 && turned(0.5) < 0.500001;
  return ok ? 0 : 1;
}
