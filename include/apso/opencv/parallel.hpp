/// \file
/// The threads of OpenCV as an executor.
#pragma once

#include <opencv2/core/utility.hpp>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Runs the parts of an algorithm with cv::parallel_for_. How many threads there are is OpenCV's setting
/// (cv::setNumThreads); results do not depend on it.
struct ParallelExecutor {
  template <class F>
  void operator()(int n, F&& f) const {
    if (n <= 0) return;
    cv::parallel_for_(
        cv::Range(0, n),
        [&f](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) f(i);
        },
        n);
  }
};

}  // namespace opencv
APSO_NAMESPACE_END
