/// \file
/// The one way work is made parallel: the caller passes an executor, a callable `executor(n, f)` that calls
/// f(0) .. f(n-1) in any order and from any thread, and returns when all are done. Algorithms split work into
/// parts that do not depend on the number of threads and combine them in order, so results never depend on it.
#pragma once

#include <type_traits>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Runs everything in the calling thread.
struct SerialExecutor {
  template <class F>
  void operator()(int n, F&& f) const {
    for (int i = 0; i < n; ++i) f(i);
  }
};

/// Any executor, by reference: what is behind it is compiled once, whatever executors a program uses. Must not outlive it.
class ExecutorRef {
 public:
  template <class Executor, class = std::enable_if_t<!std::is_same_v<Executor, ExecutorRef>>>
  ExecutorRef(const Executor& executor)  // NOLINT: taken where an executor is asked for
      : executor_(&executor), run_([](const void* e, int n, void (*call)(void*, int), void* f) {
          (*static_cast<const Executor*>(e))(n, [call, f](int i) { call(f, i); });
        }) {}

  template <class F>
  void operator()(int n, F&& f) const {
    using Function = std::remove_reference_t<F>;
    run_(
        executor_, n, [](void* g, int i) { (*static_cast<Function*>(g))(i); }, const_cast<void*>(static_cast<const void*>(&f)));
  }

 private:
  const void* executor_;
  void (*run_)(const void*, int, void (*)(void*, int), void*);
};

APSO_NAMESPACE_END
