// Image files through the loaders of masks, colour and depth: decoded into the size of the camera, or refused.
#include <filesystem>
#include <fstream>

#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/opencv/rgbd_sequence.hpp>

#include "input.hpp"

namespace {
namespace fs = std::filesystem;

// A recording of one frame; its images are symbolic links to the input.
struct Recording {
  fs::path folder = fs::temp_directory_path() / ("apso_fuzz_images_" + std::to_string(::getpid()));
  Recording() {
    fs::create_directories(folder / "masks");
    std::ofstream(folder / "rgb.txt") << "1.0 colour.png\n";
    std::ofstream(folder / "depth.txt") << "1.0 depth.png\n";
  }
  ~Recording() { fs::remove_all(folder); }
  void write(const std::uint8_t* data, std::size_t size) const {
    for (const char* name : {"colour.png", "depth.png", "masks/1.0.png"}) {
      std::ofstream file(folder / name, std::ios::binary);
      file.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
    }
  }
};
// A picture in which a few numbers are enough to say that it has a million pixels is skipped: it is slow, not wrong.
bool large(const std::uint8_t* data, std::size_t size) {
  if (size < 26) return false;
  if (data[0] == 0x89 && data[1] == 'P')
    return data[16] != 0 || data[17] != 0 || data[18] > 2 || data[20] != 0 || data[21] != 0 || data[22] > 2;
  return false;
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Recording recording;
  if (large(data, size)) return 0;
  recording.write(data, size);
  apso::CameraModel camera;
  camera.pinhole = {8, 8, 3.5, 2.5, 8, 6};
  const apso::opencv::RgbdSequence sequence(recording.folder.string(), camera);
  const apso::opencv::SequenceFrame frame = sequence.frame(0);
  if (frame.ok()) {
    fuzz::require(frame.intensity.width() == 8 && frame.depth.height() == 6, "a frame has the size of the camera");
    for (std::size_t i = 0; i < frame.depth.size(); ++i) {
      fuzz::require(frame.depth.data()[i] >= 0 && std::isfinite(frame.depth.data()[i]), "depth is finite");
      fuzz::require(frame.intensity.data()[i] >= 0 && frame.intensity.data()[i] <= 1, "intensity is in [0,1]");
    }
  } else {
    fuzz::require(fuzz::printable_message(frame.error.c_str()), "a message is printable");
  }
  try {
    apso::opencv::PrecomputedMotion masks(camera.pinhole, (recording.folder / "masks").string(), "");
    apso::DynamicMask mask;
    const apso::Image<float> depth(8, 6, 1.0F);
    masks.observe(apso::RgbdFrame{1.0, depth, depth}, apso::identity_pose(), {}, mask);
    for (std::size_t i = 0; i < mask.probability.size(); ++i)
      fuzz::require(mask.probability.data()[i] >= 0 && mask.probability.data()[i] <= 1, "probabilities are in [0,1]");
  } catch (const apso::io_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
