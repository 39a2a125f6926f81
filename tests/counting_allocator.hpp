/// \file
/// Counts what a test program allocates. Replaces the operators new and delete, so it is included by one file of a program.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace counting {
inline std::atomic<std::size_t> allocations{0};  // since the program began
inline std::atomic<std::size_t> bytes{0};
inline std::atomic<std::size_t> large_allocations{0};  // those of at least `large` bytes
inline std::atomic<std::size_t> large_bytes{0};
inline std::atomic<std::size_t> large{~std::size_t{0}};

struct Allocations {
  std::size_t number = 0;
  std::size_t bytes = 0;
  std::size_t large_number = 0;
  std::size_t large_bytes = 0;
};
inline Allocations so_far() { return {allocations, bytes, large_allocations, large_bytes}; }

/// What f() allocates.
template <class F>
Allocations count(F&& f) {
  const Allocations before = so_far();
  f();
  const Allocations after = so_far();
  return {after.number - before.number, after.bytes - before.bytes, after.large_number - before.large_number,
          after.large_bytes - before.large_bytes};
}
}  // namespace counting

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // inlined, GCC 12 takes the free() below for a mistake
#endif
void* operator new(std::size_t n) {
  ++counting::allocations;
  counting::bytes += n;
  if (n >= counting::large) {
    ++counting::large_allocations;
    counting::large_bytes += n;
  }
  if (void* p = std::malloc(n == 0 ? 1 : n)) return p;
  std::abort();  // no test runs out of memory on purpose
}
// std::stable_sort asks for memory like this
void* operator new(std::size_t n, const std::nothrow_t&) noexcept { return operator new(n); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
