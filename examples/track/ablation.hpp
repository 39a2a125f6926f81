/// \file
/// What apso_ablate changes: a table of variants, each a name, what it means, and the settings it differs in.
#pragma once

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <apso/io/parameters.hpp>
#include <apso/pipeline/paper_options.hpp>

#include "config.hpp"

namespace track {

struct Variant {
  std::string name;
  std::string meaning;
  std::vector<std::pair<std::string, std::string>> settings;  ///< path of a field and its value
  std::string without;                                        ///< path of a weight that is given to the others of its group; empty: none
  bool paper = false;                                         ///< begins with paper_options() instead of the settings given
  bool true_masks = false;                                    ///< masks from the generator: synthetic sequences only
};

/// The variants that are the same for all settings to start from.
inline std::vector<Variant> fixed_variants() {
  const auto assessor = [](const std::string& path) { return "pipeline.assessor." + path; };
  const auto decision = [](const std::string& path) { return "pipeline.assessor.decision." + path; };
  const auto refiner = [](const std::string& path) { return "pipeline.refiner." + path; };
  return {
      {"default", "everything as shipped", {}, ""},
      {"plain", "features alone: nothing masked, nothing refined", {{"pipeline.motion", "false"}, {"pipeline.refine", "none"}}, ""},
      {"no_refinement", "the poses of the features alone", {{"pipeline.refine", "none"}}, ""},
      {"bad_only", "GOOD frames keep the pose of the features", {{"pipeline.refine", "bad_only"}}, ""},
      {"no_previous", "no alignment to the frame before", {{refiner("memory.previous"), "false"}}, ""},
      {"no_following", "references do not follow the features", {{refiner("follow_features"), "0"}}, ""},
      {"screw_blend", "blend along the screw, one weight for all directions", {{refiner("blend.form"), "screw_linear"}}, ""},
      {"one_reference", "alignment to one stored reference", {{refiner("memory.references"), "1"}}, ""},
      {"three_references", "alignment to three stored references", {{refiner("memory.references"), "3"}}, ""},
      {"sum_distance", "distance to a reference as a sum, as printed", {{refiner("memory.form"), "sum"}}, ""},
      {"flow_grid_memory", "motion of a frame from its optical flow, as printed", {{refiner("memory.motion"), "flow_grid"}}, ""},
      {"printed_decay", "decay of references with the printed sign", {{refiner("memory.decay_form"), "printed"}}, ""},
      {"joint_scale", "one scale for both kinds of residual", {{refiner("alignment.coupling"), "joint"}}, ""},
      {"alpha_inside", "alpha inside the kernel, as printed", {{refiner("alignment.alpha_place"), "inside"}}, ""},
      {"no_illumination", "brightness changes are not estimated", {{refiner("alignment.illumination"), "false"}}, ""},
      {"printed_blend",
       "blend by w_diff alone, as printed",
       {{refiner("blend.form"), "screw_linear"}, {refiner("blend.weight"), "printed"}},
       ""},
      {"no_motion", "nothing is masked", {{"pipeline.motion", "false"}}, ""},
      {"no_change", "S_final = S_total", {{decision("w_base"), "1"}, {decision("a"), "0"}, {decision("w_dyn"), "1"}}, ""},
      {"no_sharpness", "S_feature from keypoints alone", {{assessor("feature.sharpness"), "false"}}, ""},
      {"no_innovation", "S_final from the images alone", {{decision("innovation"), "false"}}, ""},
      {"no_dynamic_ratio", "W_base does not fall with what moves", {{decision("a"), "0"}}, ""},
      {"no_static_boost", "static scenario off", {{decision("boost_static"), "0"}}, ""},
      {"no_dynamic_scenario", "dynamic scenario off", {{decision("th_dynamic"), "1"}}, ""},
      {"no_object_boost", "scenario of confident objects off", {{decision("boost_object"), "0"}}, ""},
      {"no_hand_over", "a reference is not handed on", {{assessor("benchmark.hand_over"), "false"}}, ""},
      {"ratchet",
       "benchmark update as printed",
       {{assessor("benchmark.hand_over"), "false"}, {assessor("benchmark.half_life"), ".inf"}, {assessor("benchmark.max_age"), ".inf"}},
       ""},
      {"number_only",
       "a better frame updates the number of the benchmark alone, as printed",
       {{assessor("benchmark.update"), "number_only"}},
       ""},
      {"literal_polarity", "S_change raises S_final, as printed", {{decision("polarity"), "literal"}}, ""},
      {"cumulative_base", "W_base falls from frame to frame, as printed", {{decision("base_weight"), "cumulative"}}, ""},
      {"literal_thresholds", "th_s by the printed recursion", {{assessor("initialisation.quality_threshold"), "literal"}}, ""},
      {"first_passing", "the first frame that passes is the reference", {{assessor("initialisation.initial_frame"), "first_passing"}}, ""},
      {"paper", "equations (1) to (17) as printed: paper_options()", {}, "", true},
      {"previous_baseline", "change against the frame before", {{assessor("change_baseline"), "previous"}}, ""},
      {"residual_flow", "S_mc without the camera's own motion", {{assessor("motion_change.flow"), "residual"}}, ""},
      {"homography_flow", "S_mc without what a homography explains", {{assessor("motion_change.flow"), "homography"}}, ""},
      {"pose_flow", "S_mc without what poses and depth explain", {{assessor("motion_change.flow"), "pose"}}, ""},
      {"gated_feature", "S_feature in the gated form", {{assessor("feature.form"), "gated"}}, ""},
      {"linear_feature", "S_feature in the linear form", {{assessor("feature.form"), "linear"}}, ""},
      {"half_saturation", "responses against a constant", {{assessor("feature.response"), "half_saturation"}}, ""},
      {"covering", "uniformity by square covering", {{assessor("feature.uniformity"), "covering"}}, ""},
      {"observability", "S_spatial: how well objects are seen", {{assessor("spatial.form"), "object_observability"}}, ""},
      {"ratio_features", "dynamic ratio of keypoints", {{assessor("dynamic_ratio"), "features"}}, ""},
      {"ratio_count", "dynamic ratio of objects", {{assessor("dynamic_ratio"), "count"}}, ""},
      {"auto_threshold", "th_differ follows the GOOD frames", {{decision("auto_calibrate"), "true"}}, ""},
      {"true_masks", "as shipped, with the generator's masks instead of the policy's", {{"pipeline.motion", "false"}}, "", false, true},
  };
}

/// All variants: the fixed ones, and one for each score, which takes its weight away.
inline std::vector<Variant> variants() {
  std::vector<Variant> all = fixed_variants();
  std::vector<std::string> names;  // in the order of their weights
  apso::for_each_score(apso::Assessment{}, [&](const char* name, auto&&...) { names.emplace_back(name); });
  std::size_t next = 0;
  for (const apso::Parameter& p : apso::list_parameters(Config{})) {
    for (const auto& [group, sum] :
         {std::pair("pipeline.assessor.frame_weights.", "S_total"), std::pair("pipeline.assessor.change_weights.", "S_change")}) {
      if (p.path.rfind(group, 0) != 0) continue;
      const std::string& score = names[next++];
      all.push_back({"no_" + score.substr(score.rfind("S_", 0) == 0 ? 2 : 0), std::string(sum) + " without " + score, {}, p.path});
    }
  }
  return all;
}

/// Sets a weight to 0 and enlarges the others of its group in proportion, so that their sum stays what it was.
inline void drop_weight(Config& config, const std::string& path) {
  const std::string group = path.substr(0, path.rfind('.') + 1);
  std::vector<std::pair<std::string, double>> others;
  double rest = 0;
  double dropped = 0;
  for (const apso::Parameter& p : apso::list_parameters(config)) {
    if (p.path.rfind(group, 0) != 0) continue;
    const double w = std::stod(p.value);
    if (p.path == path) {
      dropped = w;
    } else {
      others.emplace_back(p.path, w);
      rest += w;
    }
  }
  apso::set_parameter(config, path, "0");
  if (!(rest > 0)) return;
  for (const auto& [other, w] : others) {
    char value[32];
    std::snprintf(value, sizeof value, "%.17g", w * (rest + dropped) / rest);
    apso::set_parameter(config, other, value);
  }
}

/// The settings of a variant of `config`. Throws io_error when a setting does not exist or does not take the value.
inline Config changed(Config config, const Variant& variant) {
  if (variant.paper) config.pipeline = apso::paper_options();
  for (const auto& [path, value] : variant.settings) apso::set_parameter(config, path, value);
  if (!variant.without.empty()) drop_weight(config, variant.without);
  apso::validate(config, variant.name);
  return config;
}

}  // namespace track
