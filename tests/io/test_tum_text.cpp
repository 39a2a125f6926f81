#include <clocale>
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <apso/io/tum_text.hpp>

#include "temporary_file.hpp"

namespace {
/// The message read_trajectory fails with, without the path in front.
std::string tum_error(const std::string& content) {
  const TemporaryFile f(content);
  try {
    (void)apso::read_trajectory(f.path());
  } catch (const apso::io_error& e) {
    const std::string text = e.what();
    CHECK(text.compare(0, f.path().size(), f.path()) == 0);
    CHECK(text.find('\n') == std::string::npos);
    return text.substr(f.path().size());
  }
  return "no error";
}
const char* const good = "1.5 1 2 3 0 0 0 1\n";
}  // namespace

TEST_CASE("a trajectory with comments, blank lines, tabs, commas, Windows line ends and a byte order mark") {
  const TemporaryFile f("\xEF\xBB\xBF# comment\r\n\r\n   \n1.5 1 2 3 0 0 0 1\r\n  2.5,\t-1e-3, 2. ,+3 0 0 0.6 0.8\n# end");
  std::vector<std::string> warnings;
  const apso::Trajectory t = apso::read_trajectory(f.path(), &warnings);
  CHECK(warnings.empty());
  REQUIRE(t.size() == 2);
  CHECK(t[0].timestamp == 1.5);
  CHECK(t[0].T_world_body.translation() == Eigen::Vector3d(1, 2, 3));
  CHECK(t[0].T_world_body.linear() == Eigen::Matrix3d::Identity());
  CHECK(t[1].timestamp == 2.5);
  CHECK(t[1].T_world_body.translation() == Eigen::Vector3d(-1e-3, 2, 3));
  // quaternion (0, 0, 0.6, 0.8): turn about z with cos = 0.28, sin = 0.96
  CHECK(t[1].T_world_body(0, 0) == doctest::Approx(0.28));
  CHECK(t[1].T_world_body(1, 0) == doctest::Approx(0.96));
}

TEST_CASE("malformed lines name line, field and what was expected") {
  CHECK(tum_error(std::string(good) + "2.5 1 2 3\n") == ":2: found 4 fields, expected 8: timestamp tx ty tz qx qy qz qw");
  CHECK(tum_error("1.5\n") == ":1: found 1 field, expected 8: timestamp tx ty tz qx qy qz qw");
  CHECK(tum_error("1.5 1 2 3 0 0 0 1 9\n") == ":1: found 9 fields, expected 8: timestamp tx ty tz qx qy qz qw");
  CHECK(tum_error("# a\n\n1.5 1 x2 3 0 0 0 1\n") == ":3: field 3 (ty) is 'x2', expected a number");
  CHECK(tum_error("1.5 1 2 3 0 0 0 1w\n") == ":1: field 8 (qw) is '1w', expected a number");
  CHECK(tum_error("1.5 1 2 1.2.3 0 0 0 1\n") == ":1: field 4 (tz) is '1.2.3', expected a number");
  CHECK(tum_error("-- 1 2 3 0 0 0 1\n") == ":1: field 1 (timestamp) is '--', expected a number");
  CHECK(tum_error("1.5 1 2 3 0 0 0 0\n") == ":1: quaternion qx qy qz qw is zero, expected a unit quaternion");
}

TEST_CASE("a file without poses, one that is not there, and a folder") {
  CHECK(tum_error("").find("no pose found") != std::string::npos);
  CHECK(tum_error("# only\n\n# comments\n").find("no pose found") != std::string::npos);
  CHECK(tum_error("1 nan 2 3 0 0 0 1\n").find("no pose found") != std::string::npos);
  CHECK_THROWS_WITH_AS((void)apso::read_trajectory("/no/such/file.txt"), "/no/such/file.txt: cannot open, expected a readable text file",
                       apso::io_error);
  CHECK_THROWS_AS((void)apso::read_trajectory("/tmp"), apso::io_error);
}

