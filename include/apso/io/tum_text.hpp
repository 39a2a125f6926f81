/// \file
/// The text files of the TUM RGB-D benchmark: trajectories, lists of images, associations.
///
/// Common rules, those of the benchmark's own scripts: lines that begin with '#' and blank lines are skipped,
/// fields are separated by blanks, tabs or commas. Line ends of Windows and a byte order mark are accepted.
/// Numbers are read and written with a decimal point whatever the locale.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <locale>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/math/se3.hpp>

APSO_NAMESPACE_BEGIN

/// A line of rgb.txt or depth.txt.
struct FileListEntry {
  double timestamp = 0;  ///< [s]
  std::string file;      ///< relative to the folder of the list
};

/// A line of an association file: a colour image and the depth image that belongs to it.
struct ImageAssociation {
  double rgb_timestamp = 0;  ///< [s]
  std::string rgb_file;      ///< relative to the folder of the sequence
  double depth_timestamp = 0;
  std::string depth_file;
};

namespace detail {
inline void warn(std::vector<std::string>* warnings, const std::string& text) {
  if (warnings != nullptr) warnings->push_back(text);
}

/// The order in time of lines with these stamps, the first of equal stamps only; one warning if that is not the order of
/// the file, and one for repeated stamps.
inline std::vector<std::size_t> order_in_time(const std::vector<double>& stamps, const std::string& path,
                                              std::vector<std::string>* warnings) {
  std::vector<std::pair<double, std::size_t>> lines;  // equal stamps stay in the order of the file
  bool sorted = true;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    sorted = sorted && (i == 0 || !(stamps[i] < stamps[i - 1]));
    lines.emplace_back(stamps[i], i);
  }
  if (!sorted) {
    std::sort(lines.begin(), lines.end());
    warn(warnings, path + ": timestamps are not in order, sorted");
  }
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i == 0 || lines[i].first != lines[i - 1].first) order.push_back(lines[i].second);
  }
  if (order.size() < stamps.size()) {
    warn(warnings, path + ": " + std::to_string(stamps.size() - order.size()) + " repeated timestamp(s), the first of each is kept");
  }
  return order;
}

/// Sorts by time and keeps the first of equal stamps, with one warning for each of the two. (Sorting the lines themselves
/// would cost every program that reads a file a second of the compiler's time for each kind of line.)
template <class T, class Stamp>
void sort_by_time(std::vector<T>& rows, Stamp&& stamp, const std::string& path, std::vector<std::string>* warnings) {
  std::vector<double> stamps;
  stamps.reserve(rows.size());
  for (const T& row : rows) stamps.push_back(stamp(row));
  std::vector<T> sorted;
  sorted.reserve(rows.size());
  for (std::size_t i : order_in_time(stamps, path, warnings)) sorted.push_back(std::move(rows[i]));
  rows.swap(sorted);
}
}  // namespace detail

namespace detail {
/// How a line of stamp, position and quaternion is written.
struct PoseLine {
  const char* description;  ///< of all fields, for messages
  const char* names[8];
  std::size_t qw;    ///< field of the quaternion's real part, before or after the three others
  double seconds;    ///< in one unit of the stamp
  bool more_fields;  ///< others may follow
};
inline constexpr PoseLine tum_line(double seconds) {
  return {"timestamp tx ty tz qx qy qz qw", {"timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"}, 7, seconds, false};
}

/// Reads a trajectory of such lines, by the rules of read_trajectory.
[[nodiscard]] inline Trajectory read_pose_lines(const std::string& path, const PoseLine& layout, std::vector<std::string>* warnings) {
  FieldReader reader(path);
  Trajectory trajectory;
  bool warned_norm = false;
  while (reader.next()) {
    if (!layout.more_fields || reader.fields().size() < 8) reader.expect_fields(8, layout.description);
    double v[8];
    const char* bad = nullptr;
    for (std::size_t i = 0; i < 8; ++i) {
      v[i] = reader.number(i, layout.names[i]);
      if (bad == nullptr && !std::isfinite(v[i])) bad = layout.names[i];
    }
    if (bad != nullptr) {
      warn(warnings, reader.where() + bad + " is not finite, line skipped");
      continue;
    }
    for (std::size_t i = 1; i < 4 && bad == nullptr; ++i) {
      if (std::abs(v[i]) > kMaxDistance) bad = layout.names[i];
    }
    if (bad != nullptr) {
      warn(warnings, reader.where() + bad + " is beyond 1e9 m, line skipped");
      continue;
    }
    double largest = 0;  // taken out, so that no square overflows
    for (std::size_t i = 4; i < 8; ++i) largest = std::max(largest, std::abs(v[i]));
    double squares = 0;
    for (std::size_t i = 4; i < 8 && largest > 0; ++i) squares += (v[i] / largest) * (v[i] / largest);
    const double norm = largest * std::sqrt(squares);
    if (!(norm > 1e-9)) throw io_error(reader.where() + "quaternion qx qy qz qw is zero, expected a unit quaternion");
    if (std::abs(norm - 1.0) > 1e-2 && !warned_norm) {
      warned_norm = true;
      warn(warnings, reader.where() + "quaternion is not of unit length, normalised (this and later ones)");
    }
    const std::size_t qx = layout.qw == 4 ? 5 : 4;
    StampedPose pose;
    pose.timestamp = v[0] * layout.seconds;
    pose.T_world_body =
        make_pose(rotation(unit({v[layout.qw] / norm, v[qx] / norm, v[qx + 1] / norm, v[qx + 2] / norm})), {v[1], v[2], v[3]});
    trajectory.push_back(pose);
  }
  if (trajectory.empty()) throw io_error(path + ": no pose found, expected lines '" + layout.description + "'");
  sort_by_time(
      trajectory, [](const StampedPose& p) { return p.timestamp; }, path, warnings);
  return trajectory;
}
}  // namespace detail

