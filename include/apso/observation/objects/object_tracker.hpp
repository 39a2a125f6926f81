/// \file
/// Objects from a dynamic mask and from detections, with identities that last.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/assignment.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/options.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// class_id of an object that was found by its motion alone.
inline constexpr int kUnknownClass = -1;

struct ObjectTrackerOptions {
  int factor = 4;             ///< the mask is looked at in steps of this many pixels
  int min_pixels = 600;       ///< smaller regions of the mask are no objects [px]
  double depth_gap = 0.25;    ///< regions are cut where neighbouring depths differ by more [m]
  double min_match = 0.15;    ///< agreement (half overlap of the boxes, half share of the pixels) of an object with what
                              ///< was predicted, from which it can be the same
  double covered = 0.7;       ///< a region with this share inside a detection belongs to it
  int max_missed = 10;        ///< frames an identity is kept without being seen
  double keep = 0.6;          ///< share of its past motion probability an object keeps per frame
  int min_tracks = 3;         ///< fewer tracks on an object do not tell where it goes
  double body_depth = 0.35;   ///< parts above each other that differ by less are one body [m]
  int together = 6;           ///< frames after which two objects that are parts of one body become one
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("factor", s.factor, 1, 64);
    v("min_pixels", s.min_pixels, 1, 100000000);
    v("depth_gap", s.depth_gap, 0.0, 100.0);
    v("min_match", s.min_match, 0.01, 1.0);
    v("covered", s.covered, 0.0, 1.0);
    v("max_missed", s.max_missed, 0, 100000);
    v("keep", s.keep, 0.0, 0.99);
    v("min_tracks", s.min_tracks, 1, 1000);
    v("body_depth", s.body_depth, 0.0, 10.0);
    v("together", s.together, 1, 100000);
  }
};

/// Turns what moves into objects with boxes and lasting identities.
///
/// Detections from outside come first: they keep box, class and score, and get their motion probability from the
/// mask where it is missing. Regions of the mask which no detection explains follow, with class kUnknownClass and the
/// mean probability as score.
///
/// Every known object predicts where its pixels go: by the median flow of the tracks on it, else by its own velocity.
/// A region in which several known objects have pixels is cut between them, so people who touch or pass keep their
/// boxes; then objects and predictions are matched so that the sum of agreements is largest (Hungarian method).
class ObjectTracker {
 public:
  explicit ObjectTracker(const ObjectTrackerOptions& options = {}) : options_(options) {
    apso::validate(options, "object_tracker");
  }

  /// \param depth [m], size of the mask, may be empty: then regions are not cut at depth steps
  /// \param detections may be empty; their masks must outlive the result
  /// \param tracks points followed from the previous frame; may be empty
  /// \returns valid until the next call
  const std::vector<Detection>& update(const DynamicMask& mask, const AnyImage& depth, const AnyDetections& any_detections = {},
                                       const AnyTracks& any_tracks = {}) {
    const std::vector<Detection>& detections = any_detections.in(detections_);
    const std::vector<PointTrack>& tracks = any_tracks.in(tracks_);
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    expects(depth.empty() || (depth.width() == w && depth.height() == h),
            "ObjectTracker: depth and mask differ in size");
    objects_.clear();
    for (const Detection& d : detections) {
      expects(d.mask.empty() || (d.mask.width == w && d.mask.height == h),
              "ObjectTracker: mask of a detection has another size");
      objects_.push_back(d);
      if (!(d.motion_probability == d.motion_probability)) {
        objects_.back().motion_probability = mean_probability(mask, d);
      }
    }
    sample(mask, depth);
    predict(mask, tracks);
    cut(mask);
    add_pieces(mask);
    identify();
    return objects_;
  }

  void reset() {
    known_.clear();
    objects_.clear();
    label_.resize(0, 0);
    next_id_ = 0;
  }

