/// \file
/// How the scales of the change scores are found on calm recordings.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Calibrates a scale (s_m, s_mu, s_sigma) on a slow static sequence: the 95th percentile of the raw values (flow in
/// image diagonals, relative depth), measured at the reference age that occurs in operation, maps to a deviation of
/// 0.3. Values that are not finite are ignored; 0 when none is left.
[[nodiscard]] inline double calibrate_change_scale(std::vector<double> raw) {
  raw.erase(std::remove_if(raw.begin(), raw.end(), [](double v) { return !std::isfinite(v); }), raw.end());
  if (raw.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.95 * static_cast<double>(raw.size()))) - 1;
  std::nth_element(raw.begin(), raw.begin() + rank, raw.end());
  return raw[static_cast<std::size_t>(rank)] / -std::log(1.0 - 0.3);
}

/// Sets `scale` to the calibrated one, rounded to four places; leaves it where nothing was measured.
/// \param member the raw value among what a score measured
template <class Measured>
void adopt_change_scale(const std::vector<Measured>& measured, double Measured::*member, double& scale) {
  std::vector<double> raw;
  raw.reserve(measured.size());
  for (const Measured& m : measured) raw.push_back(m.*member);
  const double found = calibrate_change_scale(std::move(raw));
  if (found > 0) scale = std::max(1e-4, std::round(found * 1e4) / 1e4);
}

APSO_NAMESPACE_END
