/// \file
/// Mask images that another program wrote, of any depth.
#pragma once

#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/config.hpp>
#include <apso/io/tum_text.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Reads a mask of any number of bits and channels: what is not 0 in one of the colours is dynamic.
/// \param size that it must have [px]
/// \returns 8 bit, 0 = static. Labels are kept; those above 255 become 255, those between 0 and 1 become 255.
/// \throws io_error naming the file when it is no image or has another size
[[nodiscard]] inline cv::Mat read_mask(const std::string& file, const cv::Size& size) {
  cv::Mat raw;
  try {
    raw = cv::imread(file, cv::IMREAD_UNCHANGED);  // any other mode would scale 16 bit and colours, and lose small labels
  } catch (const cv::Exception&) {                 // more pixels than OpenCV accepts
  }
  if (raw.empty()) throw io_error(file + ": not a readable image");
  if (raw.size() != size) {
    throw io_error(file + ": the mask is " + std::to_string(raw.cols) + "x" + std::to_string(raw.rows) +
                   ", expected the size of the images, " + std::to_string(size.width) + "x" + std::to_string(size.height));
  }
  cv::Mat mask(size, CV_8UC1, cv::Scalar(0));
  const int colours = raw.channels() == 2 || raw.channels() == 4 ? raw.channels() - 1 : raw.channels();  // the last is opacity
  for (int i = 0; i < colours; ++i) {
    cv::Mat colour;
    cv::Mat labels;
    cv::extractChannel(raw, colour, i);
    colour.convertTo(labels, CV_8U);
    labels.setTo(255, (labels == 0) & (colour != 0));
    cv::max(mask, labels, mask);
  }
  return mask;
}

}  // namespace opencv
APSO_NAMESPACE_END
