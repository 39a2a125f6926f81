// Detections as text, in all forms: what is read is finite and of a class, and what is wrong is refused with file and line.
#include <apso/io/detection_text.hpp>

#include "input.hpp"

namespace {
void check(const std::vector<apso::Detection>& found) {
  fuzz::require(found.size() <= apso::kMaxObjects, "not more objects than the limit");
  for (const apso::Detection& d : found) {
    for (const float v : {d.box.x, d.box.y, d.box.width, d.box.height, d.box.x + d.box.width, d.box.y + d.box.height})
      fuzz::require(std::isfinite(v), "boxes are finite");
    fuzz::require(d.box.width >= 0 && d.box.height >= 0, "sizes are not negative");
    fuzz::require(d.score >= 0 && d.score <= 1, "scores are in [0,1]");
    fuzz::require(d.class_id >= 0, "objects have a class");
  }
}
template <class Read>
void attempt(const std::string& path, const Read& read) {
  try {
    read();
  } catch (const apso::io_error& e) {
    fuzz::require_names_file(e.what(), path);
  }
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file;
  const std::string& path = file.write(data, size);
  attempt(path, [&] { check(apso::read_detections(path, 640, 480)); });
  attempt(path, [&] {
    apso::DetectionLog log(path, 640, 480);
    for (const double stamp : {0.0, 1.0, 10.5, -1e300}) check(log.at(stamp));
  });
  return 0;
}
