// expect: apso: ByteImage<T> needs an arithmetic pixel type, e.g. std::uint16_t
#include <apso/traits/images/byte_image.hpp>

struct Rgb {
  unsigned char r, g, b;
};
#ifdef CONTROL
using Pixel = unsigned char;
#else
using Pixel = Rgb;
#endif

apso::ByteImage<Pixel> use() { return {}; }
