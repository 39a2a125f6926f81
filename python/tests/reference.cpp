// Writes synthetic RGB-D frames for the Python tests, and what the C++ library makes of them, number by number in hexadecimal.
//   apso_python_reference FOLDER
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include <apso/align.hpp>
#include <apso/blend.hpp>
#include <apso/evaluate.hpp>
#include <apso/score.hpp>
#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

namespace {

constexpr float kUnit = 1 / 5000.F;

class Output {
 public:
  explicit Output(std::string folder) : folder_(std::move(folder)), results_(folder_ + "/results.txt") {}
  template <class T>
  void array(const std::string& name, const std::vector<T>& values) const {
    std::ofstream file(folder_ + "/" + name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
    if (!file) ok_ = false;
  }
  void number(const std::string& name, double value) {
    char text[64];
    std::snprintf(text, sizeof text, "%a", value);
    results_ << name << ' ' << text << '\n';
  }
  void text(const std::string& name, const std::string& value) { results_ << name << ' ' << value << '\n'; }
  template <class Matrix>
  void matrix(const std::string& name, const Matrix& m) {
    for (int i = 0; i < m.rows(); ++i) {
      for (int j = 0; j < m.cols(); ++j) number(name + "[" + std::to_string(i) + "," + std::to_string(j) + "]", m(i, j));
    }
  }
  [[nodiscard]] bool ok() {
    results_.close();
    return ok_ && results_.good();
  }

 private:
  std::string folder_;
  std::ofstream results_;
  mutable bool ok_ = true;
};

/// A frame as files have it: 8-bit grey and 16-bit depth.
struct Stored {
  apso::testing::SyntheticFrame image;
  std::vector<std::uint8_t> grey;
  std::vector<std::uint16_t> depth;
  apso::ImageView<const std::uint8_t> I;
  apso::ImageView<const std::uint16_t> D;
  Stored(const apso::testing::SyntheticSequence& room, int i) {
    room.render(i, image);
    const int width = room.camera().width;
    const int height = room.camera().height;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        grey.push_back(static_cast<std::uint8_t>(std::lround(255 * std::fmin(1.F, std::fmax(0.F, image.intensity(x, y))))));
        const float z = image.depth(x, y);
        depth.push_back(z > 0 && z < 13 ? static_cast<std::uint16_t>(std::lround(z / kUnit)) : std::uint16_t{0});
      }
    }
    I = {grey.data(), width, height, width};
    D = {depth.data(), width, height, width};
  }
};

