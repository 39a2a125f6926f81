// Lists of images and associations: each is read in the order of time, or refused with file and line.
#include <apso/io/tum_text.hpp>

#include "input.hpp"

namespace {
template <class Read, class Stamp>
void check(const std::string& path, const Read& read, const Stamp& stamp) {
  try {
    const auto list = read(path);
    fuzz::require(!list.empty(), "a list that was read has entries");
    for (std::size_t i = 0; i < list.size(); ++i) {
      fuzz::require(std::isfinite(stamp(list[i])), "stamps are finite");
      fuzz::require(i == 0 || stamp(list[i - 1]) < stamp(list[i]), "stamps increase");
    }
  } catch (const apso::io_error& e) {
    fuzz::require_names_file(e.what(), path);
  }
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file;
  const std::string& path = file.write(data, size);
  check(
      path, [](const std::string& p) { return apso::read_file_list(p); }, [](const apso::FileListEntry& e) { return e.timestamp; });
  check(
      path, [](const std::string& p) { return apso::read_associations(p); },
      [](const apso::ImageAssociation& a) { return a.rgb_timestamp; });
  return 0;
}
