#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <apso/io/camera_yaml.hpp>

using namespace apso;

namespace {
std::string message_of(const std::string& content, CameraModel* camera = nullptr) {
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
bool has(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }
}  // namespace

TEST_CASE("a camera is read from YAML, distortion is optional") {
  CameraModel c;
  CHECK(message_of(kGood + "name: mine\nk1: 0.1\n", &c).empty());
  CHECK(c.name == "mine");
  CHECK(c.pinhole.fy == 510);
  CHECK(c.pinhole.height == 480);
  CHECK(c.depth_scale == 1000);
  CHECK(c.k1 == 0.1);
  CHECK(c.k2 == 0);
}

TEST_CASE("a bad camera file names the field") {
  CHECK(has(message_of("fx: 500\n"), "fy is missing"));
  CHECK(has(message_of(kGood + "k1: much\n"), ":8: field k1 is no number"));
  CHECK(has(message_of(kGood + "k1: .nan\n"), "k1 is not finite"));
  CHECK(has(message_of(kGood + "colour: red\n"), "'colour' is not known"));
  CHECK(has(message_of("fx: -1\nfy: 510\n"), "fx is not positive"));
  CHECK(has(message_of("just text"), "expected fields"));
  CHECK(has(message_of("fx: [1\n"), "expected YAML"));
  CHECK_THROWS_AS((void)camera_from_yaml("/nowhere/camera.yaml"), io_error);
}
