/// \file
/// Text files as lines of fields, with errors that say where.
///
/// Lines that begin with '#' and blank lines are skipped, fields are separated by blanks, tabs or commas. Line ends of Windows and a
/// byte order mark are accepted. Numbers have a decimal point whatever the locale.
#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/printable.hpp>

APSO_NAMESPACE_BEGIN

/// A file that cannot be read or written, or whose content is not what it should be. The message begins with
/// "file:line: " (or "file: ") and says what was found and what was expected.
class io_error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

namespace detail {
/// Opens a file for reading. Throws io_error, also for a folder, which would open and then read as nothing.
/// \param expected e.g. "a text file"
[[nodiscard]] inline std::ifstream open_text(const std::string& path, const std::string& expected) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw io_error(path + ": is a folder, expected " + expected);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw io_error(path + ": cannot open, expected " + expected);
  return file;
}

/// Reads a text file line by line, as fields, and knows where it is.
class FieldReader {
 public:
  explicit FieldReader(const std::string& path, const std::string& expected = "a readable text file")
      : path_(path), file_(open_text(path, expected)) {
    number_.imbue(std::locale::classic());
  }

  /// Next line with content. \return false at the end of the file
  bool next() {
    while (std::getline(file_, text_)) {
      ++line_;
      if (line_ == 1 && text_.compare(0, 3, "\xEF\xBB\xBF") == 0) text_.erase(0, 3);
      split();
      if (!fields_.empty() && fields_[0][0] != '#') return true;
    }
    if (file_.bad()) throw io_error(path_ + ": reading failed");
    return false;
  }

  [[nodiscard]] const std::vector<std::string>& fields() const { return fields_; }
  [[nodiscard]] const std::string& line() const { return text_; }
  [[nodiscard]] std::string where() const { return path_ + ":" + std::to_string(line_) + ": "; }

  void expect_fields(std::size_t count, const char* names) const {
    if (fields_.size() == count) return;
    throw io_error(where() + "found " + std::to_string(fields_.size()) + (fields_.size() == 1 ? " field" : " fields") + ", expected " +
                   std::to_string(count) + ": " + names);
  }

  /// Field i as a number; "nan" and "inf" (any case, signed) and numbers too large for a double are read as NaN.
  double number(std::size_t i, const char* name) {
    const std::string& field = fields_[i];
    double value = 0;
    number_.clear();
    number_.str(field);
    number_ >> value;
    const bool parsed = !number_.fail() && number_.peek() == std::istringstream::traits_type::eof();
    if (parsed && std::isfinite(value)) return value;
    if (is_infinity_or_nan(field) || is_overflow(field, value)) return std::numeric_limits<double>::quiet_NaN();
    throw io_error(where() + "field " + std::to_string(i + 1) + " (" + name + ") is '" + printable(field, 32) + "', expected a number");
  }

  /// Field i as a number in [lowest, highest].
  double number_in(std::size_t i, const char* name, double lowest, double highest) {
    const double value = number(i, name);
    if (value >= lowest && value <= highest) return value;  // false for NaN
    std::ostringstream range;
    range.imbue(std::locale::classic());
    range << "expected a number in [" << lowest << ", " << highest << "]";
    throw io_error(where() + "field " + std::to_string(i + 1) + " (" + name + ") is '" + printable(fields_[i], 32) + "', " + range.str());
  }

  /// Field i as a finite number.
  double finite_number(std::size_t i, const char* name) {
    const double value = number(i, name);
    if (std::isfinite(value)) return value;
    throw io_error(where() + "field " + std::to_string(i + 1) + " (" + name + ") is '" + printable(fields_[i], 32) +
                   "', expected a finite number");
  }

 private:
  void split() {
    fields_.clear();
    std::string field;
    for (const char c : text_) {
      if (c == ' ' || c == '\t' || c == ',' || c == '\r') {
        if (!field.empty()) fields_.push_back(std::move(field));
        field.clear();
      } else {
        field += c;
      }
    }
    if (!field.empty()) fields_.push_back(std::move(field));
  }
  static bool is_infinity_or_nan(const std::string& field) {
    std::string s;
    for (const char c : field) s += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (!s.empty() && (s[0] == '+' || s[0] == '-')) s.erase(0, 1);
    return s == "nan" || s == "inf" || s == "infinity";
  }
  /// A well-formed number that is too large: the stream fails and leaves the largest double.
  static bool is_overflow(const std::string& field, double value) {
    return std::abs(value) == std::numeric_limits<double>::max() && field.find_first_not_of("+-.0123456789eE") == std::string::npos;
  }
  std::string path_;
  std::ifstream file_;
  std::string text_;
  std::vector<std::string> fields_;
  std::istringstream number_;
  std::size_t line_ = 0;
};

}  // namespace detail

APSO_NAMESPACE_END