void assessment(Output& out, const std::string& name, const apso::Assessment& a) {
  out.text(name + ".state", to_string(a.state));
  out.number(name + ".S_total", a.S_total.value());
  apso::for_each_score(a, [&](const char* score, const std::optional<double>& v, double, apso::Better) {
    if (v) out.number(name + "." + score, *v);
  });
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  Output out(argv[1]);
  const apso::testing::SyntheticSequence room("walking_xyz");
  const apso::Pinhole camera = room.camera();
  out.array<double>("camera.f64",
                    {camera.fx, camera.fy, camera.cx, camera.cy, static_cast<double>(camera.width), static_cast<double>(camera.height)});

  constexpr int frames = 12;
  apso::LandmarkTracker tracker(camera);
  apso::Pipeline pipeline(camera);
  apso::testing::SyntheticFeatures found(camera);
  std::vector<Stored> stored;
  apso::Trajectory truth;
  apso::Trajectory estimate;
  stored.reserve(frames);
  for (int i = 0; i < frames; ++i) {
    stored.emplace_back(room, i);
    const Stored& s = stored.back();
    found.find(s.image);
    const std::string n = std::to_string(i);
    out.array("grey" + n + ".u8", s.grey);
    out.array("depth" + n + ".u16", s.depth);
    std::vector<double> keypoints;
    std::vector<double> tracks;
    std::vector<std::uint8_t> descriptors;
    for (const apso::Keypoint& k : found.keypoints()) {
      const double row[] = {k.x, k.y, k.response, k.angle, static_cast<double>(k.octave)};
      keypoints.insert(keypoints.end(), row, row + 5);
    }
    for (const apso::PointTrack& t : found.tracks()) {
      const double row[] = {static_cast<double>(t.id), t.x, t.y, t.previous_x, t.previous_y, static_cast<double>(t.age)};
      tracks.insert(tracks.end(), row, row + 6);
    }
    for (const auto& d : found.descriptors()) descriptors.insert(descriptors.end(), d.begin(), d.end());
    out.array("keypoints" + n + ".f64", keypoints);
    out.array("tracks" + n + ".f64", tracks);
    out.array("descriptors" + n + ".u8", descriptors);

    const auto now = apso::frame(s.image.timestamp, s.I, apso::scaled(s.D, kUnit), camera);
    tracker.begin(now, found.keypoints(), found.descriptors(), found.tracks());
    const auto prior = tracker.estimate(pipeline.observation().mask.probability);
    const auto& seen = pipeline.observe(now, prior.T_world_camera, found.tracks());
    const auto pose = tracker.estimate(seen.mask.probability);
    pipeline.assess(found.keypoints(), found.tracks(), {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information});
    const auto& report = pipeline.conclude();
    tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
    out.number("frame" + n + ".timestamp", s.image.timestamp);
    out.text("frame" + n + ".reported", to_string(report.state));
    out.number("frame" + n + ".dynamic_ratio", seen.dynamic_ratio);
    out.matrix("frame" + n + ".T_feature", pose.T_world_camera.matrix());
    out.matrix("frame" + n + ".T", report.T_world_camera.matrix());
    assessment(out, "frame" + n, report.assessment);
    truth.push_back({s.image.timestamp, s.image.T_world_camera});
    estimate.push_back({s.image.timestamp, report.T_world_camera});
  }

  const Stored& a = stored.front();
  const Stored& b = stored.back();
  apso::PairOptions options;
  options.depth_unit = kUnit;
  const auto found_motion = apso::align(a.I, a.D, b.I, b.D, camera, apso::identity_pose(), options);
  out.text("align.status", to_string(found_motion.status));
  out.number("align.confidence", found_motion.confidence);
  out.matrix("align.T", found_motion.T_current_reference.matrix());
  out.matrix("align.information", found_motion.detail.information);
  const auto floats = apso::align(a.image.intensity, a.image.depth, b.image.intensity, b.image.depth, camera);
  for (const auto& [name, s] : {std::pair<const char*, const Stored*>{"0", &a}, {"1", &b}}) {
    const auto pixels = [&](const apso::Image<float>& image) {
      std::vector<float> v;
      for (int y = 0; y < image.height(); ++y) v.insert(v.end(), image.row(y), image.row(y) + image.width());
      return v;
    };
    out.array(std::string("intensity") + name + ".f32", pixels(s->image.intensity));
    out.array(std::string("metres") + name + ".f32", pixels(s->image.depth));
  }
  out.matrix("align_float.T", floats.T_current_reference.matrix());

  found = apso::testing::SyntheticFeatures(camera);
  found.find(a.image);
  apso::SceneAssessor assessor(camera);
  assessment(out, "score",
             assessor.assess(apso::assessment_input(apso::frame(0.0, a.I, apso::scaled(a.D, kUnit), camera), found.keypoints())));

  const apso::Pose other = apso::compose(found_motion.T_current_reference, apso::se3_exp(apso::Twist::Constant(0.01)));
  out.matrix("blend.other", other.matrix());
  out.matrix("blend.half", apso::blend(other, found_motion.T_current_reference, 0.5).matrix());
  apso::Matrix6 certain = apso::Matrix6::Identity() * 1e4;
  out.matrix("blend.information",
             apso::blend(other, found_motion.T_current_reference, 0.3, certain, found_motion.detail.information).matrix());

  for (const auto& [name, t] : {std::pair<const char*, const apso::Trajectory*>{"truth.f64", &truth}, {"estimate.f64", &estimate}}) {
    std::vector<double> poses;
    for (const apso::StampedPose& p : *t) {
      poses.push_back(p.timestamp);
      for (int k = 0; k < 16; ++k) poses.push_back(p.T_world_body(k / 4, k % 4));
    }
    out.array(name, poses);
  }
  for (const auto alignment : {apso::TrajectoryAlignment::Se3, apso::TrajectoryAlignment::Sim3, apso::TrajectoryAlignment::Yaw}) {
    apso::AteOptions o;
    o.alignment = alignment;
    const apso::AteResult ate = apso::ate(truth, estimate, o);
    const std::string name = std::string("ate_") + enum_names(alignment)[static_cast<std::size_t>(alignment)];
    out.number(name + ".rmse", ate.statistics.rmse);
    out.number(name + ".scale", ate.scale);
    out.matrix(name + ".T", ate.T_groundtruth_estimate.matrix());
  }
  apso::RpeOptions o;
  o.unit = apso::DeltaUnit::Frames;
  const apso::RpeResult rpe = apso::rpe(truth, estimate, o);
  out.number("rpe.translation", rpe.translation.rmse);
  out.number("rpe.rotation", rpe.rotation_deg.rmse);
  return out.ok() ? 0 : 1;
}
