// Detections as text: what is read, and what is refused with file and line.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>
#include <vector>

#include <apso/io/detection_text.hpp>

#include "../contains.hpp"
#include "temporary_file.hpp"

using namespace apso;

namespace {
// What is wrong with a log, or nothing. The message must begin with the file.
std::string log_error(const std::string& text) {
  const TemporaryFile file(text);
  try {
    DetectionLog log(file.path(), 640, 480);
  } catch (const io_error& e) {
    const std::string message = e.what();
    REQUIRE(message.compare(0, file.path().size(), file.path()) == 0);
    return message.substr(file.path().size());
  }
  return {};
}
std::string image_error(const std::string& text) {
  const TemporaryFile file(text);
  try {
    (void)read_detections(file.path(), 640, 480);
  } catch (const io_error& e) {
    const std::string message = e.what();
    REQUIRE(message.compare(0, file.path().size(), file.path()) == 0);
    return message.substr(file.path().size());
  }
  return {};
}
const std::string kGood = "10.5 1 2 30 40 0.5 0\n";
}  // namespace

TEST_CASE("a log of detections with commas, tabs, a byte order mark and line ends of Windows reads like one without") {
  for (const std::string& text : {std::string("10.5 1 2 30 40 0.5 15\n"),
                                  std::string("\xEF\xBB\xBF"
                                              "10.5 1 2 30 40 0.5 15\n"),
                                  std::string("10.5,1,2,30,40,0.5,15\n"), std::string("10.5, 1, 2, 30, 40, 0.5, 15\r\n"),
                                  std::string("# head\n\n\t10.5\t1\t2\t30\t40\t0.5\tcat\n")}) {
    const TemporaryFile file(text);
    DetectionLog log(file.path(), 640, 480);
    REQUIRE(log.at(10.5).size() == 1);
    const Detection& d = log.at(10.5)[0];
    CHECK(d.box.x == 1);
    CHECK(d.box.height == 40);
    CHECK(d.score == 0.5F);
    CHECK(d.class_id == 15);
    CHECK(d.movable);
  }
  const TemporaryFile yolo(
      "\xEF\xBB\xBF"
      "0,0.5,0.5,0.25,0.5,0.875\r\n");
  REQUIRE(read_detections(yolo.path(), 640, 480).size() == 1);
  CHECK(read_detections(yolo.path(), 640, 480)[0].box.width == 160);
}

TEST_CASE("a line of a log that is not what it should be is refused with file, line and field") {
  CHECK(log_error(kGood).empty());
  CHECK(contains(log_error(kGood + "11 1e39 2 30 40 0.5 0\n"), ":2: field 2 (left) is '1e39', expected a number in [-1e+06, 1e+06]"));
  CHECK(contains(log_error(kGood + "11 1 2 1e999 40 0.5 0\n"), ":2: field 4 (width) is '1e999', expected a number in [0, 1e+06]"));
  CHECK(contains(log_error(kGood + "11 1 2 3e38 40 0.5 0\n"), ":2: field 4 (width)"));
  CHECK(contains(log_error(kGood + "11 1 2 -3 40 0.5 0\n"), ":2: field 4 (width)"));
  CHECK(contains(log_error(kGood + "11 1 nan 3 40 0.5 0\n"), ":2: field 3 (top) is 'nan'"));
  CHECK(contains(log_error(kGood + "11 1 2 3 40 1.5 0\n"), ":2: field 6 (score) is '1.5', expected a number in [0, 1]"));
  CHECK(contains(log_error(kGood + "inf 1 2 3 40 0.5 0\n"), ":2: field 1 (timestamp)"));
  CHECK(contains(log_error(kGood + "11 1 2 3 40 0.5 0.7\n"), ":2: field 7 (class_id) is '0.7', expected a whole number"));
  CHECK(contains(log_error(kGood + "11 1 2 3 40 0.5 99999999999\n"), ":2: field 7 (class_id)"));
  CHECK(contains(log_error(kGood + "11 1 2 3 40 0.5 0 7\n"), ":2: found 8 fields, expected 7: timestamp left"));
  CHECK(contains(log_error(kGood + "11 1 2 3 40 0.5\n"), ":2: found 6 fields"));
}

