/// \file
/// Trajectories in the formats of the common benchmarks: TUM RGB-D, KITTI odometry, EuRoC. The format can be told from the file.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/math/se3.hpp>

APSO_NAMESPACE_BEGIN

/// How a file of poses is written.
enum class TrajectoryFormat {
  Tum,    ///< timestamp tx ty tz qx qy qz qw, seconds
  TumNs,  ///< the same with stamps in nanoseconds, as ORB-SLAM3 writes for EuRoC
  Kitti,  ///< the upper three rows of a pose matrix, 12 numbers, no stamp: line i is frame i
  Euroc   ///< timestamp, px, py, pz, qw, qx, qy, qz, and maybe more columns; nanoseconds
};
[[nodiscard]] constexpr std::array<const char*, 4> enum_names(TrajectoryFormat) { return {"tum", "tum_ns", "kitti", "euroc"}; }

/// Poses, and how the file had them.
struct TrajectoryFile {
  Trajectory trajectory;
  TrajectoryFormat format = TrajectoryFormat::Tum;
  bool has_stamps = true;  ///< false: the stamps are the numbers of the frames, 0, 1, 2, ...
};

namespace detail {
inline constexpr PoseLine euroc_line{
    "timestamp, px, py, pz, qw, qx, qy, qz, ...", {"timestamp", "px", "py", "pz", "qw", "qx", "qy", "qz"}, 4, 1e-9, true};
/// Stamps above are no seconds: 1.8e9 of them have passed since 1970.
inline constexpr double kNanosecondStamps = 1e17;
}  // namespace detail

/// The format of a file of poses, told from its header and its first line of numbers:
/// 12 fields are KITTI; eight or more separated by commas, with nanoseconds (a stamp above 1e17, or "[ns]" in the header), are EuRoC;
/// eight with nanoseconds are TumNs, eight others Tum.
/// \throws io_error when the file cannot be read, or is none of these
[[nodiscard]] inline TrajectoryFormat detect_trajectory_format(const std::string& path) {
  bool header_ns = false;
  {
    std::ifstream file = detail::open_text(path, "a trajectory");
    std::string line;
    while (std::getline(file, line) && (line.empty() || line[0] == '#' || line.compare(0, 3, "\xEF\xBB\xBF") == 0)) {
      header_ns = header_ns || line.find("[ns]") != std::string::npos;
    }
  }
  detail::FieldReader reader(path);
  if (!reader.next()) throw io_error(path + ": no pose found");
  const std::size_t fields = reader.fields().size();
  if (fields == 12 && reader.line().find(',') == std::string::npos) return TrajectoryFormat::Kitti;
  if (fields >= 8) {
    const bool ns = header_ns || std::abs(reader.number(0, "timestamp")) > detail::kNanosecondStamps;
    if (ns && reader.line().find(',') != std::string::npos) return TrajectoryFormat::Euroc;
    if (fields == 8) return ns ? TrajectoryFormat::TumNs : TrajectoryFormat::Tum;
  }
  throw io_error(reader.where() + "found " + std::to_string(fields) + (fields == 1 ? " field" : " fields") +
                 ", expected 8 (TUM), 12 (KITTI), or 8 or more with commas and nanoseconds (EuRoC)");
}

/// Reads the times of a KITTI sequence, times.txt: one number a line [s].
/// \throws io_error when the file cannot be read, a line is no finite number, or the times do not increase
[[nodiscard]] inline std::vector<double> read_kitti_times(const std::string& path) {
  detail::FieldReader reader(path);
  std::vector<double> times;
  while (reader.next()) {
    reader.expect_fields(1, "time in seconds");
    times.push_back(reader.finite_number(0, "time"));
    if (times.size() > 1 && !(times[times.size() - 2] < times.back())) throw io_error(reader.where() + "the times must increase");
  }
  if (times.empty()) throw io_error(path + ": no time found, expected one number of seconds a line");
  return times;
}

