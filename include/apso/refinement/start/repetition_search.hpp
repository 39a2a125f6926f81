/// \file
/// Shifts after which the images would look the same: a checkerboard, a facade of equal windows, tiles.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// A pose that may explain the images as well as the one that was found.
struct Repetition {
  Pose T_camera_world = identity_pose();
  int level = 0;       ///< at which the pattern is resolved
  float likeness = 0;  ///< correlation of detail, as a share of that at the pose that was found, a little less for larger shifts
};

/// Searches the shifts along the plane that fits the view for which the detail of the reference is found in the current image once more.
/// A pattern that repeats every 5 to 10 pixels of some level is found at that level, so few shifts are tried at each, larger ones only at
/// the smallest. Detail is what sets an image off from one a quarter of its size; the hundred pixels that have most of it are compared,
/// and most shifts are given up after a sixth of them (sequential similarity detection, Barnea and Silverman, IEEE Trans. Computers
/// 1972). In rooms nothing is found. Deterministic; allocates nothing.
class RepetitionSearch {
 public:
  static constexpr std::size_t kMost = 6;
  struct Found {
    std::array<Repetition, kMost> best;
    std::size_t count = 0;
  };

  /// \param cost with the frames of the alignment; the first reference is searched
  /// \param T_camera_world the pose that was found
  /// \return what looks alike, the best first
  [[nodiscard]] Found operator()(const AlignmentCost& cost, const Pose& T_camera_world, const ExecutorRef& executor) {
    Found found;
    const Pose T = compose(T_camera_world, cost.first_T_world_reference());
    for (int level = 0; level < cost.levels(); ++level) {
      const int width = cost.current(level).camera.width;
      if (width > FramePyramid::kCornerWidth || width < kSmallest || level + 1 >= cost.levels()) continue;
      const int coarser = std::min(level + 2, cost.levels() - 1);
      if (!take(cost.first_reference().halved(cost.halvings(level)), cost.first_reference().halved(cost.halvings(coarser)), coarser - level,
                cost.current(level), cost.current(coarser), T)) {
        continue;
      }
      const bool last = cost.current(level + 1).camera.width < kSmallest;
      const int across = last ? std::min(kColumns / 2, width / 2) : kRadius;
      search(across, last ? std::min(kRows - 1, cost.current(level).camera.height / 2) : kRadius, level, T_camera_world, found, executor);
    }
    return found;
  }

 private:
  static constexpr int kSmallest = 32;             // narrowest image that is searched [px]
  static constexpr int kRadius = 10;               // of the shifts at each level [px]
  static constexpr int kRows = 21, kColumns = 41;  // of the map of likeness: half of a plane of shifts
  static constexpr int kShares = 4;                // units of work
  static constexpr std::size_t kOfTile = 8;        // least number of pixels of a tile that are looked at, if it has so many
  static constexpr int kSamples = 96, kAtOnce = 16;
  static constexpr int kEnough = 24;               // samples that both images must show
  static constexpr float kHopeless = 0.3F;         // correlation of those seen so far below which a shift is given up
  static constexpr float kValley = 0.85F;          // highest likeness half way to a repetition, as a share of its own
  static constexpr float kFar = 0.3F;              // off the likeness of a shift by the width of the image: it leaves less to compare
  static constexpr float kAlike = 0.6F;            // share of the correlation of the pose that was found
  static constexpr float kDepthTolerance = 0.05F;  // relative difference of depths that are those of one surface

  struct Sample {
    float detail, x, y, z;
  };

  // Pixels of some tiles, in lanes.
  struct Candidates {
    static constexpr std::size_t kMostOfTile = 2 * kOfTile, kRoom = 8 * kMostOfTile;
    alignas(64) float intensity[kRoom] = {}, x[kRoom] = {}, y[kRoom] = {}, z[kRoom] = {}, detail[kRoom];
    std::array<std::size_t, kRoom> ends;  // of each tile
    std::size_t count = 0, tiles = 0;

    void add(float i, float X, float Y, float Z) {
      intensity[count] = i;
      x[count] = X;
      y[count] = Y;
      z[count++] = Z;
    }
    void end_tile() { ends[tiles++] = count; }
    [[nodiscard]] bool full() const { return count + kMostOfTile > kRoom || tiles == ends.size(); }
  };

