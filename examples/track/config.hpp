/// \file
/// The settings of apso_track, and of all programs that run it or write files for it.
#pragma once

#include <string>
#include <vector>

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
Config read_config(const std::string& file);

/// Takes the depth noise of a recording where the settings do not tell it, in the tracker and in the refiner.
/// \param inverse_depth_sigma [1/m]; 0: not known
inline void take_depth_noise(double inverse_depth_sigma, Config& config) {
  if (inverse_depth_sigma == 0) return;
  if (config.tracker.inverse_depth_sigma == 0) config.tracker.inverse_depth_sigma = inverse_depth_sigma;
  apso::take_depth_noise(inverse_depth_sigma, config.pipeline.refiner);
}

/// Prints every setting with its value and range, and how many there are in each group.
void print_settings(const Config& config);

}  // namespace track

// Two hundred settings take long to compile: once, in config.cpp.
APSO_NAMESPACE_BEGIN
extern template std::vector<Parameter> list_parameters(const track::Config& options);
extern template void set_parameter(track::Config& options, const std::string& path, const std::string& value);
extern template void read_parameters(const std::string& file, track::Config& options);
extern template std::string write_parameters(const track::Config& options);
APSO_NAMESPACE_END