TEST_CASE("a line of a file per image that is not what it should be is refused with file and line") {
  const std::string good = "left:1 top:2 right:3 bottom:8 class:person 0.5\n";
  CHECK(image_error(good).empty());
  CHECK(contains(image_error(good + "left:1 top:2 right:1e39 bottom:8 class:person 0.5\n"), ":2: needs 'right:'"));
  CHECK(contains(image_error(good + "left:-3e38 top:2 right:3e38 bottom:8 class:person\n"), ":2: needs 'left:'"));
  CHECK(contains(image_error(good + "left:1 top:2 right:3 bottom:8 class:0.7\n"), ":2: the class '0.7'"));
  CHECK(contains(image_error(good + "left:1 top:2 right:3 bottom:8 class:person 0.5 0.6\n"), ":2: 'score' is given twice"));
  CHECK(contains(image_error(good + "left:1 left:2 top:2 right:3 bottom:8\n"), ":2: 'left' is given twice"));
  CHECK(contains(image_error(good + "left:1 top:2 right:3 bottom:8 colour:3\n"), ":2: 'colour:' is not known"));
  CHECK(contains(image_error(good + "left:1 top:2 right:3 bottom:8 width:3\n"), ":2: needs"));
  CHECK(contains(image_error(good + "left:1 top:2 right:3 bottom:\n"), ":2: 'bottom:' has no value"));
  CHECK(contains(image_error(good + "left: top:2 right:3 bottom:8\n"), ":2: 'left:' has no value"));
  CHECK(contains(image_error("0.7 0.5 0.5 0.2 0.2\n"), ":1: the class '0.7'"));
  CHECK(contains(image_error("0 0.5 0.5 0.2 0.2 0.9 0.1\n"), ":1: expected 'class_id"));
}

TEST_CASE("more than three hundred objects in one image are refused, in a sequence they are not") {
  std::string many, sequence, image;
  for (int i = 0; i < 301; ++i) {
    many += kGood;
    sequence += std::to_string(i) + " 1 2 30 40 0.5 0\n" + std::to_string(i) + " 5 2 30 40 0.5 0\n";
    image += "0 0.5 0.5 0.2 0.2\n";
  }
  CHECK(contains(log_error(many), ":301: more than 300 objects in one image"));
  CHECK(log_error(sequence).empty());
  CHECK(contains(image_error(image), ":301: more than 300 objects in one image"));
}

TEST_CASE("a message has no control character of the file in it, and no long line") {
  for (const std::string& text : {log_error("11 1 2 3 40 0.5 \x1b[31mred\x07\n"), log_error("\x1b]0;title\x07 1 2 3 4 5 6\n"),
                                  image_error("\x1b[2J 0.5 0.5 0.2 0.2\n"), image_error("0 0.5 \x1b[2J 0.2 0.2\n"),
                                  image_error("left:\x1b[2J top:2 right:3 bottom:8\n"), image_error("\x01\x02:1\n"),
                                  image_error("left:1 top:2 right:3 bottom:8 class:\x9b"
                                              "31m\n"),
                                  image_error(std::string(100000, 'x') + "\n")}) {
    REQUIRE_FALSE(text.empty());
    CHECK(text.size() < 400);
    for (const char c : text) {
      CHECK(static_cast<unsigned char>(c) >= 0x20);
      CHECK(static_cast<unsigned char>(c) < 0x7f);
    }
  }
}

TEST_CASE("a folder where a file is expected is named as one") {
  const std::string folder = std::filesystem::temp_directory_path().string();
  CHECK_THROWS_WITH_AS((void)read_detections(folder, 640, 480),
                       (folder + ": is a folder, expected a text file with the detections of an image").c_str(), io_error);
  CHECK_THROWS_WITH_AS((void)read_class_names(folder),
                       (folder + ": is a folder, expected a text file with one class name per line").c_str(), io_error);
}