  // Intensity, and the nearest depth.
  template <int n>
  static APSO_INLINE BasicLanes<n> look_up(const PyramidLevel& image, const BasicLanes<n>& u, const BasicLanes<n>& v, BasicLanes<n>& Z) {
    using L = BasicLanes<n>;
    const float* texture = image.texture.data();
    const int width = image.intensity.width();
    const L x = to_float(to_int(u));
    const L y = to_float(to_int(v));
    const L a = u - x;
    const L b = v - y;
    const BasicIntLanes<n> offset = to_int(y * L(static_cast<float>(2 * width)) + (x + x));
    const BasicQuad<n> p = load_quads(texture, offset);
    const BasicQuad<n> q = load_quads(texture + 2 * width, offset);
    const BasicIntLanes<n> left = a < L(0.5F);
    Z = select(b < L(0.5F), select(left, p.c[1], p.c[3]), select(left, q.c[1], q.c[3]));
    const L upper = p.c[0] + a * (p.c[2] - p.c[0]);
    const L lower = q.c[0] + a * (q.c[2] - q.c[0]);
    return upper + b * (lower - upper);
  }
  // The same of the smaller image of the reference, at a place of the larger one.
  template <int n>
  [[nodiscard]] APSO_INLINE BasicLanes<n> smaller(const Plane& image, const BasicLanes<n>& u, const BasicLanes<n>& v) const {
    using L = BasicLanes<n>;
    const L x = within(shrink_ * (u + 0.5F) - 0.5F, image.width());
    const L y = within(shrink_ * (v + 0.5F) - 0.5F, image.height());
    const L left = to_float(to_int(x)), top = to_float(to_int(y));
    const L a = x - left, b = y - top;
    const auto row = static_cast<int>(image.row(1) - image.row(0));
    const BasicIntLanes<n> offset = to_int(top * L(static_cast<float>(row)) + left);
    const BasicQuad<n> p = load_quads(image.row(0), offset);  // two of the four are used
    const BasicQuad<n> q = load_quads(image.row(1), offset);
    const L upper = p.c[0] + a * (p.c[1] - p.c[0]);
    const L lower = q.c[0] + a * (q.c[1] - q.c[0]);
    return upper + b * (lower - upper);
  }
  // A place that can be interpolated at, in an image of so many pixels across.
  template <int n>
  static APSO_INLINE BasicLanes<n> within(const BasicLanes<n>& place, int pixels) {
    using L = BasicLanes<n>;
    return min(max(place, L(0.0F)), L(static_cast<float>(pixels) - 1.001F));
  }

  // Appends the candidate of each tile with most detail to the n samples; returns how many there are then.
  std::size_t best_of_tiles(Candidates& c, const PyramidLevel& reference, const Plane& coarser, std::size_t n) {
    const Pinhole& camera = reference.camera;
    in_widest_lanes([&](auto lanes) {
      using L = BasicLanes<lanes>;
      constexpr std::size_t kStep = lanes;
      const L fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
      const L cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
      for (std::size_t i = 0; i < c.count; i += kStep) {
        const L Z = L::load(c.z + i);
        const L iz = 1.0F / select(Z > L(0.0F), Z, 1.0F);
        const L u = fx * L::load(c.x + i) * iz + cx;
        const L v = fy * L::load(c.y + i) * iz + cy;
        (L::load(c.intensity + i) - smaller(coarser, u, v)).store(c.detail + i);
      }
    });
    std::size_t i = 0;
    for (std::size_t tile = 0; tile < c.tiles && n < all_.size(); ++tile) {
      std::size_t best = i;
      for (; i < c.ends[tile]; ++i) {
        if (std::abs(c.detail[i]) > std::abs(c.detail[best])) best = i;
      }
      if (best < c.ends[tile] && std::abs(c.detail[best]) > kLeastDetail) all_[n++] = {c.detail[best], c.x[best], c.y[best], c.z[best]};
    }
    c.count = c.tiles = 0;
    return n;
  }

