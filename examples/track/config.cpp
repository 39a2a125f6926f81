#include "config.hpp"

#include <cstdio>
#include <filesystem>
#include <map>

APSO_NAMESPACE_BEGIN
template std::vector<Parameter> list_parameters(const track::Config& options);
template void set_parameter(track::Config& options, const std::string& path, const std::string& value);
template void read_parameters(const std::string& file, track::Config& options);
template std::string write_parameters(const track::Config& options);
APSO_NAMESPACE_END

namespace track {

Config read_config(const std::string& file) {
  Config config;
  if (file.empty()) return config;
  if (std::filesystem::is_directory(file)) throw apso::io_error(file + ": is a folder, expected a YAML file with settings");
  apso::read_parameters(file, config);
  return config;
}

void print_settings(const Config& config) {
  std::map<std::string, int> groups;
  int count = 0;
  for (const apso::Parameter& p : apso::list_parameters(config)) {
    std::printf("%-62s %-16s %s\n", p.path.c_str(), p.value.c_str(), p.range.c_str());
    const auto first = p.path.find('.');
    const auto second = p.path.find('.', first + 1);
    ++groups[p.path.substr(0, second == std::string::npos ? first : second)];
    ++count;
  }
  std::printf("\n%d settings:\n", count);
  for (const auto& [group, n] : groups) std::printf("  %4d %s\n", n, group.c_str());
}

}  // namespace track
