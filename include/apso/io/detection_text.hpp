/// \file
/// Detections that another program wrote: one text file for a sequence, or a folder with one text file per image.
///
/// | form of a line                                        | where                    | coordinates               |
/// |-------------------------------------------------------|--------------------------|---------------------------|
/// | `timestamp left top width height score class_id`      | one file for all images  | pixels                    |
/// | `class_id centre_x centre_y width height [score]`     | per image, YOLO's output | shares of the image, [0,1] |
/// | `left:L top:T right:R bottom:B class:NAME [score]`    | per image, YOLO scripts  | pixels                    |
///
/// Files per image are named by the stamp of the colour image, e.g. 1341846647.734028.txt. In the last form `width:` and
/// `height:` may stand instead of `right:` and `bottom:`, the score may be `score:S`, and blanks after colons are accepted.
/// A missing score is 1. Comments, separators and line ends are as in field_reader.hpp. What a form does not have is refused: more
/// fields, a class that is no whole number or known name, coordinates beyond kMaxBoxCoordinate, and more than kMaxObjects objects
/// in one image.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
#include <map>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/printable.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN

/// Names of the 80 classes of the COCO data set, in the order of networks trained on it; 0 = person.
[[nodiscard]] inline const std::vector<std::string>& coco_classes() {
  static const std::vector<std::string> names{
      "person",         "bicycle",    "car",           "motorcycle",    "airplane",     "bus",           "train",
      "truck",          "boat",       "traffic light", "fire hydrant",  "stop sign",    "parking meter", "bench",
      "bird",           "cat",        "dog",           "horse",         "sheep",        "cow",           "elephant",
      "bear",           "zebra",      "giraffe",       "backpack",      "umbrella",     "handbag",       "tie",
      "suitcase",       "frisbee",    "skis",          "snowboard",     "sports ball",  "kite",          "baseball bat",
      "baseball glove", "skateboard", "surfboard",     "tennis racket", "bottle",       "wine glass",    "cup",
      "fork",           "knife",      "spoon",         "bowl",          "banana",       "apple",         "sandwich",
      "orange",         "broccoli",   "carrot",        "hot dog",       "pizza",        "donut",         "cake",
      "chair",          "couch",      "potted plant",  "bed",           "dining table", "toilet",        "tv",
      "laptop",         "mouse",      "remote",        "keyboard",      "cell phone",   "microwave",     "oven",
      "toaster",        "sink",       "refrigerator",  "book",          "clock",        "vase",          "scissors",
      "teddy bear",     "hair drier", "toothbrush"};
  return names;
}

/// Which classes there are, and which of them can move.
struct ClassList {
  std::vector<std::string> names = coco_classes();  ///< by class id; a class without a name is called by its number
  std::vector<int> movable{0, 15, 16};              ///< people, cats, dogs

  /// Id of a name or of a number in text; -1 when it is neither.
  [[nodiscard]] int id_of(const std::string& text) const {
    const auto it = std::find(names.begin(), names.end(), text);
    if (it != names.end()) return static_cast<int>(it - names.begin());
    if (text.empty() || text.find_first_not_of("0123456789") != std::string::npos || text.size() > 6) return -1;
    return std::atoi(text.c_str());
  }
  [[nodiscard]] bool can_move(int id) const { return std::find(movable.begin(), movable.end(), id) != movable.end(); }
};

/// Class names from a file, one per line. Throws io_error when it cannot be read or is empty.
[[nodiscard]] inline std::vector<std::string> read_class_names(const std::string& file) {
  std::ifstream stream = detail::open_text(file, "a text file with one class name per line");
  std::vector<std::string> names;
  for (std::string line; std::getline(stream, line);) {
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back())) != 0) line.pop_back();
    if (!line.empty()) names.push_back(line);
  }
  if (names.empty()) throw io_error(file + ": no class name in it, expected one per line");
  return names;
}

/// Largest coordinate of a box and largest size that is read [px].
inline constexpr double kMaxBoxCoordinate = 1e6;

