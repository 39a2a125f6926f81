/// \file
/// The motion policies of the core by their names, for programs that choose at run time, and with the names of your own.
///
/// \code
/// AnyMotionPolicy motion = motion_by_name("geometric | border", camera, {}, {{"border", [] { return Border{}; }}});
/// \endcode
#pragma once

#include <string>
#include <utility>

#include <apso/config.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/policies/cluster_residual.hpp>
#include <apso/observation/policies/depth_refined_mask.hpp>
#include <apso/observation/policies/epipolar_motion.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/observation/policies/interaction_rule.hpp>
#include <apso/observation/policies/mask_propagation.hpp>
#include <apso/observation/policies/multiview_depth.hpp>
#include <apso/observation/policies/residual_motion.hpp>
#include <apso/observation/policies/temporal_filter.hpp>
#include <apso/observation/policy_expression.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Options of the policies, by name.
struct MotionOptions {
  GeometricMotionOptions geometric;
  EpipolarMotionOptions epipolar;
  MultiViewDepthOptions multiview_depth;
  ClusterResidualOptions cluster_residual;
  ResidualMotionOptions residual;
  DepthRefinedMaskOptions depth_refined_mask;
  MaskPropagationOptions mask_propagation;
  TemporalFilterOptions temporal_filter;
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
  }
};

/// The policies of the core. Camera and options must outlive the table. A template, so that only who asks for names pays for
/// compiling all policies.
/// \tparam OptionsT MotionOptions, or what derives from it
template <class OptionsT>
[[nodiscard]] PolicyTable motion_table(const Pinhole& camera, const OptionsT& options) {
  using Any = AnyMotionPolicy;
  PolicyTable t;
  const auto geometric = [&] { return GeometricMotion(camera, options.geometric); };
  t.emplace_back("geometric", geometric, "free space of past views and tracks (default)");
  t.emplace_back(
      "epipolar", [&] { return EpipolarMotion(camera, options.epipolar); }, "tracks that leave their epipolar lines");
  t.emplace_back(
      "multiview-depth", [&] { return MultiViewDepth(camera, options.multiview_depth); }, "depth against key views");
  t.emplace_back(
      "cluster-residual", [&] { return ClusterResidual(camera, options.cluster_residual); },
      "clusters that a joint alignment does not explain");
  t.emplace_back(
      "residual", [&] { return ResidualMotion(camera, options.residual); }, "pixels that an alignment does not explain");
  t.emplace_back("motion", geometric, "the same as geometric");
  t.emplace_back(
      "none", [] { return NoMotion{}; }, "nothing is known");
  t.emplace_back(
      "depth-refined-mask", [&](Any inner) { return DepthRefinedMask<Any>(std::move(inner), camera, options.depth_refined_mask); },
      "cuts the masks or boxes of P to surfaces");
  t.emplace_back(
      "interaction", [&](Any inner) { return InteractionRule<Any>(std::move(inner), camera); },
      "marks objects of P that what P marks touches");
  t.emplace_back(
      "mask-propagation", [&](Any inner) { return MaskPropagation<Any>(std::move(inner), camera, options.mask_propagation); },
      "asks P every n-th frame, carries its mask between");
  t.emplace_back(
      "temporal-filter", [&](Any inner) { return TemporalFilter<Any>(std::move(inner), camera, options.temporal_filter); },
      "smooths P over time");
  return t;
}

/// The policy that an expression such as "geometric | residual" describes; see policy_expression.hpp.
/// \param own policies of yours by name; they come before those of the core
/// Throws contract_error for an expression or name that is wrong.
template <class OptionsT = MotionOptions>
[[nodiscard]] AnyMotionPolicy motion_by_name(const std::string& expression, const Pinhole& camera, const OptionsT& options = {},
                                             PolicyTable own = {}) {
  for (NamedPolicy& entry : motion_table(camera, options)) own.push_back(std::move(entry));
  return parse_policy(expression, own);
}

APSO_NAMESPACE_END
