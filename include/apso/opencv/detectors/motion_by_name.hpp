/// \file
/// Every motion policy by its name, for programs that choose at run time.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/observation/policies/cluster_residual.hpp>
#include <apso/observation/policies/depth_refined_mask.hpp>
#include <apso/observation/policies/epipolar_motion.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/observation/policies/mask_propagation.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/policies/multiview_depth.hpp>
#include <apso/observation/policy_expression.hpp>
#include <apso/observation/policies/residual_motion.hpp>
#include <apso/observation/policies/temporal_filter.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/opencv/detectors/dnn_detector.hpp>
#include <apso/opencv/detectors/hog_people.hpp>
#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Options of all policies, by name.
struct MotionOptions {
  GeometricMotionOptions geometric;
  EpipolarMotionOptions epipolar;
  MultiViewDepthOptions multiview_depth;
  ClusterResidualOptions cluster_residual;
  ResidualMotionOptions residual;
  DepthRefinedMaskOptions depth_refined_mask;
  MaskPropagationOptions mask_propagation;
  TemporalFilterOptions temporal_filter;
  HogPeopleOptions hog_people;
  DnnOptions dnn;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("geometric", s.geometric);
    v("epipolar", s.epipolar);
    v("multiview_depth", s.multiview_depth);
    v("cluster_residual", s.cluster_residual);
    v("residual", s.residual);
    v("depth_refined_mask", s.depth_refined_mask);
    v("mask_propagation", s.mask_propagation);
    v("temporal_filter", s.temporal_filter);
    v("hog_people", s.hog_people);
    v("dnn", s.dnn);
  }
};

/// What a policy may need from outside.
struct MotionFiles {
  std::string masks;       ///< folder of mask images, for `precomputed`
  std::string detections;  ///< file or folder of detections, for `precomputed`
  std::string model;       ///< ONNX file, for `dnn`
  ClassList classes;       ///< of the detections and of the network
};

/// A policy by name and what it does, for help texts.
struct MotionName {
  const char* name;
  const char* summary;
  bool takes_policy;  ///< needs another policy in brackets
};
[[nodiscard]] inline const std::vector<MotionName>& motion_names() {
  static const std::vector<MotionName> names{
      {"geometric", "free space of past views and tracks (default)", false},
      {"epipolar", "tracks that leave their epipolar lines", false},
      {"multiview-depth", "depth against key views", false},
      {"cluster-residual", "clusters that a joint alignment does not explain", false},
      {"residual", "pixels that an alignment does not explain", false},
      {"hog-people", "people by gradients", false},
      {"dnn", "objects of a network, needs --model", false},
      {"precomputed", "files of another program, needs --masks or --detections", false},
      {"semantic", "dnn, precomputed or hog-people, the first that has its files", false},
      {"none", "nothing is known", false},
      {"depth-refined-mask", "cuts the masks or boxes of P to surfaces", true},
      {"mask-propagation", "asks P every n-th frame, carries its mask between", true},
      {"temporal-filter", "smooths P over time", true}};
  return names;
}

/// The policy `name` (one that goes around another) around `inner`. Throws contract_error for another name.
[[nodiscard]] inline AnyMotionPolicy wrap_motion(const std::string& name, AnyMotionPolicy inner, const Pinhole& camera,
                                                 const MotionOptions& options = {}) {
  if (name == "depth-refined-mask") return DepthRefinedMask<AnyMotionPolicy>(std::move(inner), camera, options.depth_refined_mask);
  if (name == "mask-propagation") return MaskPropagation<AnyMotionPolicy>(std::move(inner), camera, options.mask_propagation);
  if (name == "temporal-filter") return TemporalFilter<AnyMotionPolicy>(std::move(inner), camera, options.temporal_filter);
  contract_violation("wrap_motion: no policy that goes around another is called '" + name + "'");
}

/// The policy that an expression such as "geometric", "depth-refined-mask(hog-people)+geometric" or "semantic&geometric"
/// describes; see policy_expression.hpp. Throws contract_error for an expression or name that is wrong, io_error for
/// files that cannot be used.
[[nodiscard]] inline AnyMotionPolicy motion_by_name(const std::string& expression, const Pinhole& camera,
                                                    const MotionOptions& options = {}, const MotionFiles& files = {}) {
  const auto make = [&](std::string name, std::optional<AnyMotionPolicy> inner) -> AnyMotionPolicy {
    const bool has_files = !files.masks.empty() || !files.detections.empty();
    if (name == "motion") name = "geometric";
    if (name == "semantic") name = !files.model.empty() ? "dnn" : has_files ? "precomputed" : "hog-people";
    const MotionName* entry = nullptr;
    std::string known;
    for (const MotionName& n : motion_names()) {
      if (name == n.name) entry = &n;
      known += (known.empty() ? "" : ", ") + std::string(n.name) + (n.takes_policy ? "(P)" : "");
    }
    if (entry == nullptr) contract_violation("motion policy '" + expression + "': no policy is called '" + name + "', known are: " + known);
    if (entry->takes_policy != inner.has_value()) {
      contract_violation("motion policy '" + expression + "': '" + name +
                         (entry->takes_policy ? "' goes around another policy, e.g. " + name + "(hog-people)" : "' takes no policy in brackets"));
    }
    if (inner) return wrap_motion(name, std::move(*inner), camera, options);
    if (name == "geometric") return GeometricMotion(camera, options.geometric);
    if (name == "epipolar") return EpipolarMotion(camera, options.epipolar);
    if (name == "multiview-depth") return MultiViewDepth(camera, options.multiview_depth);
    if (name == "cluster-residual") return ClusterResidual(camera, options.cluster_residual);
    if (name == "residual") return ResidualMotion(camera, options.residual);
    if (name == "hog-people") return DetectorPolicy<HogPeople>(HogPeople(options.hog_people));
    if (name == "dnn") {
      if (files.model.empty()) contract_violation("motion policy '" + expression + "': 'dnn' needs the file of a network");
      return DetectorPolicy<DnnDetector>(DnnDetector(files.model, options.dnn, files.classes));
    }
    if (name == "precomputed") {
      if (!has_files) contract_violation("motion policy '" + expression + "': 'precomputed' needs a folder of masks, or detections");
      return PrecomputedMotion(camera, files.masks, files.detections, files.classes);
    }
    return NoMotion{};
  };
  return parse_policy(expression, make);
}

}  // namespace opencv
APSO_NAMESPACE_END
