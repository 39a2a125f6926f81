#include <apso/apso.hpp>

double turned(double angle) {
  apso::Twist xi = apso::Twist::Zero();
  xi(5) = angle;
  return apso::rotation_angle(apso::se3_exp(xi));
}
