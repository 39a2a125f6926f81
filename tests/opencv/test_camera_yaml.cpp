#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <apso/io/camera_yaml.hpp>

#include "../contains.hpp"

using namespace apso;

namespace {
std::string camera_error(const std::string& content, CameraModel* camera = nullptr) {
  const auto path = std::filesystem::temp_directory_path() / "apso_camera_test.yaml";
  std::ofstream(path) << content;
  std::string message;
  try {
    const CameraModel c = camera_from_yaml(path.string());
    if (camera != nullptr) *camera = c;
  } catch (const io_error& e) {
    message = e.what();
  }
  std::filesystem::remove(path);
  return message;
}
const std::string kGood = "fx: 500\nfy: 510\ncx: 320\ncy: 240\nwidth: 640\nheight: 480\ndepth_scale: 1000\n";
}  // namespace

TEST_CASE("a camera is read from YAML, distortion is optional") {
  CameraModel c;
  CHECK(camera_error(kGood + "name: mine\nk1: 0.1\n", &c).empty());
  CHECK(c.name == "mine");
  CHECK(c.pinhole.fy == 510);
  CHECK(c.pinhole.height == 480);
  CHECK(c.depth_scale == 1000);
  CHECK(c.k1 == 0.1);
  CHECK(c.k2 == 0);
  CHECK(c.readout == 0);
  CHECK(camera_error(kGood + "readout: -0.03\n", &c).empty());
  CHECK(c.readout == -0.03);
  CHECK(c.stamp_delay == 0);
  CHECK(camera_error(kGood + "stamp_delay: 0.015\n", &c).empty());
  CHECK(c.stamp_delay == 0.015);
  CHECK(c.inverse_depth_sigma == 0);
  CHECK(camera_error(kGood + "inverse_depth_sigma: 0.01\n", &c).empty());
  CHECK(c.inverse_depth_sigma == 0.01);
}

TEST_CASE("a bad camera file names the field") {
  CHECK(contains(camera_error("fx: 500\n"), "fy is missing"));
  CHECK(contains(camera_error(kGood + "k1: much\n"), ":8: field k1 is no number"));
  CHECK(contains(camera_error(kGood + "k1: .nan\n"), ":8: field k1 is .nan, expected a number in [-1e+06, 1e+06]"));
  CHECK(contains(camera_error(kGood + "readout: 30\n"), ":8: field readout is 30, expected a number in [-0.2, 0.2]"));
  CHECK(contains(camera_error(kGood + "stamp_delay: 15\n"), ":8: field stamp_delay is 15, expected a number in [-0.2, 0.2]"));
  CHECK(contains(camera_error(kGood + "inverse_depth_sigma: 3\n"), ":8: field inverse_depth_sigma is 3, expected a number in [1e-06, 1]"));
  CHECK(contains(camera_error(kGood + "inverse_depth_sigma: 1e-300\n"), ":8: field inverse_depth_sigma is 1e-300, expected a number in ["));
  CHECK(contains(camera_error(kGood + "colour: red\n"), "'colour' is not known"));
  CHECK(contains(camera_error("fx: -1\nfy: 510\n"), ":1: field fx is -1, expected a number in [0.001, 1e+06]"));
  CHECK(contains(camera_error("just text"), "expected fields"));
  CHECK(contains(camera_error("fx: [1\n"), "not valid YAML"));
  CHECK_THROWS_AS((void)camera_from_yaml("/nowhere/camera.yaml"), io_error);
}

TEST_CASE("a camera that cannot be is refused with line, field and range") {
  const auto with = [](const std::string& field, const std::string& value) {
    std::string text = kGood;
    const std::size_t at = text.find(field + ": ");
    return camera_error(text.substr(0, at) + field + ": " + value + text.substr(text.find('\n', at)));
  };
  for (const char* bad : {"1e300", "1e-300", "0", ".inf"}) {
    CHECK(contains(with("fx", bad), (std::string(":1: field fx is ") + bad + ", expected a number in [0.001, 1e+06]").c_str()));
    CHECK(contains(with("fy", bad), ":2: field fy is "));
    CHECK(contains(with("depth_scale", bad),
                   (std::string(":7: field depth_scale is ") + bad + ", expected a number in [0.001, 1e+09]").c_str()));
  }
  CHECK(contains(with("cy", "-1e300"), ":4: field cy is -1e300, expected a number in [-1e+06, 1e+06]"));
  CHECK(contains(with("width", "100000"), ":5: field width is 100000, expected a number in [1, 32767]"));
  CHECK(contains(with("height", "1e400"), ":6: field height is no number"));
  CHECK(contains(with("height", "480.5"), "field height, expected a whole number"));
  CHECK(contains(camera_error("fx: 500\nfy: 510\ncx: 320\ncy: 240\nwidth: 30000\nheight: 30000\ndepth_scale: 1000\n"),
                 "fields width and height are 30000 x 30000, expected at most 100000000 pixels"));
  CHECK(with("fx", "1e6").empty());
  CHECK(with("depth_scale", "1").empty());
  CameraModel c;
  c.pinhole = {500, 500, 320, 240, 640, 480};
  c.validate();
  c.depth_scale = 1e-300;
  CHECK_THROWS_AS(c.validate(), contract_error);
  c.depth_scale = 1000;
  c.k3 = 1e300;
  CHECK_THROWS_AS(c.validate(), contract_error);
}

TEST_CASE("a camera file that says two things is refused, and a folder is named") {
  CHECK(contains(camera_error(kGood + "fx: 501\n"), ":8: 'fx' is given twice"));
  CHECK(contains(camera_error(kGood + "---\n" + kGood), ": a second document begins"));
  CHECK(contains(camera_error(kGood + "? [1]\n: 2\n"), ": a name that is no text"));
  const std::string folder = std::filesystem::temp_directory_path().string();
  try {
    (void)camera_from_yaml(folder);
    CHECK(false);
  } catch (const io_error& e) {
    CHECK(std::string(e.what()) == folder + ": is a folder, expected a YAML file that describes a camera");
  }
}
