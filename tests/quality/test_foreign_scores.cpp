// Scores and assessor on types that no code of apso has seen: the same result to the last digit as on native ones, no image
// copied, nothing of the caller's kept.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <limits>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include <apso/score.hpp>
#include <apso/threshold.hpp>

#include "../counting_allocator.hpp"
#include "../foreign_types.hpp"

namespace {
using namespace apso;

constexpr float kUnit = 1 / 5000.0F;  // of 16-bit depth [m]

float noise(std::uint32_t& state) {
  state = state * 1664525U + 1013904223U;
  return static_cast<float>(state >> 8U) / 16777216.F;
}

/// Frame k of a room that changes a little, with somebody in it.
struct Room {
  static constexpr int kWidth = 320;
  static constexpr int kHeight = 240;
  Pinhole camera{260, 260, 159.5, 119.5, kWidth, kHeight};
  Image<float> intensity{kWidth, kHeight};
  Image<float> depth{kWidth, kHeight};
  Image<float> dynamic{kWidth, kHeight, 0.F};
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  std::vector<Detection> objects;

  explicit Room(int k) {
    std::uint32_t state = 7;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        intensity(x, y) = 0.3F + 0.4F * noise(state) * static_cast<float>((x / 12 + y / 9) % 2);
        depth(x, y) = noise(state) < 0.1F ? 0.F : 1.5F + 0.005F * static_cast<float>(x + k) + 0.002F * noise(state);
        if (x > 100 + k && x < 160 + k && y > 60) dynamic(x, y) = 0.9F;
      }
    }
    for (int i = 0; i < 500; ++i) {
      const float u = 8 + 300 * noise(state), v = 8 + 220 * noise(state);
      keypoints.push_back({u, v, 20 + 10 * noise(state), 0, 0});
      tracks.push_back({i, u + static_cast<float>(k), v, u + static_cast<float>(k) - 1, v, k});
    }
    Detection d;
    d.box = {static_cast<float>(100 + k), 60, 60, 180};
    d.score = 0.8F;
    objects.push_back(d);
  }
};

/// Everything that a frame was found to be, as text: two that are the same are the same to the last digit.
std::string all_of(const Assessment& a) {
  std::string text;
  const auto add = [&text](const std::string& name, double v) {
    char number[64];
    std::snprintf(number, sizeof number, "%a", v);
    text += name + '=' + number + '\n';
  };
  for_each_score(a, [&](const char* name, const auto& v, double w, Better) { add(name, v ? *v : -1), add(name, w); });
  for_each_measurement(a, add);
  add("S_total", a.S_total.value());
  add("S_final", a.S_final ? a.S_final->value() : -1);
  add("ratio", a.dynamic_ratio);
  add("innovation", a.innovation);
  add("S_inn", a.S_inn.value());
  return text + to_string(a.state);
}
}  // namespace

TEST_CASE("an assessor gives the same for foreign types as for native ones") {
  const Room first(0);
  SceneAssessor native(first.camera);
  SceneAssessor other(first.camera);
  for (int k = 0; k < 45; ++k) {
    const Room room(k);
    const auto grey = foreign::at_only(room.intensity);
    const auto raw = foreign::padded_u16(room.depth, kUnit);
    const auto mask = foreign::float_millimetres(room.dynamic);  // thousandths
    const auto cloud = foreign::xyz_cloud(room.depth, 260, 159.5F, 119.5F);
    const auto corners = foreign::corners(room.keypoints);
    const std::list<foreign::Feature> tracks = foreign::features(room.tracks);
    const auto boxes = foreign::boxes(room.objects);
    const bool by_cloud = k % 2 == 1;

    const Image<float> intensity = foreign::native(grey);
    const Image<float> depth = by_cloud ? room.depth : foreign::native(raw, kUnit);
    Image<float> dynamic(Room::kWidth, Room::kHeight);
    for (int y = 0; y < Room::kHeight; ++y) {
      for (int x = 0; x < Room::kWidth; ++x) dynamic(x, y) = 0.001F * image_traits<foreign::FloatMillimetres>::at(mask, x, y);
    }
    std::vector<Keypoint> keypoints;
    for_each_keypoint(corners, [&](const Keypoint& p) { keypoints.push_back(p); });
    std::vector<PointTrack> listed;
    for_each_track(tracks, [&](const PointTrack& p) { listed.push_back(p); });
    std::vector<Detection> objects;
    for_each_detection(boxes, [&](const Detection& p) { objects.push_back(p); });
    AssessmentInput in;
    in.frame = {k / 30.0, intensity, depth};
    in.dynamic_probability = dynamic;
    in.keypoints = &keypoints;
    in.tracks = &listed;
    in.objects = &objects;
    in.dynamic_ratio = 0.2;
    const Pose T_world_camera = make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.001 * k, 0, 0));
    const Pose T_world_predicted = make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.001 * k, k == 43 ? 0.02 : 0.001, 0));
    in.T_world_camera = &T_world_camera;
    in.T_world_predicted = &T_world_predicted;
    const std::string expected = all_of(native.assess(in));

    const auto assess = [&](const auto& frame) {
      auto input = assessment_input(frame, corners, tracks, boxes, scaled(mask, 0.001F));
      input.dynamic_ratio = 0.2;
      input.T_world_camera = &T_world_camera;
      input.T_world_predicted = &T_world_predicted;
      return all_of(other.assess(input));
    };
    CHECK((by_cloud ? assess(frame(k / 30.0, grey, cloud, room.camera)) : assess(frame(k / 30.0, grey, scaled(raw, kUnit), room.camera))) ==
          expected);
    CHECK((other.assessment().S_inn.value() < 1) == (k == 43));
  }
  CHECK(other.assessment().state == SceneState::Good);
  CHECK(other.assessment().get<DetectionChange>().has_value());
}

