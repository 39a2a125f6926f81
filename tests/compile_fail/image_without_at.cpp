// expect: apso: image_traits<T> needs `static value_type at(const T& image, int x, int y);`
#include <apso/traits/image.hpp>

struct MyImage {};
template <>
struct apso::image_traits<MyImage> {
  using value_type = float;
  static int width(const MyImage&) { return 0; }
  static int height(const MyImage&) { return 0; }
#ifdef CONTROL
  static float at(const MyImage&, int, int) { return 0; }
#endif
};

void use(const MyImage& image, apso::Image<float>& out) { apso::copy_to_float(image, 1.0, out); }
