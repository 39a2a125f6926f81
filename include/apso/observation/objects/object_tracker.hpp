/// \file
/// Objects from a dynamic mask and from detections, with identities that last.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/objects/object_matching.hpp>
#include <apso/observation/objects/object_prediction.hpp>
#include <apso/observation/objects/object_segmentation.hpp>
#include <apso/options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

inline constexpr int kMinimumObjectPixels = 600;  ///< smaller regions of the mask are no objects [px]: a tenth of a person at 6 m
inline constexpr double kObjectDepthGap = 0.25;   ///< regions are cut where neighbouring depths differ by more [m]: the depth of a body

struct ObjectTrackerOptions {
  int max_missed = 10;  ///< frames an identity is kept without being seen: a third of a second
  double keep = 0.6;    ///< share of its past motion probability an object keeps per frame
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("max_missed", s.max_missed, 0, 100000);
    v("keep", s.keep, 0.0, 0.99);
  }
};

/// Turns what moves into objects with boxes and lasting identities.
///
/// Detections from outside come first: they keep box, class and score, and get their motion probability from the
/// mask where it is missing. Regions of the mask which no detection explains follow, with class kUnknownClass and the
/// mean probability as score.
///
/// Every known object predicts where its pixels go: by the median flow of the tracks on it, else by its own velocity
/// (object_prediction.hpp). A region in which several known objects have pixels is cut between them, so people who touch
/// or pass keep their boxes (object_segmentation.hpp); then objects and predictions are matched (object_matching.hpp).
class ObjectTracker {
 public:
  explicit ObjectTracker(const ObjectTrackerOptions& options = {}) : options_(options) { apso::validate(options, "object_tracker"); }

  /// \param depth any image [m], size of the mask; may be empty or `none`: then regions are not cut at depth steps
  /// \param detections any range or `none`; their masks must outlive the result. The kMaxObjects with the highest scores count
  /// \param tracks points followed from the previous frame, any range or `none`
  /// \returns valid until the next call
  const std::vector<Detection>& update(const DynamicMask& mask, const AnyImage& depth, const AnyDetections& detections = {},
                                       const AnyTracks& tracks = {}) {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    expects(depth.empty() || (depth.width() == w && depth.height() == h), "ObjectTracker: depth and mask differ in size");
    objects_.clear();
    for (const Detection& d : detections.in(detections_)) {
      expects(d.mask.empty() || (d.mask.width == w && d.mask.height == h), "ObjectTracker: mask of a detection has another size");
      objects_.push_back(d);
    }
    keep_strongest(objects_);
    for (Detection& d : objects_) {
      if (!(d.motion_probability == d.motion_probability)) d.motion_probability = mean_probability(mask, d);
    }
    grid_.sample(w, h, depth, row_);
    prediction_.predict(grid_, mask, tracks.in(tracks_), kObjectDepthGap, known_);
    segmentation_.cut(grid_, mask, prediction_, known_.size(), kMinimumObjectPixels, kObjectDepthGap);
    add_pieces(mask);
    identify();
    unite();
    remember();
    return objects_;
  }

  void reset() {
    known_.clear();
    objects_.clear();
    prediction_.reset();
    next_id_ = 0;
  }

 private:
  // Mean over the known pixels of a detection; NaN where nothing is known.
  [[nodiscard]] static float mean_probability(const DynamicMask& mask, const Detection& d) {
    const PixelRange range = pixels_of(d, mask.probability.width(), mask.probability.height());
    double sum = 0;
    double n = 0;
    for (int y = range.y0; y < range.y1; y += kObjectStep) {
      for (int x = range.x0; x < range.x1; x += kObjectStep) {
        if (mask.known(x, y) == 0 || (!d.mask.empty() && d.mask(x, y) == 0)) continue;
        sum += static_cast<double>(mask.probability(x, y));
        n += 1;
      }
    }
    return n > 0 ? static_cast<float>(clamp01(sum / n)) : std::numeric_limits<float>::quiet_NaN();
  }

  // Pieces that no detection explains become objects, at most kMaxObjects; object_ holds the number of the object of a pixel plus one.
  void add_pieces(const DynamicMask& mask) {
    constexpr double kCovered = 0.7;  // a piece with this share inside a detection belongs to it
    const std::vector<ObjectPiece>& pieces = segmentation_.pieces();
    const Image<int>& piece_of = segmentation_.piece();
    const std::size_t given = objects_.size();
    object_.assign(grid_.width, grid_.height, 0);
    covered_.assign(pieces.size() * given, 0);
    for (int i = 0; i < grid_.size(); ++i) {
      const int piece = piece_of.data()[i];
      for (std::size_t k = 0; k < given; ++k) {
        if (!covers(objects_[k], grid_.x(i), grid_.y(i))) continue;
        if (mask.probability(grid_.x(i), grid_.y(i)) >= 0.5F) object_.data()[i] = static_cast<int>(k) + 1;
        if (objects_[k].movable && piece > 0) ++covered_[(static_cast<std::size_t>(piece) - 1) * given + k];
      }
    }
    object_of_piece_.assign(pieces.size(), 0);
    for (std::size_t p = 0; p < pieces.size() && objects_.size() < given + kMaxObjects; ++p) {
      const ObjectPiece& piece = pieces[p];
      if (piece.pixels * kObjectStep * kObjectStep < kMinimumObjectPixels) continue;
      bool explained = false;
      for (std::size_t k = 0; k < given; ++k) explained = explained || covered_[p * given + k] >= kCovered * piece.pixels;
      if (explained) continue;
      const Box small = piece.box();
      const auto step = static_cast<float>(kObjectStep);
      Detection d;
      d.box = {small.x * step, small.y * step, small.width * step, small.height * step};
      d.score = static_cast<float>(clamp01(piece.sum / piece.pixels));
      d.motion_probability = d.score;
      d.class_id = kUnknownClass;
      objects_.push_back(d);
      object_of_piece_[p] = static_cast<int>(objects_.size());
    }
    for (std::size_t i = 0; i < object_.size(); ++i) {
      const int piece = piece_of.data()[i];
      const int object = piece > 0 ? object_of_piece_[static_cast<std::size_t>(piece) - 1] : 0;
      if (object > 0) object_.data()[i] = object;
    }
  }