TEST_CASE("a binary file fails with a printable message") {
  const std::string text = tum_error(std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\xff", 18));
  CHECK(text.find("expected") != std::string::npos);
  for (const char c : text) CHECK(static_cast<unsigned char>(c) < 0x7f);
}

TEST_CASE("lines that are not finite are skipped and reported") {
  const TemporaryFile f(std::string(good) +
                        "2 NaN 2 3 0 0 0 1\n3 1 -inf 3 0 0 0 1\n4 1 2 3 0 0 0 1e999\nnan 1 2 3 0 0 0 1\n6 1 2 3 0 0 0 1\n");
  std::vector<std::string> warnings;
  const apso::Trajectory t = apso::read_trajectory(f.path(), &warnings);
  REQUIRE(t.size() == 2);
  CHECK(t[1].timestamp == 6);
  REQUIRE(warnings.size() == 4);
  CHECK(warnings[0] == f.path() + ":2: tx is not finite, line skipped");
  CHECK(warnings[1] == f.path() + ":3: ty is not finite, line skipped");
  CHECK(warnings[2] == f.path() + ":4: qw is not finite, line skipped");
  CHECK(warnings[3] == f.path() + ":5: timestamp is not finite, line skipped");
  CHECK(apso::read_trajectory(f.path()).size() == 2);  // warnings are optional
}

TEST_CASE("unsorted stamps are sorted, of repeated ones the first is kept, both reported") {
  const TemporaryFile f("3 30 0 0 0 0 0 1\n1 10 0 0 0 0 0 1\n3 31 0 0 0 0 0 1\n2 20 0 0 0 0 0 1\n");
  std::vector<std::string> warnings;
  const apso::Trajectory t = apso::read_trajectory(f.path(), &warnings);
  REQUIRE(t.size() == 3);
  for (int i = 0; i < 3; ++i) {
    CHECK(t[static_cast<std::size_t>(i)].timestamp == i + 1);
    CHECK(t[static_cast<std::size_t>(i)].T_world_body.translation().x() == 10 * (i + 1));
  }
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0].find("not in order") != std::string::npos);
  CHECK(warnings[1].find("1 repeated timestamp") != std::string::npos);
  CHECK_NOTHROW(apso::validate(t, "t"));
}

TEST_CASE("a quaternion of another length is normalised and reported once") {
  const TemporaryFile f("1 0 0 0 0 0 0 2\n2 0 0 0 0 0 6 8\n");
  std::vector<std::string> warnings;
  const apso::Trajectory t = apso::read_trajectory(f.path(), &warnings);
  CHECK(warnings.size() == 1);
  CHECK(t[0].T_world_body.linear() == Eigen::Matrix3d::Identity());
  CHECK(t[1].T_world_body(0, 0) == doctest::Approx(0.28));
  CHECK(t[1].T_world_body.linear().determinant() == doctest::Approx(1.0));
}

TEST_CASE("what is written is read back") {
  apso::Trajectory t;
  for (int i = 0; i < 50; ++i) {
    apso::Twist xi;
    xi << 0.1 * i, -1e-7 * i, 1234.56789 * i, 0.13 * i, -0.05 * i, 0.07 * i;  // turns beyond pi too
    t.push_back({1341846313.592026 + 0.033 * i, apso::se3_exp(xi)});
  }
  const TemporaryFile f("");
  apso::write_trajectory(f.path(), t);
  std::vector<std::string> warnings;
  const apso::Trajectory back = apso::read_trajectory(f.path(), &warnings);
  CHECK(warnings.empty());
  REQUIRE(back.size() == t.size());
  for (std::size_t i = 0; i < t.size(); ++i) {
    CHECK(std::abs(back[i].timestamp - t[i].timestamp) < 1e-6);
    CHECK((apso::inverse(t[i].T_world_body) * back[i].T_world_body).isApprox(apso::Pose::Identity(), 1e-6));
    CHECK((t[i].T_world_body.linear() - back[i].T_world_body.linear()).norm() < 1e-10);
  }
}

