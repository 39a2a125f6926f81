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
/// `height:` may stand instead of `right:` and `bottom:`, the score may be `score:S`, and blanks after colons and commas
/// between fields are accepted. A missing score is 1.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <locale>
#include <map>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN

/// Names of the 80 classes of the COCO data set, in the order of networks trained on it; 0 = person.
[[nodiscard]] inline const std::vector<std::string>& coco_classes() {
  static const std::vector<std::string> names{
      "person",       "bicycle",    "car",          "motorcycle",    "airplane",     "bus",           "train",
      "truck",        "boat",       "traffic light", "fire hydrant", "stop sign",    "parking meter", "bench",
      "bird",         "cat",        "dog",          "horse",         "sheep",        "cow",           "elephant",
      "bear",         "zebra",      "giraffe",      "backpack",      "umbrella",     "handbag",       "tie",
      "suitcase",     "frisbee",    "skis",         "snowboard",     "sports ball",  "kite",          "baseball bat",
      "baseball glove", "skateboard", "surfboard",  "tennis racket", "bottle",       "wine glass",    "cup",
      "fork",         "knife",      "spoon",        "bowl",          "banana",       "apple",         "sandwich",
      "orange",       "broccoli",   "carrot",       "hot dog",       "pizza",        "donut",         "cake",
      "chair",        "couch",      "potted plant", "bed",           "dining table", "toilet",        "tv",
      "laptop",       "mouse",      "remote",       "keyboard",      "cell phone",   "microwave",     "oven",
      "toaster",      "sink",       "refrigerator", "book",          "clock",        "vase",          "scissors",
      "teddy bear",   "hair drier", "toothbrush"};
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
  std::ifstream stream(file);
  if (!stream) throw io_error(file + ": cannot open the list of classes, expected a text file with one name per line");
  std::vector<std::string> names;
  for (std::string line; std::getline(stream, line);) {
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back())) != 0) line.pop_back();
    if (!line.empty()) names.push_back(line);
  }
  if (names.empty()) throw io_error(file + ": no class name in it, expected one per line");
  return names;
}

namespace detail {
[[nodiscard]] inline bool number_in(const std::string& text, double& value) {
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  return static_cast<bool>(stream >> value) && stream.peek() == std::istringstream::traits_type::eof() && std::isfinite(value);
}

/// A line in one of the two forms per image. Returns what is wrong, or nothing.
[[nodiscard]] inline std::string parse_detection(const std::string& line, int width, int height, const ClassList& classes,
                                                 Detection& d) {
  std::string spaced;
  for (char c : line) {
    if (c == ':') {
      spaced += ": ";
    } else {
      spaced += c == ',' || c == '\r' || c == '\t' ? ' ' : c;
    }
  }
  std::istringstream stream(spaced);
  std::vector<std::string> fields;
  for (std::string f; stream >> f;) fields.push_back(f);
  double v[5];
  if (line.find(':') == std::string::npos) {
    if (fields.size() != 5 && fields.size() != 6)
      return "expected 'class_id centre_x centre_y width height [score]' or 'left:.. top:.. right:.. bottom:.. class:.. score'";
    d.class_id = classes.id_of(fields[0]);
    if (d.class_id < 0) return "the class '" + fields[0] + "' is neither a number nor a known name";
    v[4] = 1;
    for (std::size_t i = 1; i < fields.size(); ++i) {
      if (!number_in(fields[i], v[i - 1])) return "'" + fields[i] + "' is not a number";
      if (!(v[i - 1] >= 0 && v[i - 1] <= 1)) return "'" + fields[i] + "' is outside of [0,1]; boxes are shares of the image here";
    }
    d.box.width = static_cast<float>(v[2] * width);
    d.box.height = static_cast<float>(v[3] * height);
    d.box.x = static_cast<float>(v[0] * width) - d.box.width / 2;
    d.box.y = static_cast<float>(v[1] * height) - d.box.height / 2;
    d.score = static_cast<float>(v[4]);
    return {};
  }
  std::map<std::string, std::string> value;
  std::string key;
  for (const std::string& f : fields) {
    if (f.back() == ':') {
      key = f.substr(0, f.size() - 1);
      if (key == "conf" || key == "confidence" || key == "prob") key = "score";
    } else if (key.empty()) {
      value["score"] = f;  // the number after the last pair
    } else if (key == "class" && value.count("class") != 0) {
      double number = 0;  // "class:person 0.79" or "class:traffic light 0.79"
      if (number_in(f, number)) {
        value["score"] = f;
        key.clear();
      } else {
        value["class"] += ' ' + f;
      }
    } else {
      value[key] = f;
      if (key != "class") key.clear();
    }
  }
  const auto get = [&](const char* name, double& out) { return value.count(name) != 0 && number_in(value[name], out); };
  if (!get("left", v[0]) || !get("top", v[1])) return "needs 'left:' and 'top:' with numbers";
  if (get("right", v[2]) && get("bottom", v[3])) {
    v[2] -= v[0];
    v[3] -= v[1];
  } else if (!get("width", v[2]) || !get("height", v[3])) {
    return "needs 'right:' and 'bottom:', or 'width:' and 'height:', with numbers";
  }
  if (!(v[2] >= 0 && v[3] >= 0)) return "the box has a negative size";
  v[4] = 1;
  if (value.count("score") != 0 && !(get("score", v[4]) && v[4] >= 0 && v[4] <= 1)) return "the score must be in [0,1]";
  d.class_id = classes.id_of(value.count("class") != 0 ? value["class"] : "0");
  if (d.class_id < 0) return "the class '" + value["class"] + "' is neither a number nor a known name";
  d.box = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), static_cast<float>(v[3])};
  d.score = static_cast<float>(v[4]);
  return {};
}
}  // namespace detail

