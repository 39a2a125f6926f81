// Linked only when a component with OpenCV is asked for.
#include <apso/opencv/adapters.hpp>

bool adapted() {
  const cv::Mat_<float> image(2, 3, 0.5F);
  return apso::opencv::as_image<float>(image)(2, 1) == 0.5F;
}