 private:
  struct Known {
    Box box;
    int class_id = kUnknownClass;
    int id = -1;
    int missed = 0;
    float motion = 0;              // smoothed; NaN = not known
    float vx = 0, vy = 0, vz = 0;  // [px/frame], [m/frame]
    float dx = 0, dy = 0, dz = 0;  // predicted for this frame
    float z = 0;                   // mean depth [m], 0 = not known
    float width = 0, height = 0;   // of the box when it was seen as a whole [px]
    int other = -1;                // identity of an older object of which this may be a part
    int together = 0;              // ... for this many frames
  };
  /// A connected part of the mask, or the part of one that belongs to a known object.
  struct Piece {
    int known = -1;
    int object = -1;
    int x0 = 1 << 28, x1 = -1, y0 = 1 << 28, y1 = -1;  // small px
    int pixels = 0;
    double sum = 0;    // of the probability
    double depth = 0;  // sum over pixels that have one
    int measured = 0;
  };

  [[nodiscard]] float mean_probability(const DynamicMask& mask, const Detection& d) const {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    const auto limit = [](float v, int n) {
      return static_cast<int>(v == v ? std::clamp(v, 0.0F, static_cast<float>(n)) : 0.0F);
    };
    const bool has_mask = !d.mask.empty();
    const int x0 = has_mask ? 0 : limit(std::floor(d.box.x), w);
    const int x1 = has_mask ? w : limit(std::ceil(d.box.x + d.box.width), w);
    const int y0 = has_mask ? 0 : limit(std::floor(d.box.y), h);
    const int y1 = has_mask ? h : limit(std::ceil(d.box.y + d.box.height), h);
    double sum = 0;
    double n = 0;
    for (int y = y0; y < y1; y += options_.factor) {
      for (int x = x0; x < x1; x += options_.factor) {
        if (mask.known(x, y) == 0 || (has_mask && d.mask(x, y) == 0)) continue;
        sum += static_cast<double>(mask.probability(x, y));
        n += 1;
      }
    }
    return n > 0 ? static_cast<float>(clamp01(sum / n)) : std::numeric_limits<float>::quiet_NaN();
  }

  // Depth on the grid of small pixels.
  void sample(const DynamicMask& mask, const AnyImage& depth) {
    const int f = options_.factor;
    w_ = mask.probability.width() / f;
    h_ = mask.probability.height() / f;
    depth_.assign(w_, h_, 0.0F);
    if (depth.empty()) return;
    auto read = rows(depth, row_);
    for (int y = 0; y < h_; ++y) {
      const float* row = read(y * f + f / 2);
      for (int x = 0; x < w_; ++x) {
        const float z = row[x * f + f / 2];
        depth_(x, y) = z > 0 && z < 1e3F ? z : 0.0F;
      }
    }
  }

