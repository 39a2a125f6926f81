/// \file
/// S_mc, the motion residual: a score of equation (7), from points followed since the reference.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/statistics.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/scores/camera_flow.hpp>
#include <apso/quality/scores/change_scale.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct MotionChangeOptions {
  FlowKind flow = FlowKind::Raw;
  double scale = 0.12;           ///< s_m against the benchmark frame [image diagonals]; found by apso_calibrate
  double scale_previous = 0.04;  ///< s_m against the previous frame [image diagonals]; found by apso_calibrate
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("flow", s.flow);
    v("scale", s.scale, 1e-6, 10.0);
    v("scale_previous", s.scale_previous, 1e-6, 10.0);
  }
};

/// Share of the flows that the mean drops at each end.
inline constexpr double kFlowTrim = 0.10;
/// Share of the reference's points, still followed, that counts as all of them.
inline constexpr double kFullTrackOverlap = 0.5;
/// Cells of the reference frame over which the median flow is taken: 80 px at 640x480.
inline constexpr int kFlowGridX = 8;
inline constexpr int kFlowGridY = 6;
/// Tracks that a cell must have to count ("valid grids").
inline constexpr int kMinimumTracksPerCell = 3;

/// What S_mc is made of.
struct MotionMeasure {
  double m_point = 0;  ///< trimmed mean of the flow [image diagonals]
  double m_grid = 0;   ///< mean over the valid cells of the median flow [image diagonals]
  double overlap = 0;  ///< rho_t, [0,1]
  int tracks = 0;      ///< correspondences used
  int cells = 0;       ///< valid cells
  Deviation score{1.0};
};

/// S_mc of the measured numbers: 1 - rho_t exp(-(m_point + m_grid) / 2 / s_m).
[[nodiscard]] inline Deviation motion_deviation(double m_point, double m_grid, double overlap, double scale) {
  return Deviation(1.0 - overlap * std::exp(-0.5 * (m_point + m_grid) / scale));
}

/// Working memory of motion_change.
struct MotionScratch {
  std::vector<double> flows;
  std::vector<double> sorted;
  std::vector<double> cell_flows;
  std::vector<int> cell;
  std::vector<int> first;
  std::vector<PlanarFlow> camera;
};

/// S_mc.
/// Cells are those of the reference frame. Correspondences that are not finite are dropped; none left gives 1.
/// \param reference_points how many points the reference had
/// \param scale            s_m [image diagonals]
/// \param predicted        the camera's own flow at each correspondence, for FlowKind::PosePredicted; the other kinds find it here
[[nodiscard]] inline MotionMeasure motion_change(const std::vector<Correspondence>& matches, int reference_points, int width, int height,
                                                 const MotionChangeOptions& options, double scale, MotionScratch& scratch,
                                                 const std::vector<PlanarFlow>* predicted = nullptr) {
  expects(width > 0 && height > 0 && scale > 0, "motion_change: empty image or scale <= 0");
  MotionMeasure r;
  const double diagonal = std::sqrt(static_cast<double>(width) * width + static_cast<double>(height) * height);
  constexpr int cells = kFlowGridX * kFlowGridY;
  scratch.flows.clear();
  scratch.cell.clear();
  scratch.first.assign(static_cast<std::size_t>(cells) + 1, 0);
  if (predicted == nullptr) camera_flow(options.flow, matches, width, height, scratch.camera);
  const std::vector<PlanarFlow>& own = predicted != nullptr ? *predicted : scratch.camera;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Correspondence& m = matches[i];
    const double u = static_cast<double>(m.reference_x);
    const double v = static_cast<double>(m.reference_y);
    const double dx = static_cast<double>(m.x) - u - own[i].x;
    const double dy = static_cast<double>(m.y) - v - own[i].y;
    const double flow = std::sqrt(dx * dx + dy * dy) / diagonal;
    if (!std::isfinite(flow)) continue;
    const double gx = std::clamp(u * kFlowGridX / width, 0.0, kFlowGridX - 1.0);
    const double gy = std::clamp(v * kFlowGridY / height, 0.0, kFlowGridY - 1.0);
    const int g = static_cast<int>(gy) * kFlowGridX + static_cast<int>(gx);
    scratch.flows.push_back(flow);
    scratch.cell.push_back(g);
    ++scratch.first[static_cast<std::size_t>(g) + 1];
  }
  r.tracks = static_cast<int>(scratch.flows.size());
  if (r.tracks == 0) return r;
  r.overlap = std::min(1.0, r.tracks / std::max(1.0, kFullTrackOverlap * reference_points));

  scratch.sorted = scratch.flows;
  const auto cut = static_cast<std::ptrdiff_t>(kFlowTrim * r.tracks);
  const auto low = scratch.sorted.begin() + cut;
  const auto high = scratch.sorted.end() - cut;
  std::sort(scratch.sorted.begin(), scratch.sorted.end());
  double sum = 0;
  for (auto i = low; i != high; ++i) sum += *i;
  r.m_point = sum / static_cast<double>(high - low);

  // flows in the order of their cells (counting sort), then the median of each valid cell
  for (std::size_t g = 0; g < static_cast<std::size_t>(cells); ++g) scratch.first[g + 1] += scratch.first[g];
  scratch.cell_flows.resize(scratch.flows.size());
  for (std::size_t i = scratch.flows.size(); i-- > 0;) {
    const auto slot = --scratch.first[static_cast<std::size_t>(scratch.cell[i]) + 1];
    scratch.cell_flows[static_cast<std::size_t>(slot)] = scratch.flows[i];
  }
  // first[g + 1] is now where cell g begins
  double medians = 0;
  for (int g = 0; g < cells; ++g) {
    const int begin = scratch.first[static_cast<std::size_t>(g) + 1];
    const int end = g + 1 < cells ? scratch.first[static_cast<std::size_t>(g) + 2] : r.tracks;
    if (end - begin < kMinimumTracksPerCell) continue;
    scratch.sorted.assign(scratch.cell_flows.begin() + begin, scratch.cell_flows.begin() + end);
    medians += median_in_place(scratch.sorted);
    ++r.cells;
  }
  r.m_grid = r.cells > 0 ? medians / r.cells : r.m_point;
  r.score = motion_deviation(r.m_point, r.m_grid, r.overlap, scale);
  return r;
}