  // The pixels of the reference with most detail, one of a tile, as they lie in the current camera, and the plane that fits them.
  // False where there is no texture.
  bool take(const PyramidLevel& reference, const PyramidLevel& reference_coarser, int halvings, const PyramidLevel& current,
            const PyramidLevel& current_coarser, const Pose& T) {
    const PixelList& list = reference.pixels;
    if (reference_coarser.intensity.empty() || list.count == 0) return false;
    current_ = &current;
    coarser_ = &current_coarser;
    shrink_ = 1.0F / static_cast<float>(1 << halvings);
    std::size_t n = 0;
    Candidates candidates;
    for (const PixelList::Tile& tile : list.tiles) {
      const int step = std::max(1, tile.count / static_cast<int>(kOfTile));
      for (int k = step / 2; k < tile.count; k += step) {
        const auto at = [&](PixelList::Field f) { return list.at(tile.begin + k / PixelList::kBlock, f, k % PixelList::kBlock); };
        if (!(at(PixelList::kGamma) > 0) || at(PixelList::kGradient2) < 0) continue;
        candidates.add(at(PixelList::kIntensity), at(PixelList::kX), at(PixelList::kY), at(PixelList::kZ));
      }
      candidates.end_tile();
      if (candidates.full()) n = best_of_tiles(candidates, reference, reference_coarser.intensity, n);
    }
    n = best_of_tiles(candidates, reference, reference_coarser.intensity, n);
    if (n < kEnough) return false;
    const std::size_t used = std::min<std::size_t>(n, kSamples);
    std::partial_sort(all_.begin(), all_.begin() + static_cast<std::ptrdiff_t>(used), all_.begin() + static_cast<std::ptrdiff_t>(n),
                      [](const Sample& a, const Sample& b) { return std::abs(a.detail) > std::abs(b.detail); });
    for (std::size_t i = 0; i < kSamples; ++i) {
      const Sample s = i < used ? all_[i] : Sample{};
      const Eigen::Vector3d Y = transform(T, {static_cast<double>(s.x), static_cast<double>(s.y), static_cast<double>(s.z)});
      detail_[i] = s.detail;  // 0 = none
      for (int c = 0; c < 3; ++c) Y_[c][i] = static_cast<float>(Y(c));
    }
    return fit_plane();
  }

