// The module apso._apso. Each part of the library is in a file of its own.
#include <pybind11/pybind11.h>

#include <apso/config.hpp>
#include <apso/version.hpp>

#include "module.hpp"

PYBIND11_MODULE(_apso, m) {
  m.doc() = "Compiled part of apso.";
  m.attr("__version__") = APSO_VERSION;
  // A broken contract is a wrong argument.
  pybind11::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const apso::contract_error& e) {
      PyErr_SetString(PyExc_ValueError, e.what());
    }
  });
  apso_python::add_align(m);
  apso_python::add_score(m);
  apso_python::add_evaluate(m);
  apso_python::add_pipeline(m);
}
