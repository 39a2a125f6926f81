// expect: apso: keypoint_traits<T> needs `static float response(const T& keypoint);`
#include <apso/traits/keypoint.hpp>

struct MyCorner {};
template <>
struct apso::keypoint_traits<MyCorner> {
  static float x(const MyCorner&) { return 0; }
  static float y(const MyCorner&) { return 0; }
#ifdef CONTROL
  static float response(const MyCorner&) { return 0; }
#endif
};

apso::Keypoint use(const MyCorner& corner) { return apso::to_keypoint(corner); }
