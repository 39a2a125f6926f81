/// \file
/// The settings of apso_track, and of all programs that run it or write files for it.
#pragma once

#include <cstdio>
#include <filesystem>
#include <map>
#include <string>

#include <apso/io/parameters.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/opencv/detectors/motion_by_name.hpp>
#include <apso/opencv/feature_tracker.hpp>
#include <apso/pipeline/pipeline.hpp>

namespace track {

struct Config {
  apso::PipelineOptions pipeline;
  apso::opencv::FeatureTrackerOptions tracker;
  apso::opencv::MotionOptions motion;  ///< of every policy that --motion can name
  apso::SoftWeightOptions soft_weights;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("pipeline", s.pipeline);
    v("tracker", s.tracker);
    v("motion", s.motion);
    v("soft_weights", s.soft_weights);
  }
};

/// The settings of a YAML file; the default ones without a file. Throws io_error naming file, line and field.
inline Config read_config(const std::string& file) {
  Config config;
  if (file.empty()) return config;
  if (std::filesystem::is_directory(file)) throw apso::io_error(file + ": is a folder, expected a YAML file with settings");
  apso::read_parameters(file, config);
  return config;
}

/// Takes the depth noise of a recording where the settings do not tell it.
/// \param inverse_depth_sigma [1/m]; 0: not known
inline void take_depth_noise(double inverse_depth_sigma, Config& config) {
  if (config.tracker.inverse_depth_sigma == 0) config.tracker.inverse_depth_sigma = inverse_depth_sigma;
}

/// Prints every setting with its value and range, and how many there are in each group.
inline void print_settings(const Config& config) {
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
