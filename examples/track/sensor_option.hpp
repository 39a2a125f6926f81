/// \file
/// The option --sensor of programs that make synthetic recordings.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/testing/synthetic.hpp>

namespace track {

/// Adds the option --sensor.
inline void add_sensor(CLI::App& app, apso::testing::DepthSensor& sensor, const std::string& what) {
  const auto names = enum_names(sensor);
  const auto choose = [&sensor, names](const std::string& name) {
    const auto found = std::find(names.begin(), names.end(), name);
    sensor = static_cast<apso::testing::DepthSensor>(found - names.begin());
  };
  app.add_option_function<std::string>("--sensor", choose, what + ": the one that alignment expects, or another (default structured_light)")
      ->check(CLI::IsMember(std::vector<std::string>(names.begin(), names.end())));
}

}  // namespace track
