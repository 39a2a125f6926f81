/// \file
/// The one way work is made parallel: the caller passes an executor, a callable `executor(n, f)` that calls
/// f(0) .. f(n-1) in any order and from any thread, and returns when all are done. Algorithms split work into
/// parts that do not depend on the number of threads and combine them in order, so results never depend on it.
#pragma once

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Runs everything in the calling thread.
struct SerialExecutor {
  template <class F>
  void operator()(int n, F&& f) const {
    for (int i = 0; i < n; ++i) f(i);
  }
};

APSO_NAMESPACE_END
