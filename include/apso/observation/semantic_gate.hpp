/// \file
/// Objects that move, out of all objects: "a person, and it moves".
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Keeps of a semantic mask the objects in which another mask sees movement, as a whole; the rest becomes static.
///
/// The objects are the detections if there are any, otherwise the connected regions of the mask. An object moves when
/// the mean probability of `motion` over its known pixels is at least `share`; an object of which nothing is known keeps
/// what the semantic mask says. Outside of all objects nothing is dynamic.
class SemanticGate {
 public:
  /// \param share (0,1]
  /// \param step  objects are judged on every step-th pixel [px]
  explicit SemanticGate(double share = 0.25, int step = 4) : share_(share), step_(step) {
    expects(share > 0 && share <= 1 && step > 0, "SemanticGate: share must be in (0,1] and step > 0");
  }

  /// \param mask the semantic mask; becomes the result
  void apply(const std::vector<Detection>& objects, const DynamicMask& motion, DynamicMask& mask) {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    expects(motion.probability.width() == w && motion.probability.height() == h, "SemanticGate: masks differ in size");
    const int sw = (w + step_ - 1) / step_;
    const int sh = (h + step_ - 1) / step_;
    const auto at = [&](int i, const auto& image) { return image(i % sw * step_, i / sw * step_); };
    keep_.assign(sw, sh, 0);
    const auto judge = [&](const auto& for_each_pixel) {
      double sum = 0;
      double n = 0;
      for_each_pixel([&](int i) {
        if (at(i, motion.known) == 0) return;
        sum += static_cast<double>(at(i, motion.probability));
        n += 1;
      });
      if (n > 0 && sum < share_ * n) return;
      for_each_pixel([&](int i) { keep_.data()[i] = 1; });
    };
    if (!objects.empty()) {
      for (const Detection& d : objects) {
        if (!d.movable) continue;
        judge([&](const auto& visit) {
          for (int i = 0; i < sw * sh; ++i) {
            if (covers(d, i % sw * step_, i / sw * step_) && at(i, mask.probability) > 0) visit(i);
          }
        });
      }
    } else {
      for_each_component(
          sw, sh, scratch_, [&](int i) { return at(i, mask.probability) > 0; }, [](int, int) { return true; },
          [&](const int* first, const int* last) {
            judge([&](const auto& visit) {
              for (const int* i = first; i != last; ++i) visit(*i);
            });
          });
    }
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        // a thin border that falls between the steps goes with its nearest step
        const int i = std::min((x + step_ / 2) / step_, sw - 1);
        const int j = std::min((y + step_ / 2) / step_, sh - 1);
        if (keep_(i, j) == 0) mask.probability(x, y) = 0;
        mask.known(x, y) = mask.known(x, y) != 0 || motion.known(x, y) != 0 ? 1 : 0;
      }
    }
  }

 private:
  double share_;
  int step_;
  Image<std::uint8_t> keep_;
  RegionScratch scratch_;
};

APSO_NAMESPACE_END