/// Reads a trajectory of the KITTI odometry benchmark: 12 numbers a line, the rows of [R | t], T_world_body. Rotations are made exactly
/// orthonormal. Lines with NaN or infinite values are skipped with a warning; the frames after them keep their numbers.
/// \param times_path file of the stamps, one for each line; empty: the stamps are the numbers of the lines, 0, 1, 2, ...
/// \throws io_error when a file cannot be read, a line is malformed or no rigid motion, or there are fewer times than poses
[[nodiscard]] inline Trajectory read_kitti_trajectory(const std::string& path, const std::string& times_path = {},
                                                      std::vector<std::string>* warnings = nullptr) {
  const std::vector<double> times = times_path.empty() ? std::vector<double>{} : read_kitti_times(times_path);
  detail::FieldReader reader(path);
  Trajectory trajectory;
  std::size_t frame = 0;
  for (; reader.next(); ++frame) {
    reader.expect_fields(12, "the rows of a 3x4 matrix: r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz");
    static constexpr const char* names[] = {"r11", "r12", "r13", "tx", "r21", "r22", "r23", "ty", "r31", "r32", "r33", "tz"};
    Pose T = identity_pose();
    const char* bad = nullptr;
    for (std::size_t i = 0; i < 12; ++i) {
      const double v = reader.number(i, names[i]);
      if (bad == nullptr && !std::isfinite(v)) bad = names[i];
      T(static_cast<int>(i / 4), static_cast<int>(i % 4)) = v;
    }
    if (bad != nullptr) {
      detail::warn(warnings, reader.where() + bad + " is not finite, line skipped");
      continue;
    }
    if (!is_rigid(T))
      throw io_error(reader.where() + "the matrix is no rigid motion: expected R right-handed and orthonormal, t within 1e9 m");
    if (!times.empty() && frame >= times.size()) {
      throw io_error(reader.where() + "there is no time for this pose: " + times_path + " has " + std::to_string(times.size()));
    }
    trajectory.push_back({times.empty() ? static_cast<double>(frame) : times[frame], normalized(T)});
  }
  if (trajectory.empty()) throw io_error(path + ": no pose found, expected 12 numbers a line");
  if (frame < times.size()) {
    detail::warn(warnings, path + ": " + std::to_string(frame) + " poses, but " + times_path + " has " + std::to_string(times.size()) +
                               " times: the first ones are used");
  }
  return trajectory;
}

/// Reads a trajectory of EuRoC, of lines `timestamp, px, py, pz, qw, qx, qy, qz, ...`: nanoseconds, which become seconds, metres, unit
/// quaternion with its real part first. Further columns (velocity, biases) are not read. Otherwise as read_trajectory.
/// \throws io_error as read_trajectory
[[nodiscard]] inline Trajectory read_euroc_trajectory(const std::string& path, std::vector<std::string>* warnings = nullptr) {
  return detail::read_pose_lines(path, detail::euroc_line, warnings);
}

/// Reads a trajectory in any of the formats.
/// \param format     nothing: told from the file, detect_trajectory_format()
/// \param times_path stamps of a KITTI trajectory; other formats have their own, and it is not read for them
/// \throws io_error when a file cannot be read or is not of the format
[[nodiscard]] inline TrajectoryFile read_trajectory_file(const std::string& path, std::optional<TrajectoryFormat> format = {},
                                                         const std::string& times_path = {}, std::vector<std::string>* warnings = nullptr) {
  TrajectoryFile file;
  file.format = format ? *format : detect_trajectory_format(path);
  switch (file.format) {
    case TrajectoryFormat::Tum:
      file.trajectory = read_trajectory(path, warnings);
      break;
    case TrajectoryFormat::TumNs:
      file.trajectory = detail::read_pose_lines(path, detail::tum_line(1e-9), warnings);
      break;
    case TrajectoryFormat::Euroc:
      file.trajectory = read_euroc_trajectory(path, warnings);
      break;
    case TrajectoryFormat::Kitti:
      file.trajectory = read_kitti_trajectory(path, times_path, warnings);
      file.has_stamps = !times_path.empty();
      break;
  }
  return file;
}

APSO_NAMESPACE_END