  // Where the pixels of every known object are now: seed_ holds the number of the object plus one.
  void predict(const DynamicMask& mask, const std::vector<PointTrack>& tracks) {
    const auto f = static_cast<float>(options_.factor);
    const auto gap = static_cast<float>(options_.depth_gap);
    const bool has_labels = label_.width() == w_ && label_.height() == h_;
    seed_.assign(w_, h_, 0);
    fit_.assign(w_, h_, std::numeric_limits<float>::infinity());
    const auto small = [&](float x, float y) {
      const float u = x / f;
      const float v = y / f;
      const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(w_) && v < static_cast<float>(h_);
      return inside ? static_cast<int>(v) * w_ + static_cast<int>(u) : -1;
    };
    for (std::size_t k = 0; k < known_.size(); ++k) {
      Known& known = known_[k];
      du_.clear();
      dv_.clear();
      for (const PointTrack& t : tracks) {
        const int from = has_labels && known.missed == 0 && t.age >= 1 ? small(t.previous_x, t.previous_y) : -1;
        if (from < 0 || label_.data()[from] != static_cast<int>(k) + 1) continue;
        du_.push_back(t.x - t.previous_x);
        dv_.push_back(t.y - t.previous_y);
      }
      const bool told = static_cast<int>(du_.size()) >= options_.min_tracks;
      known.dx = told ? upper_median(du_) : known.vx;
      known.dy = told ? upper_median(dv_) : known.vy;
      known.dz = known.vz;
      known.box.x += known.dx;
      known.box.y += known.dy;
      if (known.z > 0) known.z += known.dz;
    }
    for (int i = 0; has_labels && i < w_ * h_; ++i) {
      const int k = label_.data()[i] - 1;
      if (k < 0 || known_[static_cast<std::size_t>(k)].missed > 0) continue;
      const Known& known = known_[static_cast<std::size_t>(k)];
      const int to = small((static_cast<float>(i % w_) + 0.5F) * f + known.dx, (static_cast<float>(i / w_) + 0.5F) * f + known.dy);
      if (to < 0) continue;
      const float before = label_depth_.data()[i];
      const float now = depth_.data()[to];
      const float off = before > 0 && now > 0 ? std::abs(now - before - known.dz) : 0.1F;
      if (off > 0.4F * gap || off >= fit_.data()[to]) continue;
      fit_.data()[to] = off;  // where two objects meet, the one whose depth fits better
      seed_.data()[to] = k + 1;
    }
    // who was hidden lately is expected anywhere in a box of its full size, where nobody who was seen fits
    for (std::size_t k = 0; k < known_.size(); ++k) {
      const Known& known = known_[k];
      if (known.missed == 0 || !(known.z > 0)) continue;
      // what was seen last may have been either end of it
      const float left = known.box.x + known.box.width - 1.25F * known.width;
      const float right = known.box.x + 1.25F * known.width;
      const float top = known.box.y + known.box.height - 1.25F * known.height;
      const float bottom = known.box.y + 1.25F * known.height;
      for (int i = 0; i < w_ * h_; ++i) {
        const int x = i % w_ * options_.factor + options_.factor / 2;
        const int y = i / w_ * options_.factor + options_.factor / 2;
        const auto X = static_cast<float>(x);
        const auto Y = static_cast<float>(y);
        if (!(X >= left && Y >= top && X < right && Y < bottom) || !(mask.probability(x, y) >= 0.5F)) continue;
        const float off = std::abs(depth_.data()[i] - known.z) + 0.25F * gap;
        if (off > gap || off >= fit_.data()[i]) continue;
        fit_.data()[i] = off;
        seed_.data()[i] = static_cast<int>(k) + 1;
      }
    }
    seeds_.assign(known_.size(), 0);
    for (int i = 0; i < w_ * h_; ++i) {
      if (seed_.data()[i] > 0) ++seeds_[static_cast<std::size_t>(seed_.data()[i]) - 1];
    }
  }