namespace detail {
[[nodiscard]] inline bool number_in(const std::string& text, double& value) {
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  return static_cast<bool>(stream >> value) && stream.peek() == std::istringstream::traits_type::eof() && std::isfinite(value);
}

/// A line `class_id centre_x centre_y width height [score]`. Returns what is wrong, or nothing.
[[nodiscard]] inline std::string parse_shares(const std::vector<std::string>& fields, int width, int height, const ClassList& classes,
                                              Detection& d) {
  if (fields.size() != 5 && fields.size() != 6)
    return "expected 'class_id centre_x centre_y width height [score]' or 'left:.. top:.. right:.. bottom:.. class:.. score'";
  d.class_id = classes.id_of(fields[0]);
  if (d.class_id < 0) return "the class '" + printable(fields[0]) + "' is neither a whole number nor a known name";
  double v[5] = {0, 0, 0, 0, 1};
  for (std::size_t i = 1; i < fields.size(); ++i) {
    if (!number_in(fields[i], v[i - 1])) return "'" + printable(fields[i]) + "' is not a number";
    if (!(v[i - 1] >= 0 && v[i - 1] <= 1)) return "'" + printable(fields[i]) + "' is outside of [0,1]; boxes are shares of the image here";
  }
  d.box.width = static_cast<float>(v[2] * width);
  d.box.height = static_cast<float>(v[3] * height);
  d.box.x = static_cast<float>(v[0] * width) - d.box.width / 2;
  d.box.y = static_cast<float>(v[1] * height) - d.box.height / 2;
  d.score = static_cast<float>(v[4]);
  return {};
}

/// The pairs of a line `name:value name: value ... [score]`. Returns what is wrong, or nothing.
[[nodiscard]] inline std::string collect_pairs(const std::vector<std::string>& fields, std::map<std::string, std::string>& value) {
  std::string key;  // whose value comes next; the class may have several words
  const auto put = [&](const std::string& name, const std::string& text) -> std::string {
    static constexpr const char* known[] = {"left", "top", "right", "bottom", "width", "height", "class", "score"};
    if (std::none_of(std::begin(known), std::end(known), [&](const char* k) { return name == k; }))
      return "'" + printable(name) + ":' is not known, expected left top right bottom width height class score";
    return value.emplace(name, text).second ? std::string() : "'" + name + "' is given twice";
  };
  for (const std::string& field : fields) {
    const std::size_t colon = field.find(':');
    std::string rest = field;
    if (colon != std::string::npos) {
      if (!key.empty() && value.count(key) == 0) return "'" + printable(key) + ":' has no value";
      key = field.substr(0, colon);
      if (key == "conf" || key == "confidence" || key == "prob") key = "score";
      rest = field.substr(colon + 1);
      if (rest.empty()) continue;
    }
    double number = 0;
    const bool more_of_class = key == "class" && value.count("class") != 0;
    if (more_of_class && !number_in(rest, number)) {
      value["class"] += ' ' + rest;  // "class:traffic light 0.79"
      continue;
    }
    std::string wrong = put(key.empty() || more_of_class ? "score" : key, rest);
    if (!wrong.empty()) return wrong;
    if (key != "class" || more_of_class) key.clear();
  }
  return !key.empty() && value.count(key) == 0 ? "'" + printable(key) + ":' has no value" : std::string();
}

/// A line of such pairs. Returns what is wrong, or nothing.
[[nodiscard]] inline std::string parse_pairs(const std::vector<std::string>& fields, const ClassList& classes, Detection& d) {
  std::map<std::string, std::string> value;
  std::string wrong = collect_pairs(fields, value);
  if (!wrong.empty()) return wrong;
  const auto get = [&](const char* name, double& out) {
    return value.count(name) != 0 && number_in(value[name], out) && std::abs(out) <= kMaxBoxCoordinate;
  };
  const bool corners = value.count("right") != 0 && value.count("bottom") != 0;
  if (value.size() != 4 + value.count("class") + value.count("score"))
    return "needs 'left:' and 'top:', and either 'right:' and 'bottom:' or 'width:' and 'height:'";
  double v[5];
  v[4] = 1;
  if (!get("left", v[0]) || !get("top", v[1])) return "needs 'left:' and 'top:' with numbers in [-1e6, 1e6]";
  if (!get(corners ? "right" : "width", v[2]) || !get(corners ? "bottom" : "height", v[3]))
    return "needs 'right:' and 'bottom:', or 'width:' and 'height:', with numbers in [-1e6, 1e6]";
  if (corners) {
    v[2] -= v[0];
    v[3] -= v[1];
  }
  if (!(v[2] >= 0 && v[3] >= 0)) return "the box has a negative size";
  if (value.count("score") != 0 && !(get("score", v[4]) && v[4] >= 0 && v[4] <= 1)) return "the score must be in [0,1]";
  d.class_id = classes.id_of(value.count("class") != 0 ? value["class"] : "0");
  if (d.class_id < 0) return "the class '" + printable(value["class"]) + "' is neither a whole number nor a known name";
  d.box = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), static_cast<float>(v[3])};
  d.score = static_cast<float>(v[4]);
  return {};
}

/// Takes in one more object of an image. Throws io_error when there are too many.
inline void add_object(const Detection& d, const std::string& where, std::vector<Detection>& objects) {
  if (objects.size() == kMaxObjects)
    throw io_error(where + "more than " + std::to_string(kMaxObjects) + " objects in one image, leave out the weaker ones");
  objects.push_back(d);
}
}  // namespace detail

/// Detections of one image from a file in one of the two forms per image.
/// \param width, height of the image [px]
/// Throws io_error naming file and line.
[[nodiscard]] inline std::vector<Detection> read_detections(const std::string& file, int width, int height, const ClassList& classes = {}) {
  detail::FieldReader reader(file, "a text file with the detections of an image");
  std::vector<Detection> found;
  while (reader.next()) {
    const std::vector<std::string>& fields = reader.fields();
    const bool pairs = std::any_of(fields.begin(), fields.end(), [](const std::string& f) { return f.find(':') != std::string::npos; });
    Detection d;
    const std::string wrong = pairs ? detail::parse_pairs(fields, classes, d) : detail::parse_shares(fields, width, height, classes, d);
    if (!wrong.empty()) throw io_error(reader.where() + wrong + ", got '" + printable(reader.line(), 100) + "'");
    d.movable = classes.can_move(d.class_id);
    detail::add_object(d, reader.where(), found);
  }
  return found;
}