  // Objects get the identity of the known one they match, or a new one.
  void identify() {
    matching_.match(grid_, prediction_, objects_, object_, known_, kObjectDepthGap);
    std::vector<int>& match = matching_.match();
    for (KnownObject& k : known_) ++k.missed;
    for (std::size_t o = 0; o < objects_.size(); ++o) {
      Detection& d = objects_[o];
      if (d.track_id >= 0) {
        next_id_ = std::max(next_id_, d.track_id + 1);
        continue;
      }
      const auto z = static_cast<float>(matching_.depth(o));
      if (match[o] < 0) {
        match[o] = static_cast<int>(known_.size());
        KnownObject k;
        k.id = next_id_++;
        k.motion = d.motion_probability;
        k.z = z;
        k.width = d.box.width;
        k.height = d.box.height;
        known_.push_back(k);
      } else {
        learn(d, z, known_[static_cast<std::size_t>(match[o])]);
      }
      KnownObject& k = known_[static_cast<std::size_t>(match[o])];
      d.track_id = k.id;
      k.box = d.box;
      if (d.class_id != kUnknownClass || k.class_id == kUnknownClass) k.class_id = d.class_id;
      k.missed = 0;
    }
    for (KnownObject& k : known_) {
      if (k.missed == 0) continue;
      k.vx *= 0.9F;  // who is hidden may stop meanwhile
      k.vy *= 0.9F;
      k.vz *= 0.9F;
    }
  }

  // Size, velocity and motion of a known object from the one it matches.
  void learn(Detection& d, float z, KnownObject& k) const {
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

  // Two objects found by motion that stay parts of one body become the older one.
  void unite() {
    constexpr int kTogether = 6;                                // for so many frames
    constexpr auto near = static_cast<float>(2 * kObjectStep);  // boxes that are this close touch [px]
    for (std::size_t k = 1; k < known_.size(); ++k) {
      KnownObject& young = known_[k];
      int found = -1;
      std::size_t older = 0;
      for (std::size_t j = 0; j < k && found < 0 && young.missed == 0 && young.class_id == kUnknownClass; ++j) {
        const KnownObject& old = known_[j];
        if (old.missed > 0 || old.class_id != kUnknownClass) continue;
        const bool touch = young.box.y <= old.box.y + old.box.height + near && old.box.y <= young.box.y + young.box.height + near;
        if (!touch || !one_body(young.box, static_cast<double>(young.z), old.box, static_cast<double>(old.z))) continue;
        found = old.id;
        older = j;
      }
      young.together = found >= 0 && found == young.other ? young.together + 1 : found >= 0 ? 1 : 0;
      young.other = found;
      if (young.together < kTogether) continue;
      for (int& m : matching_.match()) {
        if (m == static_cast<int>(k)) m = static_cast<int>(older);
      }
      young.missed = options_.max_missed + 1;  // forgotten below
    }
  }

  // Frames for which an object may have been missed: max_missed, or less where more than kMaxObjects would be known.
  [[nodiscard]] int longest_absence() {
    absences_.clear();
    for (const KnownObject& k : known_) absences_.push_back(k.missed);
    if (absences_.size() <= kMaxObjects) return options_.max_missed;
    const auto first_too_many = absences_.begin() + static_cast<std::ptrdiff_t>(kMaxObjects);
    std::nth_element(absences_.begin(), first_too_many, absences_.end());
    return std::clamp(*first_too_many - 1, 0, options_.max_missed);
  }

  // Labels of the pixels by the place of their object in known_, which loses the ones that were missed too long.
  void remember() {
    place_.assign(known_.size(), -1);
    const int longest = longest_absence();
    std::size_t kept = 0;
    for (std::size_t k = 0; k < known_.size(); ++k) {
      if (known_[k].missed > longest) continue;
      place_[k] = static_cast<int>(kept);
      known_[kept] = known_[k];
      ++kept;
    }
    known_.resize(kept);
    label_.assign(grid_.width, grid_.height, 0);
    const std::vector<int>& match = matching_.match();
    for (std::size_t i = 0; i < object_.size(); ++i) {
      const int o = object_.data()[i] - 1;
      if (o < 0 || match[static_cast<std::size_t>(o)] < 0) continue;
      label_.data()[i] = place_[static_cast<std::size_t>(match[static_cast<std::size_t>(o)])] + 1;
    }
    prediction_.remember(grid_, label_);
  }

  ObjectTrackerOptions options_;
  std::vector<KnownObject> known_;
  std::vector<Detection> objects_;
  int next_id_ = 0;
  ObjectGrid grid_;
  ObjectPrediction prediction_;
  ObjectSegmentation segmentation_;
  ObjectMatching matching_;
  Image<int> object_;  // number in objects_ plus one
  Image<int> label_;   // number in known_ plus one
  std::vector<int> covered_, object_of_piece_, place_, absences_;
  std::vector<float> row_;
  std::vector<Detection> detections_;
  std::vector<PointTrack> tracks_;
};

APSO_NAMESPACE_END