  // Connected regions of the mask, cut between the known objects that have pixels in them.
  void cut(const DynamicMask& mask) {
    const int f = options_.factor;
    const auto gap = static_cast<float>(options_.depth_gap);
    const auto at = [&](int i) { return mask.probability(i % w_ * f + f / 2, i / w_ * f + f / 2); };
    piece_.assign(w_, h_, 0);
    pieces_.clear();
    if (w_ == 0 || h_ == 0) return;
    for_each_component(
        w_, h_, scratch_, [&](int i) { return at(i) >= 0.5F; },
        [&](int i, int j) {
          const float a = depth_.data()[i];
          const float b = depth_.data()[j];
          return !(a > 0 && b > 0) || !(std::abs(a - b) > gap + 0.05F * std::min(a, b));
        },
        [&](const int* first, const int* last) {
          if ((last - first) * f * f < options_.min_pixels) return;
          count_.assign(known_.size(), 0);
          for (const int* i = first; i != last; ++i) {
            if (seed_.data()[*i] > 0) ++count_[static_cast<std::size_t>(seed_.data()[*i]) - 1];
          }
          const auto begin = static_cast<int>(pieces_.size());
          owner_.assign(known_.size(), 0);
          for (std::size_t k = 0; k < known_.size(); ++k) {
            if (count_[k] < 6 || 5 * count_[k] < seeds_[k]) continue;
            Piece p;
            p.known = static_cast<int>(k);
            pieces_.push_back(p);
            owner_[k] = static_cast<int>(pieces_.size());
          }
          if (static_cast<int>(pieces_.size()) == begin) pieces_.emplace_back();
          const bool alone = static_cast<int>(pieces_.size()) == begin + 1;
          front_.clear();
          for (const int* i = first; i != last; ++i) {
            const int k = seed_.data()[*i] - 1;
            piece_.data()[*i] = alone ? begin + 1 : k >= 0 && owner_[static_cast<std::size_t>(k)] > 0 ? owner_[static_cast<std::size_t>(k)] : -1;
            if (!alone && piece_.data()[*i] > 0) front_.push_back(*i);
          }
          // the rest of the region goes to the nearest piece, first along its surface, then anywhere
          for (const bool along : {true, false}) {
            for (std::size_t q = 0; q < front_.size(); ++q) {
              const int i = front_[q];
              const int x = i % w_;
              const int y = i / w_;
              const auto visit = [&](int j) {
                if (piece_.data()[j] != -1) return;
                if (along && std::abs(depth_.data()[i] - depth_.data()[j]) > 0.4F * gap) return;
                piece_.data()[j] = piece_.data()[i];
                front_.push_back(j);
              };
              if (x > 0) visit(i - 1);
              if (x + 1 < w_) visit(i + 1);
              if (y > 0) visit(i - w_);
              if (y + 1 < h_) visit(i + w_);
            }
          }
          for (const int* i = first; i != last; ++i) {
            Piece& p = pieces_[static_cast<std::size_t>(piece_.data()[*i]) - 1];
            p.x0 = std::min(p.x0, *i % w_);
            p.x1 = std::max(p.x1, *i % w_);
            p.y0 = std::min(p.y0, *i / w_);
            p.y1 = std::max(p.y1, *i / w_);
            p.sum += static_cast<double>(at(*i));
            ++p.pixels;
            if (depth_.data()[*i] > 0) {
              p.depth += static_cast<double>(depth_.data()[*i]);
              ++p.measured;
            }
          }
        });
    join();
  }

  // Parts above each other at one depth are one body, as are a small part or a box within a box with what they lie
  // before; people stand side by side, or apart in depth.
  [[nodiscard]] bool one_body(const Box& a, double za, const Box& b, double zb) const {
    const double apart = za > 0 && zb > 0 ? std::abs(za - zb) : 0.0;
    const float across = std::min(a.x + a.width, b.x + b.width) - std::max(a.x, b.x);
    const float along = std::min(a.y + a.height, b.y + b.height) - std::max(a.y, b.y);
    const float shorter = std::min(a.height, b.height);
    const bool small_part = shorter < 0.4F * std::max(a.height, b.height);
    const bool nested = a.intersect(b).area() > 0.8F * std::min(a.area(), b.area()) && apart < 0.5 * options_.body_depth;
    const bool stacked = across > 0.6F * std::min(a.width, b.width) && (small_part || along < 0.4F * shorter);
    return nested || (stacked && apart < options_.body_depth);
  }