TEST_CASE("the format written: stamp with six decimals, qw not negative") {
  apso::Trajectory t(1);
  t[0].timestamp = 1341846313.592026;
  t[0].T_world_body.translation() = Eigen::Vector3d(0.123456789012, -2, 0);
  const TemporaryFile f("");
  apso::write_trajectory(f.path(), t);
  std::ifstream in(f.path());
  std::string header;
  std::string line;
  std::getline(in, header);
  std::getline(in, line);
  CHECK(header == "# timestamp tx ty tz qx qy qz qw");
  CHECK(line == "1341846313.592026 0.123456789012 -2 0 0 0 0 1");
}

TEST_CASE("stamps closer than a microsecond stay apart") {
  apso::Trajectory t(3);
  t[1].timestamp = 1e-7;
  t[2].timestamp = 3e-7;
  const TemporaryFile f("");
  apso::write_trajectory(f.path(), t);
  CHECK(apso::read_trajectory(f.path()).size() == 3);
}

TEST_CASE("writing where nothing can be written, and writing what is no trajectory") {
  CHECK_THROWS_AS(apso::write_trajectory("/no/such/folder/t.txt", {}), apso::io_error);
  apso::Trajectory t(2);  // the same stamp twice
  CHECK_THROWS_AS(apso::write_trajectory("/tmp/never_written", t), apso::contract_error);
}

TEST_CASE("the decimal point does not depend on the locale") {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "C.UTF-8"}) {
    if (std::setlocale(LC_ALL, name) == nullptr) continue;
    const TemporaryFile f("1.5 0.25 2 3 0 0 0 1\n");
    CHECK(apso::read_trajectory(f.path())[0].T_world_body.translation().x() == 0.25);
  }
  std::setlocale(LC_ALL, before.c_str());
}

TEST_CASE("lists of images") {
  const TemporaryFile f("# color images\n# timestamp filename\n2.5 rgb/2.5.png\n1.5 rgb/1.5.png\n2.5 rgb/again.png\n");
  std::vector<std::string> warnings;
  const auto list = apso::read_file_list(f.path(), &warnings);
  REQUIRE(list.size() == 2);
  CHECK(list[0].timestamp == 1.5);
  CHECK(list[0].file == "rgb/1.5.png");
  CHECK(list[1].file == "rgb/2.5.png");
  CHECK(warnings.size() == 2);
  const TemporaryFile three("1.5 a b\n");
  CHECK_THROWS_WITH_AS((void)apso::read_file_list(three.path()), (three.path() + ":1: found 3 fields, expected 2: timestamp file").c_str(),
                       apso::io_error);
  const TemporaryFile name("rgb/1.png 1.5\n");
  CHECK_THROWS_AS((void)apso::read_file_list(name.path()), apso::io_error);
  const TemporaryFile nan("nan rgb/1.png\n");
  CHECK_THROWS_AS((void)apso::read_file_list(nan.path()), apso::io_error);
  const TemporaryFile empty("#\n");
  CHECK_THROWS_AS((void)apso::read_file_list(empty.path()), apso::io_error);
}

TEST_CASE("associations of images") {
  const TemporaryFile f("1.5 rgb/1.5.png 1.6 depth/1.6.png\n2.5 rgb/2.5.png 2.4 depth/2.4.png\n");
  const auto list = apso::read_associations(f.path());
  REQUIRE(list.size() == 2);
  CHECK(list[1].rgb_timestamp == 2.5);
  CHECK(list[1].rgb_file == "rgb/2.5.png");
  CHECK(list[1].depth_timestamp == 2.4);
  CHECK(list[1].depth_file == "depth/2.4.png");
  const TemporaryFile bad("1.5 rgb/1.5.png depth/1.6.png 1.6\n");
  CHECK_THROWS_WITH_AS((void)apso::read_associations(bad.path()),
                       (bad.path() + ":1: field 3 (timestamp of the depth image) is 'depth/1.6.png', expected a number").c_str(),
                       apso::io_error);
  const TemporaryFile two("1.5 rgb/1.5.png\n");
  CHECK_THROWS_AS((void)apso::read_associations(two.path()), apso::io_error);
}