/// S_mc as a score of a list. Remembers the static points of a frame, with their depth if FlowKind::PosePredicted asks for it.
struct MotionChange {
  static constexpr const char* name = "S_mc";
  static constexpr const char* options_name = "motion_change";
  static constexpr const char* weight_name = "motion";
  static constexpr double default_weight = 0.50;
  using Value = Deviation;
  using Options = MotionChangeOptions;
  struct Measured {
    double flow = 0;           ///< mean of m_point and m_grid [image diagonals]
    double overlap = 0;        ///< rho_t, [0,1]
    int tracks = 0;            ///< points followed since the other frame
    int reference_points = 0;  ///< points the other frame had
    template <class Self, class V>
    static void columns(Self& m, V&& column) {
      column("flow", m.flow);
      column("track_overlap", m.overlap);
    }
  };
  struct Memory {
    struct Point {
      std::int64_t id;
      float x;      ///< [px]
      float y;      ///< [px]
      float depth;  ///< [m]; 0 = not known
    };
    std::vector<Point> points;  ///< static tracks, by rising id
    Pose T_world_camera = identity_pose();
    bool has_pose = false;
    bool present = false;  ///< tracks were given (there may be none)
  };
  Options options;
  Measured measured;

  void remember(const FrameContext& frame, Memory& memory) const {
    memory.present = frame.tracks != nullptr;
    memory.points.clear();
    if (!memory.present) return;
    const bool by_pose = options.flow == FlowKind::PosePredicted;
    memory.has_pose = by_pose && frame.T_world_camera != nullptr && is_finite(*frame.T_world_camera);
    if (memory.has_pose) memory.T_world_camera = *frame.T_world_camera;
    for (const PointTrack& t : *frame.tracks) {
      if (!frame.is_static(t.x, t.y)) continue;
      float z = 0;
      if (by_pose && !frame.depth.empty()) z = frame.depth.at(static_cast<int>(std::lround(t.x)), static_cast<int>(std::lround(t.y)));
      memory.points.push_back({t.id, t.x, t.y, depth_valid(z, frame.depth_range) ? z : 0.0F});
    }
    const auto by_id = [](const Memory::Point& l, const Memory::Point& r) { return l.id < r.id; };
    if (!std::is_sorted(memory.points.begin(), memory.points.end(), by_id)) {
      std::sort(memory.points.begin(), memory.points.end(), by_id);
    }
  }

  MaybeDeviation operator()(const ChangeContext<Memory>& frames) {
    measured = {};
    const Memory& r = frames.reference;
    const Memory& c = frames.current;
    if (!r.present || !c.present) return std::nullopt;
    const bool by_pose = options.flow == FlowKind::PosePredicted;
    if (by_pose && !(r.has_pose && c.has_pose)) return std::nullopt;
    const Pose T_current_reference = by_pose ? compose(inverse(c.T_world_camera), r.T_world_camera) : identity_pose();
    matches_.clear();
    predicted_.clear();
    auto from = r.points.begin();
    for (const Memory::Point& p : c.points) {
      while (from != r.points.end() && from->id < p.id) ++from;
      if (from == r.points.end()) break;
      if (from->id != p.id) continue;
      matches_.push_back({from->x, from->y, p.x, p.y});
      if (by_pose) {
        predicted_.push_back(flow_of_poses(T_current_reference, frames.camera, static_cast<double>(from->x), static_cast<double>(from->y),
                                           static_cast<double>(from->depth)));
      }
    }
    const double scale = frames.baseline == ChangeBaseline::Reference ? options.scale : options.scale_previous;
    const auto usable = [by_pose](const Memory::Point& p) { return !by_pose || p.depth > 0; };
    const auto points = static_cast<int>(std::count_if(r.points.begin(), r.points.end(), usable));
    const MotionMeasure m = motion_change(matches_, points, frames.camera.width, frames.camera.height, options, scale, scratch_,
                                          by_pose ? &predicted_ : nullptr);
    measured = {0.5 * (m.m_point + m.m_grid), m.overlap, m.tracks, points};
    return m.score;
  }
  static std::string reason(Deviation, const Measured& m) {
    if (m.reference_points == 0) return {};
    return std::to_string(std::lround(100.0 * m.tracks / m.reference_points)) + " % of the reference's " +
           std::to_string(m.reference_points) + " points tracked";
  }
  /// Share of the other frame that is still in sight; few of it for several frames make a reference stale.
  static double visible_share(const Measured& m) { return m.overlap; }
  /// The score that other options would have given against the reference.
  static Deviation revalue(const Measured& m, const Options& o) { return motion_deviation(m.flow, m.flow, m.overlap, o.scale); }
  /// Finds the scales on calm frames.
  static void calibrate(const std::vector<Measured>& reference, const std::vector<Measured>& previous, Options& o) {
    adopt_change_scale(reference, &Measured::flow, o.scale);
    adopt_change_scale(previous, &Measured::flow, o.scale_previous);
  }

 private:
  std::vector<Correspondence> matches_;
  std::vector<PlanarFlow> predicted_;
  MotionScratch scratch_;
};

APSO_NAMESPACE_END
