/// \file
/// How an algorithm ended: failures are negative, successes are not.
#pragma once

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Outcome of an estimation. A failure leaves the pose of the result at the initial guess.
enum class Status : int {
  NotRun = -100,        ///< the algorithm was not called
  NoReference = -7,     ///< no reference frame was close enough
  NoMask = -6,          ///< highly dynamic frame without any mask
  SingularSystem = -5,  ///< normal equations without a usable direction
  Diverged = -4,        ///< the cost rose or became non-finite
  NoOverlap = -3,       ///< the frames do not see the same surface
  TooFewPixels = -2,    ///< not enough valid residuals
  TooFewMatches = -1,   ///< not enough point correspondences
  Converged = 0,        ///< a stop criterion was met
  MaxIterations = 1,    ///< iterations ran out while the cost was still falling
  Degenerate = 2        ///< solved, but some directions kept the initial guess
};

/// True when the result may be used.
[[nodiscard]] constexpr bool succeeded(Status s) { return static_cast<int>(s) >= 0; }

/// Name of a status, for reports.
[[nodiscard]] constexpr const char* to_string(Status s) {
  switch (s) {
    case Status::NotRun:
      return "NotRun";
    case Status::NoReference:
      return "NoReference";
    case Status::NoMask:
      return "NoMask";
    case Status::SingularSystem:
      return "SingularSystem";
    case Status::Diverged:
      return "Diverged";
    case Status::NoOverlap:
      return "NoOverlap";
    case Status::TooFewPixels:
      return "TooFewPixels";
    case Status::TooFewMatches:
      return "TooFewMatches";
    case Status::Converged:
      return "Converged";
    case Status::MaxIterations:
      return "MaxIterations";
    case Status::Degenerate:
      return "Degenerate";
  }
  return "?";
}

APSO_NAMESPACE_END
