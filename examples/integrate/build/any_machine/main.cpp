// Aligns a pair of frames by the library that suits the machine, and says how long that takes.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include "my_align.h"

// A wall with a slope and a pattern, seen from so many metres to the right.
static void render(double shift, std::vector<std::uint8_t>& grey, std::vector<std::uint16_t>& millimetres) {
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const double u = (x - 320.1) / 535.4;
      const double v = (y - 247.6) / 539.2;
      const double z = (2 + 0.3 * shift) / (1 - 0.3 * u - 0.2 * v);
      const double X = u * z + shift;
      const double Y = v * z;
      grey.push_back(static_cast<std::uint8_t>(128 + 50 * std::sin(9 * X + 3 * std::sin(5 * Y)) + 50 * std::cos(7 * Y + 2 * X)));
      millimetres.push_back(static_cast<std::uint16_t>(1000 * z + 0.5));
    }
  }
}

int main() {
  std::vector<std::uint8_t> grey[2];
  std::vector<std::uint16_t> millimetres[2];
  for (int i = 0; i < 2; ++i) render(0.02 * i, grey[i], millimetres[i]);
  const SensorFrame first{grey[0].data(), millimetres[0].data()};
  const SensorFrame second{grey[1].data(), millimetres[1].data()};
  Motion motion{};
  std::vector<double> ms;
  for (int i = 0; i < 101; ++i) {
    const auto start = std::chrono::steady_clock::now();
    motion = my_align(first, second);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(ms.begin(), ms.end());
  std::printf("moved by %.4f %.4f %.4f m, confidence %.2f, %d floats at once, %.2f ms\n", motion.x, motion.y, motion.z, motion.confidence,
              motion.floats_at_once, ms[50]);
  return std::abs(motion.x + 0.02) < 0.001 && motion.confidence > 0.5 ? 0 : 1;
}
