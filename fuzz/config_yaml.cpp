// Parameters as YAML: what is read is in its range, and what is written reads back as the same.
#include <apso/io/parameters.hpp>
#include <apso/quality/assessor_options.hpp>
#include <apso/refinement/refiner_options.hpp>

#include "input.hpp"

namespace {
struct Options {
  apso::AssessorOptions assessor;
  apso::RefinerOptions refiner;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("assessor", s.assessor);
    v("refiner", s.refiner);
  }
};
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file;
  static fuzz::MemoryFile second;
  const std::string& path = file.write(data, size);
  try {
    Options options;
    apso::read_parameters(path, options);
    apso::validate(options, "fuzz");
    const std::string text = apso::write_parameters(options);
    Options back;
    apso::read_parameters(second.write(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), back);
    fuzz::require(apso::write_parameters(back) == text, "what is written reads back as the same");
  } catch (const apso::io_error& e) {
    fuzz::require_names_file(e.what(), path);
  }
  return 0;
}
