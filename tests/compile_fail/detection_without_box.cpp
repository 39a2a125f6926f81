// expect: apso: detection_traits<T> needs `static apso::Box box(const T& detection);`
#include <apso/traits/detection.hpp>

struct MyObject {};
template <>
struct apso::detection_traits<MyObject> {
#ifdef CONTROL
  static apso::Box box(const MyObject&) { return {}; }
#endif
  static float score(const MyObject&) { return 0; }
  static int class_id(const MyObject&) { return 0; }
};

apso::Detection use(const MyObject& object) { return apso::to_detection(object); }
