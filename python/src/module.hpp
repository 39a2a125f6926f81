/// \file
/// The parts of the module.
#pragma once

#include <pybind11/pybind11.h>

#include <apso/quality/assessment.hpp>

namespace apso_python {

void add_align(pybind11::module_& m);
void add_score(pybind11::module_& m);
void add_evaluate(pybind11::module_& m);
void add_pipeline(pybind11::module_& m);

/// What was found out about a frame, as an apso.Assessment.
struct PythonAssessment {
  apso::Assessment assessment;
};

}  // namespace apso_python
