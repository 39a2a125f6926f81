/// \file
/// Where the pixels of the objects that are known already are in a new frame.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// class_id of an object that was found by its motion alone.
inline constexpr int kUnknownClass = -1;

/// What is known of an object from the frames in which it was seen.
struct KnownObject {
  Box box;  ///< predicted for this frame by ObjectPrediction [px]
  int class_id = kUnknownClass;
  int id = -1;                   ///< identity
  int missed = 0;                ///< frames since it was seen
  float motion = 0;              ///< smoothed motion probability; NaN = not known
  float vx = 0, vy = 0, vz = 0;  ///< velocity [px/frame], [m/frame]
  float dx = 0, dy = 0, dz = 0;  ///< predicted for this frame [px], [m]
  float z = 0;                   ///< mean depth [m], 0 = not known
  float width = 0, height = 0;   ///< of the box when it was seen as a whole [px]
  int other = -1;                ///< identity of an older object of which this may be a part
  int together = 0;              ///< ... for this many frames
};

/// The mask is looked at in steps of this many pixels: an object of the smallest size has some forty of them.
inline constexpr int kObjectStep = 4;

/// Depth on every kObjectStep-th pixel of a frame.
struct ObjectGrid {
  int width = 0;       ///< small pixels
  int height = 0;      ///< small pixels
  Image<float> depth;  ///< [m], 0 = none

  /// \param image of the size of the mask, or empty
  void sample(int mask_width, int mask_height, const AnyImage& image, std::vector<float>& buffer) {
    width = mask_width / kObjectStep;
    height = mask_height / kObjectStep;
    depth.assign(width, height, 0.0F);
    if (image.empty()) return;
    auto read = rows(image, buffer);
    for (int y = 0; y < height; ++y) {
      const float* row = read(y * kObjectStep + kObjectStep / 2);
      for (int x = 0; x < width; ++x) {
        const float z = row[x * kObjectStep + kObjectStep / 2];
        depth(x, y) = z > 0 && z < 1e3F ? z : 0.0F;
      }
    }
  }
  [[nodiscard]] int size() const { return width * height; }
  /// Pixel of the frame in the middle of small pixel i.
  [[nodiscard]] int x(int i) const { return i % width * kObjectStep + kObjectStep / 2; }
  [[nodiscard]] int y(int i) const { return i / width * kObjectStep + kObjectStep / 2; }
  /// Small pixel of a point of the frame; -1 outside.
  [[nodiscard]] int index(float px, float py) const {
    const float u = px / static_cast<float>(kObjectStep);
    const float v = py / static_cast<float>(kObjectStep);
    const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(width) && v < static_cast<float>(height);
    return inside ? static_cast<int>(v) * width + static_cast<int>(u) : -1;
  }
};

/// Predicts known objects by the median flow of the tracks on them, else by their own velocity, and finds the pixels
/// where their depth fits.
class ObjectPrediction {
 public:
  static constexpr std::size_t kMinTracks = 3;  ///< fewer tracks on an object do not tell where it goes

  /// \param depth_gap depths that differ by more are different surfaces [m]
  /// \param known moves to the prediction
  void predict(const ObjectGrid& grid, const DynamicMask& mask, const std::vector<PointTrack>& tracks, double depth_gap,
               std::vector<KnownObject>& known) {
    const auto gap = static_cast<float>(depth_gap);
    const bool has_labels = label_.width() == grid.width && label_.height() == grid.height;
    seed_.assign(grid.width, grid.height, 0);
    fit_.assign(grid.width, grid.height, std::numeric_limits<float>::infinity());
    move(grid, tracks, has_labels, known);
    if (has_labels) place_seen(grid, gap, known);
    place_hidden(grid, mask, gap, known);
    count_.assign(known.size(), 0);
    for (int i = 0; i < grid.size(); ++i) {
      if (seed_.data()[i] > 0) ++count_[static_cast<std::size_t>(seed_.data()[i]) - 1];
    }
  }
  /// The number of the known object at a small pixel plus one, 0 = none.
  [[nodiscard]] const Image<int>& seed() const { return seed_; }
  /// Small pixels of each known object.
  [[nodiscard]] const std::vector<int>& count() const { return count_; }

