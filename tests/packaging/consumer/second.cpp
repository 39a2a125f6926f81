#ifdef WHOLE
#include <apso/apso.hpp>
#else
#include <apso/math/se3.hpp>
#include <apso/types/score.hpp>
#endif

double turned(double angle) {
  apso::Twist xi = apso::Twist::Zero();
  xi(5) = angle;
  return apso::rotation_angle(apso::se3_exp(xi));
}