/// Reads a trajectory, lines of `timestamp tx ty tz qx qy qz qw` (seconds, metres, unit quaternion).
/// Lines with NaN or infinite values are skipped, as the benchmark's scripts do, and so are positions beyond kMaxDistance; unsorted
/// files are sorted; of repeated stamps the first is kept; quaternions are normalised. Each of these is reported in `warnings`.
/// Other formats are read by io/trajectory_file.hpp.
/// \throws io_error when the file cannot be read, a line is malformed, a quaternion is zero, or no pose is left
[[nodiscard]] inline Trajectory read_trajectory(const std::string& path, std::vector<std::string>* warnings = nullptr) {
  return detail::read_pose_lines(path, detail::tum_line(1), warnings);
}

/// Writes a trajectory that read_trajectory and the benchmark's tools read: stamps with 6 decimals (with as many as
/// are needed to keep neighbours apart, if they are closer), values with 12 significant digits, qw >= 0.
/// \throws io_error when the file cannot be written
inline void write_trajectory(const std::string& path, const Trajectory& trajectory) {
  validate(trajectory, "write_trajectory");
  int decimals = 6;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const double gap = trajectory[i].timestamp - trajectory[i - 1].timestamp;
    while (decimals < 15 && gap < 2.0 * std::pow(10.0, -decimals)) ++decimals;
  }
  std::ofstream file(path);
  if (!file) throw io_error(path + ": cannot open for writing");
  file.imbue(std::locale::classic());
  file << "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& p : trajectory) {
    Eigen::Quaterniond q = unit(quaternion(p.T_world_body));
    if (q.w() < 0) q = {-q.w(), -q.x(), -q.y(), -q.z()};
    const Eigen::Vector3d t = translation(p.T_world_body);
    file << std::fixed;
    file.precision(decimals);
    file << p.timestamp << std::defaultfloat;
    file.precision(12);
    file << ' ' << t.x() << ' ' << t.y() << ' ' << t.z() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << q.w() << '\n';
  }
  file.close();
  if (!file) throw io_error(path + ": writing failed (disk full?)");
}

/// Reads a list of images (rgb.txt, depth.txt), lines of `timestamp file`, sorted by time.
/// \throws io_error when the file cannot be read, a line is malformed, or the list is empty
[[nodiscard]] inline std::vector<FileListEntry> read_file_list(const std::string& path, std::vector<std::string>* warnings = nullptr) {
  detail::FieldReader reader(path);
  std::vector<FileListEntry> list;
  while (reader.next()) {
    reader.expect_fields(2, "timestamp file");
    list.push_back({reader.finite_number(0, "timestamp"), reader.fields()[1]});
  }
  if (list.empty()) throw io_error(path + ": no image found, expected lines 'timestamp file'");
  detail::sort_by_time(
      list, [](const FileListEntry& e) { return e.timestamp; }, path, warnings);
  return list;
}

/// Reads an association file, lines of `timestamp rgb_file timestamp depth_file`, sorted by the time of the colour
/// image.
/// \throws io_error when the file cannot be read, a line is malformed, or the list is empty
[[nodiscard]] inline std::vector<ImageAssociation> read_associations(const std::string& path,
                                                                     std::vector<std::string>* warnings = nullptr) {
  detail::FieldReader reader(path);
  std::vector<ImageAssociation> list;
  while (reader.next()) {
    reader.expect_fields(4, "timestamp rgb_file timestamp depth_file");
    ImageAssociation a;
    a.rgb_timestamp = reader.finite_number(0, "timestamp of the colour image");
    a.rgb_file = reader.fields()[1];
    a.depth_timestamp = reader.finite_number(2, "timestamp of the depth image");
    a.depth_file = reader.fields()[3];
    list.push_back(std::move(a));
  }
  if (list.empty()) {
    throw io_error(path + ": no image found, expected lines 'timestamp rgb_file timestamp depth_file'");
  }
  detail::sort_by_time(
      list, [](const ImageAssociation& a) { return a.rgb_timestamp; }, path, warnings);
  return list;
}

APSO_NAMESPACE_END
