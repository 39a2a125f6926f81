// expect: apso: a frame is made by `apso::frame(timestamp, intensity, depth, camera)` from any images
#include <apso/observation/policies/geometric_motion.hpp>

void find(apso::GeometricMotion& motion, const apso::RgbdFrame& frame, const apso::Pose& prior, apso::DynamicMask& mask) {
#ifdef CONTROL
  motion.observe(frame, prior, apso::none, mask);
#else
  motion.observe(frame.depth, prior, apso::none, mask);
#endif
}
