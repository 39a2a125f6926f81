// Direct alignment of tiny frames with any pixels, cameras and guesses: a rigid motion, or a status that says why not.
#include <apso/refinement/align.hpp>

#include "input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apso;
  fuzz::Bytes in(data, size);
  PairOptions options;
  options.pyramid.finest = in.below(2);
  options.pyramid.levels = 1 + in.below(4);
  options.backward = in.flag();
  const int width = 6 + in.below(30);
  const int height = 6 + in.below(30);
  const Pinhole camera{in.number(1, 60), in.number(1, 60), in.number(0, 30), in.number(0, 30), width, height};
  const Pose guess = in.pose();
  Image<float> grey[2], depth[2];
  for (int k = 0; k < 2; ++k) {
    grey[k].resize(width, height);
    depth[k].resize(width, height);
    const double far = in.number(0.3, 6);
    for (std::size_t i = 0; i < grey[k].size(); ++i) {
      // a texture, changed where the input says so
      grey[k].data()[i] = in.empty() ? static_cast<float>((i * 2654435761U) % 97) / 97.0F : static_cast<float>(in.number(0, 1));
      depth[k].data()[i] = in.empty() || in.flag() ? static_cast<float>(far) : static_cast<float>(in.number(0, 7));
    }
  }
  try {
    const auto found = align(frame(0, grey[0], depth[0], camera), frame(0.1, grey[1], depth[1], camera), guess, options);
    if (succeeded(found.status)) fuzz::require(is_finite(found.T_current_reference), "a pose that succeeded is finite");
    fuzz::require(found.confidence >= 0 && found.confidence <= 1, "a confidence is in [0,1]");
  } catch (const contract_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