/// Files of a folder that are named by a stamp, e.g. 1341846647.734028.png or 1341846647.734028_person.png.
class StampedFiles {
 public:
  /// \param extensions e.g. {".png", ".jpg"}; throws io_error when the folder has no such file
  StampedFiles(const std::string& folder, const std::vector<std::string>& extensions, double tolerance = 0.01) : tolerance_(tolerance) {
    namespace fs = std::filesystem;
    std::string kinds;
    for (const std::string& e : extensions) kinds += (kinds.empty() ? "*" : ", *") + e;
    std::error_code code;
    if (!fs::is_directory(folder, code)) throw io_error(folder + ": no such folder, expected one with " + kinds);
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      double stamp = 0;
      const bool fits = std::find(extensions.begin(), extensions.end(), entry.path().extension().string()) != extensions.end();
      const std::string stem = entry.path().stem().string();
      if (fits && detail::number_in(stem.substr(0, stem.find('_')), stamp)) files_[stamp] = entry.path().string();
    }
    if (files_.empty())
      throw io_error(folder + ": no file " + kinds + " that is named by a stamp, e.g. 1341846647.734028" + extensions.front());
  }
  /// The file nearest to a stamp, within the tolerance; empty when there is none.
  [[nodiscard]] std::string at(double stamp) const {
    std::string best;
    double least = tolerance_;
    for (auto it = files_.lower_bound(stamp - tolerance_); it != files_.end() && it->first <= stamp + tolerance_; ++it) {
      if (std::abs(it->first - stamp) > least) continue;
      least = std::abs(it->first - stamp);
      best = it->second;
    }
    return best;
  }
  [[nodiscard]] std::size_t size() const { return files_.size(); }

 private:
  double tolerance_;
  std::map<double, std::string> files_;
};

/// Detections of a whole sequence, looked up by the stamp of an image.
class DetectionLog {
 public:
  /// \param path a file with stamps in its lines, or a folder of files per image
  /// \param width, height of the images [px]
  /// Throws io_error naming file and line. Files of a folder are read when they are asked for.
  DetectionLog(const std::string& path, int width, int height, ClassList classes = {})
      : width_(width), height_(height), classes_(std::move(classes)) {
    std::error_code code;
    if (std::filesystem::is_directory(path, code)) {
      files_.emplace_back(path, std::vector<std::string>{".txt"});
    } else {
      read_log(path);
    }
  }
  /// Detections within 10 ms of the stamp; empty if there are none. Valid until the next call.
  const std::vector<Detection>& at(double stamp) {
    if (!files_.empty()) {
      const std::string file = files_.front().at(stamp);
      found_ = file.empty() ? std::vector<Detection>{} : read_detections(file, width_, height_, classes_);
      return found_;
    }
    const auto it = lines_.lower_bound(stamp - 0.01);
    return it != lines_.end() && it->first <= stamp + 0.01 ? it->second : none_;
  }
  /// There is a line or a file for this stamp; a file may say that nothing was found.
  [[nodiscard]] bool covers(double stamp) { return files_.empty() ? !at(stamp).empty() : !files_.front().at(stamp).empty(); }

 private:
  void read_log(const std::string& file) {
    detail::FieldReader reader(file, "a text file of detections");
    constexpr double limit = kMaxBoxCoordinate;
    while (reader.next()) {
      reader.expect_fields(7, "timestamp left top width height score class_id");
      const double stamp = reader.finite_number(0, "timestamp");
      Detection d;
      d.box.x = static_cast<float>(reader.number_in(1, "left", -limit, limit));
      d.box.y = static_cast<float>(reader.number_in(2, "top", -limit, limit));
      d.box.width = static_cast<float>(reader.number_in(3, "width", 0, limit));
      d.box.height = static_cast<float>(reader.number_in(4, "height", 0, limit));
      d.score = static_cast<float>(reader.number_in(5, "score", 0, 1));
      d.class_id = classes_.id_of(reader.fields()[6]);
      if (d.class_id < 0) {
        throw io_error(reader.where() + "field 7 (class_id) is '" + printable(reader.fields()[6], 32) +
                       "', expected a whole number or a known name without blanks");
      }
      d.movable = classes_.can_move(d.class_id);
      detail::add_object(d, reader.where(), lines_[stamp]);
    }
  }

  int width_;
  int height_;
  ClassList classes_;
  std::vector<StampedFiles> files_;  // one or none
  std::map<double, std::vector<Detection>> lines_;
  std::vector<Detection> found_;
  std::vector<Detection> none_;
};

APSO_NAMESPACE_END
