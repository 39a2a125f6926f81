/// \file
/// Numbers that are written once.
#pragma once

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegree = kPi / 180;  ///< one degree [rad]

APSO_NAMESPACE_END
