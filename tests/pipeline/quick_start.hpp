// A pipeline that decides from its sixth frame on, so that tests need few.
#pragma once

#include <apso/pipeline/pipeline.hpp>

[[nodiscard]] inline apso::PipelineOptions quick_start() {
  apso::PipelineOptions o;
  o.assessor.initialisation.frames = 5;
  return o;
}