TEST_CASE("what is missing is missing, and the dynamic ratio is that of the map") {
  const Room room(0);
  SceneAssessor assessor(room.camera);
  const RgbdFrame frame{0.0, room.intensity, room.depth};
  const Assessment none_given = assessor.assess(assessment_input(frame));
  CHECK_FALSE(none_given.get<Feature>());
  CHECK(none_given.dynamic_ratio == 0);
  const Assessment a = assessor.assess(assessment_input(frame, room.keypoints, none, none, room.dynamic));
  CHECK(a.get<Feature>());
  CHECK_FALSE(a.get<MotionChange>());
  CHECK(a.dynamic_ratio == doctest::Approx(0.9 * 59 * 179 / (320 * 240)));
  CHECK_FALSE(a.get("S_mc"));
  CHECK_FALSE(a.get("S_nothing"));
  CHECK(*a.get("S_depth") == a.get<Depth>()->value());
}

TEST_CASE("no image is copied, whatever its type") {
  const Room room(0);
  const auto grey = foreign::at_only(room.intensity);
  const auto raw = foreign::padded_u16(room.depth, kUnit);
  const auto mask = foreign::padded_u16(room.dynamic, 0.001F);
  const auto corners = foreign::corners(room.keypoints);
  constexpr std::size_t image = std::size_t{Room::kWidth} * Room::kHeight;
  const auto bytes = [](auto&& f) {
    const std::size_t before = counting::bytes;
    f();
    return counting::bytes - before;
  };
  CHECK(bytes([&] { (void)depth_score(scaled(raw, kUnit)); }) < image / 8);
  CHECK(bytes([&] { (void)measure_sharpness(scaled(grey, 1 / 255.F)); }) < image / 8);
  CHECK(bytes([&] { (void)depth_score(room.depth); }) == 0);
  CHECK(bytes([&] { (void)measure_sharpness(room.intensity); }) == 0);
  SceneAssessor assessor(room.camera);
  double t = 0;
  const auto next = [&] {
    const auto now = frame(t += 0.03, grey, scaled(raw, kUnit), room.camera);
    (void)assessor.assess(assessment_input(now, corners, room.tracks, room.objects, scaled(mask, 0.001F)));
  };
  CHECK(bytes(next) < sizeof(float) * image / 2);  // lists, rows, and samples for S_dc: a sixteenth of the image in each snapshot
  for (int i = 0; i < 40; ++i) next();
  CHECK(bytes(next) < image / 8);
}

TEST_CASE("the rules for the thresholds are the user's to choose") {
  struct Impatient {  // th_f and th_s never change
    explicit Impatient(const InitialisationOptions&) {}
    void reset() {}
    void next(int, double) {}
    [[nodiscard]] double frames() const { return 3; }
    [[nodiscard]] double quality() const { return 0.01; }
  };
  struct Alternating {  // th_differ is out of reach in every second frame
    explicit Alternating(const DecisionOptions&) {}
    void reset() { n = 0; }
    double value() { return ++n % 2 == 0 ? 1.01 : 0.0; }
    void remember(Quality, bool) {}
    int n = 0;
  };
  const Room room(0);
  BasicAssessor<PaperFrameScores, PaperChangeScores, Impatient, Alternating> assessor(room.camera);
  std::string states;
  for (int i = 0; i < 7; ++i) {
    states += to_string(assessor.assess(assessment_input(RgbdFrame{0.1 * i, room.intensity, room.depth}, room.keypoints)).state)[0];
  }
  CHECK(states == "IIIGBGB");
}
