#include <optional>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <apso/io/trajectory_file.hpp>

#include "temporary_file.hpp"

namespace {
using apso::TrajectoryFormat;

TrajectoryFormat detected(const std::string& content) { return apso::detect_trajectory_format(TemporaryFile(content).path()); }
/// The message that reading fails with, without the path in front.
std::string failure(const std::string& content, std::optional<TrajectoryFormat> format = {}, const std::string& times = {}) {
  const TemporaryFile f(content);
  try {
    (void)apso::read_trajectory_file(f.path(), format, times);
  } catch (const apso::io_error& e) {
    const std::string text = e.what();
    return text.compare(0, f.path().size(), f.path()) == 0 ? text.substr(f.path().size()) : text;
  }
  return "no error";
}
// 90 degrees about z, at (1, 2, 3)
const std::string kKitti = "0 -1 0 1 1 0 0 2 0 0 1 3\n";
}  // namespace

TEST_CASE("formats are told apart by fields, commas, size of the stamps and header") {
  CHECK(detected("# c\n1.5 1 2 3 0 0 0 1\n") == TrajectoryFormat::Tum);
  CHECK(detected("1.5, 1, 2, 3, 0, 0, 0, 1\n") == TrajectoryFormat::Tum);
  CHECK(detected("1403636579763555584 1 2 3 0 0 0 1\n") == TrajectoryFormat::TumNs);
  CHECK(detected("1.403636579763555584e18 1 2 3 0 0 0 1\r\n") == TrajectoryFormat::TumNs);
  CHECK(detected(kKitti) == TrajectoryFormat::Kitti);
  CHECK(detected("\n" + kKitti) == TrajectoryFormat::Kitti);
  CHECK(detected("1403636579763555584,1,2,3,1,0,0,0\n") == TrajectoryFormat::Euroc);
  CHECK(detected("#timestamp,x\n1403636579763555584,1,2,3,1,0,0,0,0,0,0,0,0,0,0,0,0\n") == TrajectoryFormat::Euroc);
  // twelve columns with commas are a csv and no matrix
  CHECK(detected("1403636579763555584,1,2,3,1,0,0,0,0,0,0,0\n") == TrajectoryFormat::Euroc);
  CHECK(detected("\xEF\xBB\xBF#timestamp [ns],p_x\n0,1,2,3,1,0,0,0\n") == TrajectoryFormat::Euroc);
  CHECK(failure("1 2 3\n") == ":1: found 3 fields, expected 8 (TUM), 12 (KITTI), or 8 or more with commas and nanoseconds (EuRoC)");
  CHECK(failure("# nothing\n") == ": no pose found");
  CHECK(failure("a b c d e f g h\n") == ":1: field 1 (timestamp) is 'a', expected a number");
  CHECK_THROWS_AS((void)apso::detect_trajectory_format("/no/such/file"), apso::io_error);
}

TEST_CASE("one pose in all formats") {
  const std::string s = "0.70710678118654752";
  const TemporaryFile tum("1.5 1 2 3 0 0 " + s + " " + s + "\n");
  const TemporaryFile ns("1500000000000000000 1 2 3 0 0 " + s + " " + s + "\n");
  const TemporaryFile euroc("#t\n1500000000000000000,1,2,3," + s + ",0,0," + s + ",9,9,9\n");
  const TemporaryFile kitti(kKitti);
  const apso::TrajectoryFile a = apso::read_trajectory_file(tum.path());
  for (const TemporaryFile* f : {&ns, &euroc, &kitti}) {
    const apso::TrajectoryFile b = apso::read_trajectory_file(f->path());
    REQUIRE(b.trajectory.size() == 1);
    CHECK((a.trajectory[0].T_world_body.matrix() - b.trajectory[0].T_world_body.matrix()).cwiseAbs().maxCoeff() < 1e-15);
    CHECK(b.has_stamps == (f != &kitti));
    CHECK(b.trajectory[0].timestamp == (f == &kitti ? 0.0 : 1.5e9));
  }
}

