// Outputs of a network, of any shape and content: objects with finite boxes and masks of the image's size, or refused.
#include <apso/opencv/detectors/network_objects.hpp>
#include <apso/opencv/detectors/network_outputs.hpp>

#include "input.hpp"

namespace {
cv::Mat matrix(fuzz::Bytes& in) {
  const int dims = 2 + in.below(3);
  int size[4] = {1, 1, 1, 1};
  static constexpr int usual[] = {1, 1, 1, 4, 6, 7, 2, 3, 5, 8, 0, 20};
  for (int i = 0; i < dims; ++i) size[i] = usual[in.below(12)];
  cv::Mat m(dims, size, in.below(20) == 0 ? CV_8U : CV_32F, cv::Scalar(0));
  if (m.depth() != CV_32F) return m;
  for (std::size_t i = 0; i < m.total(); ++i) m.ptr<float>()[i] = static_cast<float>(in.number(0, 64));
  return m;
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apso;
  fuzz::Bytes in(data, size);
  static constexpr const char* kNames[] = {"boxes", "labels", "scores", "masks", "output0"};
  const auto head = static_cast<opencv::NetworkHead>(in.below(5));
  std::vector<std::string> names;
  std::vector<cv::Mat> outputs;
  for (int n = in.below(5); n >= 0; --n) {
    names.emplace_back(kNames[in.below(5)]);
    outputs.push_back(matrix(in));
  }
  try {
    const opencv::NetworkObjects found = opencv::decode(names, outputs, head, 64, 64, 0.1F);
    const auto letterbox = opencv::Letterbox::fit(16, 12, 64, 64);
    for (const std::size_t i : opencv::suppress(found.objects, 0.5F)) {
      const opencv::NetworkObject& o = found.objects[i];
      fuzz::require(o.score >= 0.1F && o.class_id >= 0, "an object has a score and a class");
      fuzz::require(std::abs(o.box.x) <= 1e6F && o.box.width > 0 && o.box.height <= 1e6F, "a box is limited");
      Image<std::uint8_t> mask;
      if (opencv::mask_of(found, o, letterbox, 16, 12, mask)) fuzz::require(mask.width() == 16 && mask.height() == 12, "a mask fits");
    }
  } catch (const io_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
