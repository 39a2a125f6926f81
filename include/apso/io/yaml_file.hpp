/// \file
/// YAML text that means one thing: one document, no name twice. Needs yaml-cpp.
#pragma once

#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <apso/config.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/printable.hpp>

APSO_NAMESPACE_BEGIN
namespace detail {

/// Refuses names that are given twice, of which yaml-cpp would take the first, and what is nested without end: an alias may contain
/// itself, or double with every level.
class YamlChecker {
 public:
  explicit YamlChecker(const std::string& source) : source_(source) {}
  void check(const YAML::Node& node, int depth = 0) {
    if (++nodes_ > kMostNodes) fail(node, "more than " + std::to_string(kMostNodes) + " values");
    if (depth > kDeepest) fail(node, "nested deeper than " + std::to_string(kDeepest) + " levels");
    if (node.IsSequence()) {
      for (const YAML::Node& item : node) check(item, depth + 1);
    }
    if (!node.IsMap()) return;
    std::set<std::string> names;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) fail(entry.first, "a name that is no text");
      if (!names.insert(entry.first.Scalar()).second) fail(entry.first, "'" + printable(entry.first.Scalar()) + "' is given twice");
      check(entry.second, depth + 1);
    }
  }
  /// Throws io_error with the line of a node.
  [[noreturn]] void fail(const YAML::Node& at, const std::string& what) const {
    throw io_error((source_.empty() ? "" : source_ + ":" + std::to_string(at.Mark().line + 1) + ": ") + what);
  }

 private:
  static constexpr int kDeepest = 32;
  static constexpr int kMostNodes = 10000;
  const std::string& source_;
  int nodes_ = 0;
};

/// Where a document begins; takes no notice of what is in it.
class DocumentStart : public YAML::EventHandler {
 public:
  int line = -1;  ///< counted from 0
  void OnDocumentStart(const YAML::Mark& mark) override { line = mark.line; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

/// The one document of a text; a null node where there is nothing. Throws io_error with the line where it is not valid YAML, has a
/// second document or a name twice.
/// \param source file for the message; empty = no file and no line
[[nodiscard]] inline YAML::Node parse_yaml(const std::string& text, const std::string& source) {
  const auto fail = [&](int line, const std::string& what) {
    throw io_error((source.empty() ? "" : source + ":" + std::to_string(line + 1) + ": ") + what);
  };
  YAML::Node root;
  try {
    // not YAML::LoadAll: after what it cannot read it finds empty documents without end
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    DocumentStart start;
    if (parser.HandleNextDocument(start) && parser.HandleNextDocument(start)) {
      fail(start.line, "a second document begins, expected one");
    }
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    fail(e.mark.line, "not valid YAML: " + printable(e.msg, 200));
  }
  YamlChecker(source).check(root);
  return root;
}

/// The same of a file.
/// \param expected e.g. "a YAML file that describes a camera"
[[nodiscard]] inline YAML::Node load_yaml(const std::string& path, const std::string& expected) {
  std::ifstream file = open_text(path, expected);
  std::ostringstream text;
  if (file.peek() != std::ifstream::traits_type::eof()) text << file.rdbuf();
  if (file.bad()) throw io_error(path + ": reading failed");
  return parse_yaml(text.str(), path);
}

}  // namespace detail
APSO_NAMESPACE_END
