// Three parts of one program, compiled for different instruction sets, align the same pair of frames.
// With -DPART=name: one of the parts. Without: the program that calls all of them.
#include <cmath>
#include <cstdio>
#include <initializer_list>

#ifdef PART
#include <typeinfo>
#include <vector>

#include <apso/refinement/aligner.hpp>

// A wall with a slope and a pattern, seen from x = 0 and from x = `shift`.
static void render(float shift, std::vector<float>& intensity, std::vector<float>& depth) {
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const float u = (static_cast<float>(x) - 80) / 150;
      const float v = (static_cast<float>(y) - 60) / 150;
      const float z = (2 + 0.3F * shift) / (1 - 0.3F * u - 0.2F * v);
      const float X = u * z + shift;
      const float Y = v * z;
      intensity.push_back(0.5F + 0.2F * std::sin(9 * X + 3 * std::sin(5 * Y)) + 0.2F * std::cos(7 * Y + 2 * X));
      depth.push_back(z);
    }
  }
}

const char* PART(double T[3]) {
  std::vector<float> intensity[2], depth[2];
  render(0.0F, intensity[0], depth[0]);
  render(0.03F, intensity[1], depth[1]);
  apso::Pinhole camera;
  camera.fx = camera.fy = 150;
  camera.cx = 80;
  camera.cy = 60;
  camera.width = 160;
  camera.height = 120;
  apso::PyramidOptions options;
  options.finest = 0;
  apso::FramePyramid pyramids[2];
  for (int i = 0; i < 2; ++i) {
    apso::RgbdFrame frame;
    frame.intensity = {intensity[i].data(), 160, 120};
    frame.depth = {depth[i].data(), 160, 120};
    pyramids[i].build(frame, camera, {}, options);
  }
  apso::AlignmentOptions alignment;
  alignment.multi_start_threshold = 0;  // whatever is compiled is run
  apso::DirectAligner aligner(alignment);
  const apso::AlignmentResult r = aligner.align({{&pyramids[0], apso::Pose::Identity(), 1.0}}, pyramids[1], {apso::Pose::Identity()});
  for (int i = 0; i < 3; ++i) T[i] = apso::succeeded(r.status) ? r.T_world_camera(i, 3) : 1e3;
  return typeid(apso::Lanes).name();
}

#else
#include <cstring>

const char* narrow(double T[3]);  // for any processor, with the lanes of any processor
const char* any(double T[3]);     // for any processor, with the lanes that this one has
const char* wide(double T[3]);    // for AVX2

int main() {
  if (!__builtin_cpu_supports("avx2")) {
    std::puts("skipped: this processor has no AVX2");
    return 0;
  }
  double a[3], b[3], c[3];
  const char* names[] = {narrow(a), any(b), wide(c)};
  for (int i = 0; i < 3; ++i) {
    if (std::strcmp(names[i], names[(i + 1) % 3]) == 0) {
      std::puts("one name for lanes of two parts");
      return 1;
    }
  }
  for (const double* T : {a, b, c}) {
    std::printf("%.9f %.9f %.9f\n", T[0], T[1], T[2]);
    if (!(std::abs(T[0] - 0.03) < 2e-3) || !(std::abs(T[1]) < 2e-3) || !(std::abs(T[2]) < 2e-3)) return 1;
  }
  if (std::memcmp(a, b, sizeof a) != 0) {
    std::puts("lanes that are found at run time give other bits");
    return 1;
  }
  return 0;
}
#endif