  // The plane n Y = 1 of most samples: 1/Z is linear in the image.
  bool fit_plane() {
    normal_ = Eigen::Vector3d(0, 0, 0);
    for (int round = 0; round < 3; ++round) {
      Eigen::Matrix3d H = zeros<Eigen::Matrix3d>();
      Eigen::Vector3d b(0, 0, 0);
      for (std::size_t i = 0; i < kSamples; ++i) {
        if (!(std::abs(detail_[i]) > 0) || !(Y_[2][i] > kNear)) continue;
        const auto z = static_cast<double>(Y_[2][i]);
        const Eigen::Vector3d ray(static_cast<double>(Y_[0][i]) / z, static_cast<double>(Y_[1][i]) / z, 1);
        if (round > 0 && !(std::abs(dot(normal_, ray) * z - 1) < 0.1)) continue;
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) H(r, c) += ray(r) * ray(c);
          b(r) += ray(r) / z;
        }
      }
      if (!(H(2, 2) >= kEnough)) return false;
      for (int i = 0; i < 3; ++i) H(i, i) += 1e-6 * H(2, 2);
      normal_ = solve_symmetric(H, b);
    }
    return all_finite(normal_) && normal_(2) > 0;
  }

  // Shift [m] along the plane that moves the middle of the image by so many pixels.
  [[nodiscard]] Eigen::Vector3d shift(double du, double dv) const {
    const double tx = du / (normal_(2) * current_->camera.fx);
    const double ty = dv / (normal_(2) * current_->camera.fy);
    return {tx, ty, -(normal_(0) * tx + normal_(1) * ty) / normal_(2)};
  }

  void search(int across, int down, int level, const Pose& T_camera_world, Found& found, const ExecutorRef& executor) {
    const float own = likeness(shift(0, 0));
    if (!(own > kHopeless)) return;
    executor(kShares, [&](int share) {
      for (int v = share; v <= down; v += kShares) {
        for (int u = -across; u <= across; ++u) map_[v][u + kColumns / 2] = v == 0 && u < 0 ? 0.0F : likeness(shift(u, v));
      }
    });
    const auto at = [&](int u, int v) {  // a pattern repeats to both sides alike
      if (v < 0 || (v == 0 && u < 0)) u = -u, v = -v;
      return std::abs(u) <= across && v <= down ? map_[v][u + kColumns / 2] : 0.0F;
    };
    for (int v = 0; v <= down; ++v) {
      for (int u = v == 0 ? 1 : -across; u <= across; ++u) {
        const float here = at(u, v);
        // nearer ones are the same pose, and so are those that look alike all the way from it
        if (!(here > kAlike * own) || u * u + v * v < 9 || at(u / 2, v / 2) > kValley * here) continue;
        bool highest = true;
        for (int dv = -1; dv <= 1; ++dv) {
          for (int du = -1; du <= 1; ++du) highest = highest && at(u + du, v + dv) <= here;
        }
        if (!highest) continue;
        const Eigen::Vector3d t = shift(u, v);
        const Pose moved = compose(make_pose(identity<Eigen::Matrix3d>(), t), T_camera_world);
        const auto length = static_cast<float>(std::sqrt(u * u + v * v) / current_->camera.width);
        insert({moved, level, here / own - kFar * length}, found);
      }
    }
  }
  static void insert(const Repetition& r, Found& found) {
    std::size_t i = found.count < kMost ? found.count++ : kMost;
    for (; i > 0 && found.best[i - 1].likeness < r.likeness; --i) {
      if (i < kMost) found.best[i] = found.best[i - 1];
    }
    if (i < kMost) found.best[i] = r;
  }

  // Correlation of the detail of both images after a shift, of the samples that both show; 0 where it is hopeless.
  [[nodiscard]] float likeness(const Eigen::Vector3d& t) const {
    return in_widest_lanes([&](auto lanes) -> float {
      using L = BasicLanes<lanes>;
      constexpr std::size_t kStep = lanes;
      const L tx = static_cast<float>(t(0)), ty = static_cast<float>(t(1)), tz = static_cast<float>(t(2));
      const Pinhole& camera = current_->camera;
      const L fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
      const L cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
      const L u_max = static_cast<float>(camera.width - 2), v_max = static_cast<float>(camera.height - 2);
      const L zero = 0.0F;
      Lanes ab = 0.0F, aa = 0.0F, bb = 0.0F, n = 0.0F;
      for (std::size_t i = 0; i < kSamples; i += kStep) {
        const L a = L::load(detail_ + i);
        const L z = L::load(Y_[2] + i) + tz;
        const auto ahead = z > L(kNear);
        const L iz = 1.0F / select(ahead, z, 1.0F);
        L u = fx * (L::load(Y_[0] + i) + tx) * iz + cx;
        L v = fy * (L::load(Y_[1] + i) + ty) * iz + cy;
        const auto inside = ahead & (u >= L(1.0F)) & (v >= L(1.0F)) & (u <= u_max) & (v <= v_max) & (abs(a) > zero);
        u = select(inside, u, 1.0F);
        v = select(inside, v, 1.0F);
        L Z;
        const L fine = look_up(*current_, u, v, Z);
        L unused;
        const L b = fine - look_up(*coarser_, within(shrink_ * (u + 0.5F) - 0.5F, coarser_->camera.width),
                                   within(shrink_ * (v + 0.5F) - 0.5F, coarser_->camera.height), unused);
        const auto same = inside & ((Z <= zero) | (abs(Z - z) < kDepthTolerance * z));
        add(ab, select(same, a * b, 0.0F));
        add(aa, select(inside, a * a, 0.0F));
        add(bb, select(inside, b * b, 0.0F));
        add(n, select(inside, L(1.0F), 0.0F));
        if ((i + kStep) % kAtOnce == 0 && !correlates(ab.sum(), aa.sum(), bb.sum(), kHopeless)) return 0;
      }
      if (!(n.sum() >= kEnough)) return 0;
      return ab.sum() / std::sqrt(aa.sum() * bb.sum());
    });
  }
  static bool correlates(float ab, float aa, float bb, float least) { return ab > 0 && ab * ab > least * least * aa * bb; }

  static constexpr float kNear = 0.1F;          // samples nearer than this are out of view [m]
  static constexpr float kLeastDetail = 0.01F;  // 2.5 grey values of 255: less is noise

  std::array<Sample, 512> all_{};
  alignas(64) float detail_[kSamples] = {};
  alignas(64) float Y_[3][kSamples] = {};
  float map_[kRows][kColumns] = {};
  const PyramidLevel* current_ = nullptr;
  const PyramidLevel* coarser_ = nullptr;
  float shrink_ = 1;
  Eigen::Vector3d normal_ = Eigen::Vector3d(0, 0, 0);
};

APSO_NAMESPACE_END
