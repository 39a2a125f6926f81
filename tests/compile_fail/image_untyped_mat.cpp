// expect: an untyped cv::Mat is passed as apso::opencv::as_image<float>(mat)
#include <apso/traits/image.hpp>

namespace cv {
struct Mat {};  // the pixel type is known at run time only
}  // namespace cv

#ifdef CONTROL
using Given = apso::Image<float>;
#else
using Given = cv::Mat;
#endif

void use(const Given& image, apso::Image<float>& out) { apso::copy_to_float(image, 1.0, out); }
