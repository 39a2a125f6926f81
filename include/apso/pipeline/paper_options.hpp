/// \file
/// The paper as one setting: equations (1) to (17) as they are printed.
#pragma once

#include <apso/config.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/quality/assessor_options.hpp>
#include <apso/refinement/refiner_options.hpp>

APSO_NAMESPACE_BEGIN

/// Every equation in its printed form, where that can be computed at all: paper_assessor_options() for (1) to (11) and
/// paper_refiner_options() for (12) to (17). For comparison: docs/equations.md says which of these forms fail, and why the defaults
/// differ. The sum of two pose matrices in (17) cannot be computed, because it is no pose; the poses are joined along the screw between
/// them.
[[nodiscard]] inline PipelineOptions paper_options() {
  PipelineOptions o;
  o.refine = RefinedFrames::BadOnly;
  o.assessor = paper_assessor_options();
  o.refiner = paper_refiner_options();
  return o;
}

APSO_NAMESPACE_END