/// Detections of one image from a file in one of the two forms per image.
/// \param width, height of the image [px]
/// Throws io_error naming file and line.
[[nodiscard]] inline std::vector<Detection> read_detections(const std::string& file, int width, int height,
                                                            const ClassList& classes = {}) {
  std::ifstream stream(file);
  if (!stream) throw io_error(file + ": cannot open the detections");
  std::vector<Detection> found;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (line.find_first_not_of(" \t\r,") == std::string::npos || line[0] == '#') continue;
    Detection d;
    const std::string wrong = detail::parse_detection(line, width, height, classes, d);
    if (!wrong.empty()) throw io_error(file + ":" + std::to_string(number) + ": " + wrong + ", got '" + line + "'");
    d.movable = classes.can_move(d.class_id);
    found.push_back(d);
  }
  return found;
}

/// Files of a folder that are named by a stamp, e.g. 1341846647.734028.png or 1341846647.734028_person.png.
class StampedFiles {
 public:
  /// \param extensions e.g. {".png", ".jpg"}; throws io_error when the folder has no such file
  StampedFiles(const std::string& folder, const std::vector<std::string>& extensions, double tolerance = 0.01)
      : tolerance_(tolerance) {
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
    if (files_.empty()) throw io_error(folder + ": no file " + kinds + " that is named by a stamp, e.g. 1341846647.734028" + extensions.front());
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
    if (std::filesystem::is_directory(path)) {
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
    std::ifstream stream(file);
    if (!stream) throw io_error(file + ": cannot open the detection file");
    std::string line;
    for (int number = 1; std::getline(stream, line); ++number) {
      if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
      std::istringstream text(line);
      text.imbue(std::locale::classic());
      double stamp = 0;
      Detection d;
      if (!(text >> stamp >> d.box.x >> d.box.y >> d.box.width >> d.box.height >> d.score >> d.class_id) ||
          !(d.box.width >= 0) || !(d.box.height >= 0) || !(d.score >= 0 && d.score <= 1)) {
        throw io_error(file + ":" + std::to_string(number) +
                       ": expected 'timestamp left top width height score class_id' with sizes >= 0 and score in [0,1], "
                       "got '" + line + "'");
      }
      d.movable = classes_.can_move(d.class_id);
      lines_[stamp].push_back(d);
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