  /// Takes in what was found in the frame. \param label number of the known object of a small pixel plus one
  void remember(ObjectGrid& grid, Image<int>& label) {
    std::swap(label_, label);
    std::swap(label_depth_, grid.depth);
  }
  void reset() { label_.resize(0, 0); }

 private:
  void move(const ObjectGrid& grid, const std::vector<PointTrack>& tracks, bool has_labels, std::vector<KnownObject>& known) {
    for (std::size_t k = 0; k < known.size(); ++k) {
      KnownObject& object = known[k];
      du_.clear();
      dv_.clear();
      for (const PointTrack& t : tracks) {
        const int from = has_labels && object.missed == 0 && t.age >= 1 ? grid.index(t.previous_x, t.previous_y) : -1;
        if (from < 0 || label_.data()[from] != static_cast<int>(k) + 1) continue;
        du_.push_back(t.x - t.previous_x);
        dv_.push_back(t.y - t.previous_y);
      }
      const bool told = du_.size() >= kMinTracks;
      object.dx = told ? upper_median(du_) : object.vx;
      object.dy = told ? upper_median(dv_) : object.vy;
      object.dz = object.vz;
      object.box.x += object.dx;
      object.box.y += object.dy;
      if (object.z > 0) object.z += object.dz;
    }
  }

  void place_seen(const ObjectGrid& grid, float gap, const std::vector<KnownObject>& known) {
    for (int i = 0; i < grid.size(); ++i) {
      const int k = label_.data()[i] - 1;
      if (k < 0 || known[static_cast<std::size_t>(k)].missed > 0) continue;
      const KnownObject& object = known[static_cast<std::size_t>(k)];
      const auto step = static_cast<float>(kObjectStep);
      const int row = i / grid.width;
      const int to =
          grid.index((static_cast<float>(i % grid.width) + 0.5F) * step + object.dx, (static_cast<float>(row) + 0.5F) * step + object.dy);
      if (to < 0) continue;
      const float before = label_depth_.data()[i];
      const float now = grid.depth.data()[to];
      const float off = before > 0 && now > 0 ? std::abs(now - before - object.dz) : 0.1F;
      if (off > 0.4F * gap || off >= fit_.data()[to]) continue;
      fit_.data()[to] = off;  // where two objects meet, the one whose depth fits better
      seed_.data()[to] = k + 1;
    }
  }

  // Who was hidden lately is expected anywhere in a box of its full size, where nobody who was seen fits.
  void place_hidden(const ObjectGrid& grid, const DynamicMask& mask, float gap, const std::vector<KnownObject>& known) {
    for (std::size_t k = 0; k < known.size(); ++k) {
      const KnownObject& object = known[k];
      if (object.missed == 0 || !(object.z > 0)) continue;
      // what was seen last may have been either end of it
      const float left = object.box.x + object.box.width - 1.25F * object.width;
      const float right = object.box.x + 1.25F * object.width;
      const float top = object.box.y + object.box.height - 1.25F * object.height;
      const float bottom = object.box.y + 1.25F * object.height;
      for (int i = 0; i < grid.size(); ++i) {
        const auto x = static_cast<float>(grid.x(i));
        const auto y = static_cast<float>(grid.y(i));
        if (!(x >= left && y >= top && x < right && y < bottom) || !(mask.probability(grid.x(i), grid.y(i)) >= 0.5F)) continue;
        const float off = std::abs(grid.depth.data()[i] - object.z) + 0.25F * gap;
        if (off > gap || off >= fit_.data()[i]) continue;
        fit_.data()[i] = off;
        seed_.data()[i] = static_cast<int>(k) + 1;
      }
    }
  }

  Image<float> label_depth_;  // of the last frame
  Image<int> label_;          // of the last frame: number of the known object plus one
  Image<int> seed_;           // predicted for this frame, likewise
  Image<float> fit_;          // difference of depth that the seed has [m]
  std::vector<int> count_;
  std::vector<float> du_, dv_;
};

APSO_NAMESPACE_END
