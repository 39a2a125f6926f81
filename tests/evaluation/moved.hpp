// A trajectory in another world frame.
#pragma once

#include <apso/evaluation/trajectory.hpp>
#include <apso/math/se3.hpp>

[[nodiscard]] inline apso::Trajectory moved(const apso::Pose& T, apso::Trajectory t) {
  for (auto& p : t) p.T_world_body = T * p.T_world_body;
  return t;
}