  // An object that falls apart: parts of its body and small parts close by stay with it, all else is another object.
  void join() {
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      if (pieces_[a].known < 0) continue;
      std::size_t largest = a;
      for (std::size_t b = 0; b < pieces_.size(); ++b) {
        if (pieces_[b].known == pieces_[a].known && pieces_[b].pixels > pieces_[largest].pixels) largest = b;
      }
      if (largest == a) continue;
      const Piece& main = pieces_[largest];
      const int gap = std::max(std::max(pieces_[a].x0 - main.x1, main.x0 - pieces_[a].x1),
                               std::max(pieces_[a].y0 - main.y1, main.y0 - pieces_[a].y1));
      const int reach = 2 + std::max(main.x1 - main.x0, main.y1 - main.y0) / 8;
      const auto middle = [](const Piece& p) { return p.measured > 0 ? p.depth / p.measured : 0.0; };
      const auto box = [](const Piece& p) {
        return Box{static_cast<float>(p.x0), static_cast<float>(p.y0), static_cast<float>(p.x1 - p.x0 + 1), static_cast<float>(p.y1 - p.y0 + 1)};
      };
      const bool body = one_body(box(pieces_[a]), middle(pieces_[a]), box(main), middle(main));
      const bool stays = gap <= reach && (body || 3 * pieces_[a].pixels <= main.pixels);
      pieces_[a].object = stays ? static_cast<int>(largest) : -1;
      if (pieces_[a].object < 0) pieces_[a].known = -1;
    }
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      Piece& part = pieces_[a];
      if (part.object < 0) continue;
      Piece& main = pieces_[static_cast<std::size_t>(part.object)];
      main.x0 = std::min(main.x0, part.x0);
      main.x1 = std::max(main.x1, part.x1);
      main.y0 = std::min(main.y0, part.y0);
      main.y1 = std::max(main.y1, part.y1);
      main.pixels += part.pixels;
      main.sum += part.sum;
      main.depth += part.depth;
      main.measured += part.measured;
      for (std::size_t i = 0; i < piece_.size(); ++i) {
        if (piece_.data()[i] == static_cast<int>(a) + 1) piece_.data()[i] = part.object + 1;
      }
      part.pixels = 0;
      part.object = -1;
    }
  }

  [[nodiscard]] bool inside(const Detection& d, int x, int y) const {
    if (!d.mask.empty()) return d.mask(x, y) != 0;
    const auto X = static_cast<float>(x);
    const auto Y = static_cast<float>(y);
    return X >= d.box.x && X < d.box.x + d.box.width && Y >= d.box.y && Y < d.box.y + d.box.height;
  }

  // Pieces that no detection explains become objects; object_ holds the number of the object of a pixel plus one.
  void add_pieces(const DynamicMask& mask) {
    const int f = options_.factor;
    const std::size_t given = objects_.size();
    object_.assign(w_, h_, 0);
    covered_.assign(pieces_.size() * given, 0);
    for (int i = 0; i < w_ * h_; ++i) {
      const int x = i % w_ * f + f / 2;
      const int y = i / w_ * f + f / 2;
      for (std::size_t k = 0; k < given; ++k) {
        if (!inside(objects_[k], x, y)) continue;
        if (mask.probability(x, y) >= 0.5F) object_.data()[i] = static_cast<int>(k) + 1;
        if (objects_[k].movable && piece_.data()[i] > 0) ++covered_[(static_cast<std::size_t>(piece_.data()[i]) - 1) * given + k];
      }
    }
    for (std::size_t p = 0; p < pieces_.size(); ++p) {
      Piece& piece = pieces_[p];
      if (piece.pixels * f * f < options_.min_pixels) continue;
      bool explained = false;
      for (std::size_t k = 0; k < given; ++k) explained = explained || covered_[p * given + k] >= options_.covered * piece.pixels;
      if (explained) continue;
      Detection d;
      d.box = {static_cast<float>(piece.x0 * f), static_cast<float>(piece.y0 * f),
               static_cast<float>((piece.x1 - piece.x0 + 1) * f), static_cast<float>((piece.y1 - piece.y0 + 1) * f)};
      d.score = static_cast<float>(clamp01(piece.sum / piece.pixels));
      d.motion_probability = d.score;
      d.class_id = kUnknownClass;
      objects_.push_back(d);
      piece.object = static_cast<int>(objects_.size());
    }
    for (std::size_t i = 0; i < piece_.size(); ++i) {
      const int p = piece_.data()[i];
      if (p > 0 && pieces_[static_cast<std::size_t>(p) - 1].object > 0) object_.data()[i] = pieces_[static_cast<std::size_t>(p) - 1].object;
    }
  }

  // Agreement of an object with what a known one predicts, in [0,1].
  [[nodiscard]] double agreement(std::size_t o, std::size_t k) const {
    const Known& known = known_[k];
    const double overlap = static_cast<double>(iou(objects_[o].box, known.box));
    if (seeds_[k] > 0) return 0.5 * overlap + 0.5 * shared_[o * known_.size() + k] / seeds_[k];
    // not seen lately: by distance, which may be larger than the box
    const Box& b = objects_[o].box;
    const double dx = static_cast<double>(b.x + b.width / 2 - known.box.x - known.box.width / 2);
    const double dy = static_cast<double>(b.y + b.height / 2 - known.box.y - known.box.height / 2);
    const double reach = 0.75 * std::hypot(static_cast<double>(known.box.width), static_cast<double>(known.box.height));
    const double z = object_depth(o);
    if (known.z > 0 && z > 0 && std::abs(z - static_cast<double>(known.z)) > 4.0 * options_.depth_gap) return 0.0;
    return 0.5 * overlap + 0.5 * std::max(0.0, 1.0 - std::hypot(dx, dy) / std::max(1.0, reach));
  }
  [[nodiscard]] double object_depth(std::size_t o) const {
    return depth_count_[o] > 0 ? depth_sum_[o] / depth_count_[o] : 0.0;
  }

  void identify() {
    const std::size_t n = objects_.size();
    const std::size_t m = known_.size();
    shared_.assign(n * m, 0);
    depth_sum_.assign(n, 0.0);
    depth_count_.assign(n, 0);
    for (std::size_t i = 0; i < object_.size(); ++i) {
      const int o = object_.data()[i] - 1;
      if (o < 0) continue;
      if (seed_.data()[i] > 0) ++shared_[static_cast<std::size_t>(o) * m + static_cast<std::size_t>(seed_.data()[i]) - 1];
      if (depth_.data()[i] > 0) {
        depth_sum_[static_cast<std::size_t>(o)] += static_cast<double>(depth_.data()[i]);
        ++depth_count_[static_cast<std::size_t>(o)];
      }
    }
    cost_.assign(n * m, std::numeric_limits<double>::infinity());
    for (std::size_t o = 0; o < n; ++o) {
      if (objects_[o].track_id >= 0) continue;  // whoever detected it also tracks it
      for (std::size_t k = 0; k < m; ++k) {
        const bool classes_fit = objects_[o].class_id == known_[k].class_id ||
                                 objects_[o].class_id == kUnknownClass || known_[k].class_id == kUnknownClass;
        if (classes_fit) cost_[o * m + k] = 1.0 - agreement(o, k);
      }
    }
    // a tiny part more, so that an agreement of just min_match counts
    assign(cost_, n, m, 1.0 - options_.min_match + 1e-9, match_, assignment_);
    for (Known& k : known_) ++k.missed;
    for (std::size_t o = 0; o < n; ++o) {
      Detection& d = objects_[o];
      if (d.track_id >= 0) {
        next_id_ = std::max(next_id_, d.track_id + 1);
        continue;
      }
      const auto z = static_cast<float>(object_depth(o));
      if (match_[o] < 0) {
        match_[o] = static_cast<int>(known_.size());
        Known k;
        k.id = next_id_++;
        k.motion = d.motion_probability;
        k.z = z;
        k.width = d.box.width;
        k.height = d.box.height;
        known_.push_back(k);
      } else {
        Known& k = known_[static_cast<std::size_t>(match_[o])];
        k.width = std::max(0.97F * k.width, d.box.width);
        k.height = std::max(0.97F * k.height, d.box.height);
        // after an absence the jump is no velocity, and the middle of what is half hidden does not move with it
        const bool whole = k.missed == 1 && d.box.width * d.box.height > 0.75F * k.width * k.height;
        if (whole) {
          const auto moved = [](float from, float to) { return 0.6F * from + 0.4F * to; };
          k.vx = moved(k.vx, d.box.x + d.box.width / 2 - k.box.x - k.box.width / 2 + k.dx);
          k.vy = moved(k.vy, d.box.y + d.box.height / 2 - k.box.y - k.box.height / 2 + k.dy);
          k.vz = z > 0 && k.z > 0 ? moved(k.vz, z - k.z + k.dz) : 0.0F;
        }
        k.z = z;
        const auto keep = static_cast<float>(options_.keep);
        const float fresh = d.motion_probability;
        if (!(k.motion == k.motion)) k.motion = fresh;
        if (fresh == fresh) k.motion = keep * k.motion + (1 - keep) * fresh;
        d.motion_probability = k.motion;
      }
      Known& k = known_[static_cast<std::size_t>(match_[o])];
      d.track_id = k.id;
      k.box = d.box;
      if (d.class_id != kUnknownClass || k.class_id == kUnknownClass) k.class_id = d.class_id;
      k.missed = 0;
    }
    for (Known& k : known_) {
      if (k.missed == 0) continue;
      k.vx *= 0.9F;  // who is hidden may stop meanwhile
      k.vy *= 0.9F;
      k.vz *= 0.9F;
    }
    unite();
    remember();
  }

  // Two objects found by motion that stay parts of one body become the older one.
  void unite() {
    for (std::size_t k = 1; k < known_.size(); ++k) {
      Known& young = known_[k];
      int found = -1;
      std::size_t older = 0;
      for (std::size_t j = 0; j < k && found < 0 && young.missed == 0 && young.class_id == kUnknownClass; ++j) {
        const Known& old = known_[j];
        if (old.missed > 0 || old.class_id != kUnknownClass) continue;
        const auto near = static_cast<float>(2 * options_.factor);
        const bool touch = young.box.y <= old.box.y + old.box.height + near && old.box.y <= young.box.y + young.box.height + near;
        if (!touch || !one_body(young.box, static_cast<double>(young.z), old.box, static_cast<double>(old.z))) continue;
        found = old.id;
        older = j;
      }
      young.together = found >= 0 && found == young.other ? young.together + 1 : found >= 0 ? 1 : 0;
      young.other = found;
      if (young.together < options_.together) continue;
      for (int& m : match_) {
        if (m == static_cast<int>(k)) m = static_cast<int>(older);
      }
      young.missed = options_.max_missed + 1;  // forgotten below
    }
  }

  // Labels of the pixels by the place of their object in known_, which loses the ones that were missed too long.
  void remember() {
    place_.assign(known_.size(), -1);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < known_.size(); ++k) {
      if (known_[k].missed > options_.max_missed) continue;
      place_[k] = static_cast<int>(kept);
      known_[kept] = known_[k];
      ++kept;
    }
    known_.resize(kept);
    label_.assign(w_, h_, 0);
    for (std::size_t i = 0; i < object_.size(); ++i) {
      const int o = object_.data()[i] - 1;
      if (o < 0 || match_[static_cast<std::size_t>(o)] < 0) continue;
      label_.data()[i] = place_[static_cast<std::size_t>(match_[static_cast<std::size_t>(o)])] + 1;
    }
    std::swap(label_depth_, depth_);
  }

  ObjectTrackerOptions options_;
  std::vector<Detection> objects_;
  std::vector<Known> known_;
  int next_id_ = 0;
  int w_ = 0;  // size of the grid of small pixels
  int h_ = 0;
  Image<float> depth_;
  Image<float> label_depth_;  // of the last frame
  Image<int> label_;          // of the last frame: place in known_ plus one
  Image<int> seed_;           // predicted for this frame: place in known_ plus one
  Image<int> piece_;          // number in pieces_ plus one
  Image<int> object_;         // number in objects_ plus one
  Image<float> fit_;
  std::vector<Piece> pieces_;
  std::vector<int> seeds_, count_, owner_, front_, covered_, shared_, depth_count_, match_, place_;
  std::vector<float> du_, dv_;
  std::vector<double> cost_, depth_sum_;
  AssignmentScratch assignment_;
  RegionScratch scratch_;
  std::vector<float> row_;
  std::vector<Detection> detections_;
  std::vector<PointTrack> tracks_;
};

APSO_NAMESPACE_END
