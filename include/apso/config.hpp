/// \file
/// Contracts, the exception switch and the inline namespace.
///
/// Macros a user may define before the first include:
///
/// | macro                    | effect                                                                    |
/// |--------------------------|---------------------------------------------------------------------------|
/// | APSO_CONTRACT_HANDLER(m) | called with a C string instead of throwing; must not return               |
/// | APSO_NAMESPACE_TAG       | name of the inline namespace (default v0), to link two versions together; |
/// |                          | _avx or _avx512 is added where these are compiled for                     |
/// | APSO_NO_DEPRECATED       | be silent about the use of what will be removed                           |
/// | APSO_NO_WIDE_LANES       | use the instruction set that is compiled for alone, also where the        |
/// |                          | processor has AVX2 (math/lanes/wide_lanes.hpp)                            |
#pragma once

#if (defined(_MSVC_LANG) ? _MSVC_LANG : __cplusplus) < 201703L
#error "apso needs C++17: compile with -std=c++17 or a later standard"
#endif

#include <cstdlib>
#include <stdexcept>
#include <string>

#include <apso/version.hpp>

#ifndef APSO_NAMESPACE_TAG
#define APSO_NAMESPACE_TAG v0
#endif

/// Marks a name that will be removed, with the version that says so first and what to use now, e.g.
/// `APSO_DEPRECATED("0.2", "use align()") void old_name();`. docs/versions.md says how long such names stay.
#ifdef APSO_NO_DEPRECATED
#define APSO_DEPRECATED(since, instead)
#else
#define APSO_DEPRECATED(since, instead) [[deprecated("apso: deprecated since " since ": " instead)]]
#endif

// Functions that need not be fast, compiled once instead of into all their callers. APSO_COLD is for errors alone: the compiler takes
// whatever leads to such a call for cold as well.
#if defined(__GNUC__)
#define APSO_NOINLINE [[gnu::noinline]]
#define APSO_COLD [[gnu::cold, gnu::noinline]]
#else
#define APSO_NOINLINE
#define APSO_COLD
#endif

// How many floats are worked on at once depends on the instruction set that is compiled for (math/lanes/lanes.hpp), and with it the code of
// functions and the layout of buffers: each set has names of its own, so that parts compiled for different ones can be linked together.
#if defined(__GNUC__) && defined(__AVX512F__)
#define APSO_INSTRUCTION_SET _avx512
#elif defined(__GNUC__) && defined(__AVX__)
#define APSO_INSTRUCTION_SET _avx
#else
#define APSO_INSTRUCTION_SET
#endif
#define APSO_JOIN_EXPANDED(a, b) a##b
#define APSO_JOIN(a, b) APSO_JOIN_EXPANDED(a, b)

// Spelled as macros because C++17 has no `namespace apso::inline v0`.
#define APSO_NAMESPACE_BEGIN \
  namespace apso {           \
  inline namespace APSO_JOIN(APSO_NAMESPACE_TAG, APSO_INSTRUCTION_SET) {
#define APSO_NAMESPACE_END \
  }                        \
  }

APSO_NAMESPACE_BEGIN

/// A call that breaks a documented precondition: sizes that differ, an option out of its range.
/// Never thrown for data that merely defeats an algorithm; that is reported by a Status.
class contract_error : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// Cold path of a broken contract. Throws contract_error, or calls APSO_CONTRACT_HANDLER if defined,
/// or aborts when exceptions are disabled.
[[noreturn]] APSO_COLD inline void contract_violation(const std::string& message) {
#if defined(APSO_CONTRACT_HANDLER)
  APSO_CONTRACT_HANDLER(message.c_str());
  std::abort();
#elif defined(__cpp_exceptions)
  throw contract_error("apso: " + message);
#else
  (void)message;
  std::abort();
#endif
}

/// The same for a literal: the string is made here, not by each of the callers.
[[noreturn]] APSO_COLD inline void contract_violation(const char* message) { contract_violation(std::string(message)); }

/// Checks a precondition once per call (never per pixel).
inline void expects(bool condition, const char* message) {
  if (!condition) contract_violation(message);
}

APSO_NAMESPACE_END