TEST_CASE("KITTI: stamps are line numbers or those of times.txt; skipped lines keep the numbers of the others") {
  const std::string nan = "nan 0 0 0 0 1 0 0 0 0 1 0\n";
  const TemporaryFile f(kKitti + nan + kKitti);
  std::vector<std::string> warnings;
  const apso::Trajectory t = apso::read_kitti_trajectory(f.path(), "", &warnings);
  REQUIRE(t.size() == 2);
  CHECK(t[1].timestamp == 2);
  REQUIRE(warnings.size() == 1);
  CHECK(warnings[0] == f.path() + ":2: r11 is not finite, line skipped");
  const TemporaryFile times("0\n1.036e-01\n2.07e-01\n");
  const apso::TrajectoryFile with = apso::read_trajectory_file(f.path(), {}, times.path());
  CHECK(with.has_stamps);
  CHECK(with.trajectory[1].timestamp == 0.207);

  const TemporaryFile longer("0\n1\n2\n3\n");
  warnings.clear();
  CHECK(apso::read_kitti_trajectory(f.path(), longer.path(), &warnings).size() == 2);
  CHECK(warnings.size() == 2);
  const TemporaryFile shorter("0\n1\n");
  CHECK(failure(kKitti + kKitti + kKitti, {}, shorter.path()).find(":3: there is no time for this pose") == 0);
  const TemporaryFile falling("0\n1\n1\n");
  CHECK(failure(kKitti, {}, falling.path()) == falling.path() + ":3: the times must increase");
  CHECK(failure(kKitti, {}, "/no/such/times").find("cannot open") != std::string::npos);
}

TEST_CASE("KITTI: rotations are made orthonormal; what is no rigid motion is refused with its line") {
  const TemporaryFile f("0.99999 -0.0002 0 1 0.0003 1.00001 0 2 0 0 1 3\n");
  const Eigen::Matrix3d R = apso::read_kitti_trajectory(f.path())[0].T_world_body.linear();
  CHECK((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-14);
  CHECK(R(1, 0) == doctest::Approx(0.00025).epsilon(1e-3));
  CHECK(failure(kKitti + "2 0 0 0 0 1 0 0 0 0 1 0\n").find(":2: the matrix is no rigid motion") == 0);
  CHECK(failure("-1 0 0 0 0 1 0 0 0 0 1 0\n").find(":1: the matrix is no rigid motion") == 0);  // a mirror
  CHECK(failure("1 0 0 2e9 0 1 0 0 0 0 1 0\n").find(":1: the matrix is no rigid motion") == 0);
  CHECK(failure(kKitti + "1 2 3\n").find(":2: found 3 fields, expected 12") == 0);
}

TEST_CASE("a forced format is not told from the file") {
  CHECK(failure(kKitti, TrajectoryFormat::Tum).find(":1: found 12 fields, expected 8") == 0);
  CHECK(failure("1.5 1 2 3 0 0 0 1\n", TrajectoryFormat::Kitti).find(":1: found 8 fields, expected 12") == 0);
  CHECK(failure("1 2 3\n", TrajectoryFormat::Euroc).find(":1: found 3 fields, expected 8: timestamp, px") == 0);
  // a quaternion with its real part first, read as if it were last, is another rotation: the order is the format's
  const TemporaryFile f("1500000000000000000,0,0,0,0.6,0.8,0,0\n");
  const auto w = [&](TrajectoryFormat format) {
    return apso::quaternion(apso::read_trajectory_file(f.path(), format).trajectory[0].T_world_body).w();
  };
  CHECK(w(TrajectoryFormat::Euroc) == doctest::Approx(0.6));
  CHECK(w(TrajectoryFormat::TumNs) == doctest::Approx(0.0));
  CHECK(apso::read_trajectory_file(f.path(), TrajectoryFormat::Euroc).trajectory[0].timestamp == 1.5e9);
}
