// A reader for your own dataset, in one file; its images and poses are used directly.
// Eigen is all this file needs.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <apso/apso.hpp>
#include <apso/testing/synthetic.hpp>

// [reader]
// The recording: index.txt with a line "stamp grey.pgm depth.pgm" per frame; grey is 8 bit, depth 16 bit in millimetres.
struct PgmFrame {
  double timestamp = 0;  // [s]
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> grey;
  std::vector<std::uint8_t> depth;  // as in the file: two bytes per pixel, the high one first
};

class PgmSequence {
 public:
  explicit PgmSequence(const std::string& folder) : folder_(folder), index_(folder + "/index.txt") {}

  // The next frame; false at the end of the recording.
  bool next(PgmFrame& frame) {
    std::string grey;
    std::string depth;
    return static_cast<bool>(index_ >> frame.timestamp >> grey >> depth) &&
           read(folder_ + "/" + grey, frame.width, frame.height, 1, frame.grey) &&
           read(folder_ + "/" + depth, frame.width, frame.height, 2, frame.depth);
  }

 private:
  static bool read(const std::string& file, int& width, int& height, int bytes, std::vector<std::uint8_t>& out) {
    std::ifstream stream(file, std::ios::binary);
    std::string magic;
    int largest = 0;
    if (!(stream >> magic >> width >> height >> largest) || magic != "P5") return false;
    stream.get();  // one blank ends the header
    out.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(bytes));
    return static_cast<bool>(stream.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(out.size())));
  }
  std::string folder_;
  std::ifstream index_;
};

// What apso takes: views of the bytes as they came. The high byte of depth stands first, so most machines swap.
static auto as_frame(const PgmFrame& f, const apso::Pinhole& camera) {
  const auto w = static_cast<std::size_t>(f.width);
  const std::uint16_t one = 1;
  const bool swap = *reinterpret_cast<const std::uint8_t*>(&one) == 1;
  const apso::ImageView<const std::uint8_t> grey(f.grey.data(), f.width, f.height);
  const auto depth = apso::byte_image<std::uint16_t>(f.depth.data(), f.depth.size(), f.width, f.height, 2 * w, 2, swap);
  return apso::frame(f.timestamp, grey, apso::scaled(depth, 0.001F), camera);
}
// [/reader]

// Writes a recording in that format, so that there is one to read: a camera that moves through a room.
static void record(const std::string& folder, const apso::testing::SyntheticSequence& sequence, int frames) {
  std::ofstream index(folder + "/index.txt");
  apso::testing::SyntheticFrame frame;
  for (int i = 0; i < frames; ++i) {
    sequence.render(i, frame);
    const std::string name = std::to_string(i) + ".pgm";
    const std::string size = std::to_string(frame.depth.width()) + " " + std::to_string(frame.depth.height());
    std::ofstream grey(folder + "/grey" + name, std::ios::binary);
    std::ofstream depth(folder + "/depth" + name, std::ios::binary);
    grey << "P5\n" << size << "\n255\n";
    depth << "P5\n" << size << "\n65535\n";
    for (std::size_t k = 0; k < frame.depth.size(); ++k) {
      const float z = frame.depth.data()[k];
      const auto mm = static_cast<unsigned>(z > 0 ? 1000 * z + 0.5F : 0.0F);
      grey.put(static_cast<char>(static_cast<unsigned char>(255 * frame.intensity.data()[k] + 0.5F)));
      depth.put(static_cast<char>(mm >> 8U)).put(static_cast<char>(mm & 0xFFU));
    }
    index << std::to_string(frame.timestamp) << " grey" << name << " depth" << name << "\n";
  }
}

int main(int argc, char** argv) {
  const std::string folder = argc > 1 ? argv[1] : ".";
  apso::testing::SyntheticOptions small;
  small.width = 320;
  small.height = 240;
  const apso::testing::SyntheticSequence sequence("static_halfsphere", small);
  record(folder, sequence, 8);

  // [use]
  const apso::Pinhole camera = sequence.camera();
  PgmSequence recording(folder);
  PgmFrame first;
  PgmFrame now;
  std::vector<std::pair<double, apso::Pose>> path;
  if (!recording.next(first)) return std::puts("the folder has no index.txt with images"), 1;
  while (recording.next(now)) {  // each frame against the first
    const auto pair = apso::align(as_frame(first, camera), as_frame(now, camera));
    if (apso::succeeded(pair.status)) path.emplace_back(now.timestamp, apso::inverse(pair.T_current_reference));
  }
  // [/use]

  if (path.size() != 7) return std::printf("%zu frames of 7 with a pose\n", path.size()), 1;
  std::vector<std::pair<double, apso::Pose>> truth;
  for (int i = 1; i < 8; ++i) {
    const apso::Pose T = apso::compose(apso::inverse(sequence.T_world_camera(0)), sequence.T_world_camera(i));
    truth.emplace_back(path[static_cast<std::size_t>(i - 1)].first, T);
  }
  apso::AteOptions same_world;
  same_world.alignment = apso::TrajectoryAlignment::None;
  const auto ate = apso::ate(truth, path, same_world);
  std::printf("%zu frames, ATE %.4f m\n", path.size(), ate.statistics.rmse);
  return ate.statistics.rmse < 0.005 ? 0 : 1;
}
