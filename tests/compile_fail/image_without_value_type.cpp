// expect: apso: image_traits<T> needs `using value_type = float;`
#include <apso/traits/image.hpp>

struct MyImage {};
template <>
struct apso::image_traits<MyImage> {
#ifdef CONTROL
  using value_type = float;
#endif
  static int width(const MyImage&) { return 0; }
  static int height(const MyImage&) { return 0; }
  static float at(const MyImage&, int, int) { return 0; }
};

void use(const MyImage& image, apso::Image<float>& out) { apso::copy_to_float(image, 1.0, out); }
