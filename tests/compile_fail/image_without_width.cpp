// expect: apso: image_traits<T> needs `static int width(const T& image);`
#include <apso/traits/image.hpp>

struct MyImage {};
template <>
struct apso::image_traits<MyImage> {
  using value_type = float;
#ifdef CONTROL
  static int width(const MyImage&) { return 0; }
#endif
  static int height(const MyImage&) { return 0; }
  static float at(const MyImage&, int, int) { return 0; }
};

void use(const MyImage& image, apso::Image<float>& out) { apso::copy_to_float(image, 1.0, out); }
