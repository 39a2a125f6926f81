/// \file
/// Options from and to YAML. Needs yaml-cpp. Works for every struct that lists its fields (options.hpp):
/// \code
///   pipeline:
///     assessor:
///       decision:
///         th_differ: 0.55
/// \endcode
/// One field alone: `set_parameter(options, "pipeline.assessor.decision.th_differ", "0.55")`. All fields with their values and
/// ranges: list_parameters().
#pragma once

#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include <yaml-cpp/yaml.h>

#include <apso/config.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/io/yaml_file.hpp>
#include <apso/options.hpp>
#include <apso/printable.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {

/// Reads the fields of one options struct from a YAML map, and knows which names exist.
class YamlReader {
 public:
  YamlReader(const YAML::Node& node, std::string file, std::string prefix)
      : node_(node), file_(std::move(file)), prefix_(std::move(prefix)) {
    if (!node_ || node_.IsMap() || node_.IsNull()) return;
    fail(node_, (prefix_.empty() ? std::string("the settings") : "'" + prefix_ + "'") + " must be a map of name: value");
  }

  template <class T, class L, class H>
  void operator()(const char* name, T& value, L lowest, H highest) {
    const YAML::Node item = find(name);
    if (!item) return;
    read(name, item, value);
    if (!(value >= static_cast<T>(lowest) && value <= static_cast<T>(highest))) {
      std::ostringstream text;
      text << "'" << path(name) << "' = " << printable(item.Scalar()) << " is out of range [" << lowest << ", " << highest << "]";
      fail(item, text.str());
    }
  }
  template <class T>
  void operator()(const char* name, T& value) {
    const YAML::Node item = find(name);
    if (!item) return;
    if constexpr (is_options_v<T>) {
      YamlReader inner(item, file_, path(name));
      T::fields(value, inner);
      inner.finish();
    } else if constexpr (std::is_enum_v<T>) {
      constexpr auto names = enum_names(T{});
      std::string known;
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (item.IsScalar() && item.Scalar() == names[i]) {
          value = static_cast<T>(i);
          return;
        }
        known += (i ? ", " : "") + std::string(names[i]);
      }
      fail(item, "'" + path(name) + "' must be one of: " + known);
    } else {
      read(name, item, value);
    }
  }

  /// Throws if the map has a name that no field has.
  void finish() const {
    if (!node_ || !node_.IsMap()) return;
    for (const auto& entry : node_) {
      const std::string key = entry.first.Scalar();
      bool found = false;
      std::string known;
      for (const std::string& k : known_) {
        found = found || k == key;
        known += (known.empty() ? "" : ", ") + k;
      }
      if (!found) fail(entry.first, "unknown option '" + path(printable(key)) + "', known here: " + known);
    }
  }

 private:
  [[nodiscard]] std::string path(const std::string& name) const { return prefix_.empty() ? name : prefix_ + '.' + name; }
  YAML::Node find(const char* name) {
    known_.emplace_back(name);
    if (!node_ || !node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
    const YAML::Node& constant = node_;
    return constant[name];
  }
  template <class T>
  void read(const char* name, const YAML::Node& item, T& value) const {
    try {
      value = item.as<T>();
    } catch (const YAML::Exception&) {
      constexpr bool truth = std::is_same_v<T, bool>;
      constexpr bool whole = std::is_integral_v<T>;
      const char* kind = truth ? "true or false" : whole ? "a whole number" : "a number";
      fail(item, "'" + path(name) + "' must be " + kind);
    }
  }
  [[noreturn]] void fail(const YAML::Node& at, const std::string& what) const {
    throw io_error((file_.empty() ? "" : file_ + ":" + std::to_string(at.Mark().line + 1) + ": ") + what);
  }

  YAML::Node node_;
  std::string file_;
  std::string prefix_;
  std::vector<std::string> known_;
};

class YamlWriter {
 public:
  explicit YamlWriter(const YAML::Node& node) : node_(node) {}
  template <class T, class L, class H>
  void operator()(const char* name, const T& value, L, H) {
    node_[name] = value;
  }
  template <class T>
  void operator()(const char* name, const T& value) {
    if constexpr (is_options_v<T>) {
      YAML::Node inner(YAML::NodeType::Map);
      T::fields(value, YamlWriter(inner));
      node_[name] = inner;
    } else if constexpr (std::is_enum_v<T>) {
      node_[name] = std::string(enum_names(T{})[static_cast<std::size_t>(value)]);
    } else {
      node_[name] = value;
    }
  }

 private:
  YAML::Node node_;
};

}  // namespace detail

/// One field of an options struct.
struct Parameter {
  std::string path;   ///< e.g. "pipeline.assessor.decision.th_differ"
  std::string value;  ///< to ten digits
  std::string range;  ///< "0 .. 1"; of an enum its names, "a | b"; of a bool "false | true"; else empty
};

namespace detail {
class ParameterLister {
 public:
  ParameterLister(std::string prefix, std::vector<Parameter>& out) : prefix_(std::move(prefix)), out_(&out) {}
  template <class T, class L, class H>
  void operator()(const char* name, const T& value, L lowest, H highest) const {
    out_->push_back({prefix_ + name, text(value), text(static_cast<T>(lowest)) + " .. " + text(static_cast<T>(highest))});
  }
  template <class T>
  void operator()(const char* name, const T& value) const {
    if constexpr (is_options_v<T>) {
      T::fields(value, ParameterLister(prefix_ + name + '.', *out_));
    } else if constexpr (std::is_enum_v<T>) {
      std::string names;
      for (const char* n : enum_names(T{})) names += (names.empty() ? "" : " | ") + std::string(n);
      out_->push_back({prefix_ + name, enum_names(T{})[static_cast<std::size_t>(value)], names});
    } else {
      out_->push_back({prefix_ + name, text(value), std::is_same_v<T, bool> ? "false | true" : ""});
    }
  }

 private:
  template <class T>
  static std::string text(const T& value) {
    std::ostringstream out;
    out.precision(std::is_same_v<T, float> ? 7 : 10);
    out << std::boolalpha << value;
    return out.str();
  }
  std::string prefix_;
  std::vector<Parameter>* out_;
};
}  // namespace detail

/// All fields of nested options, in the order in which they are declared.
template <class Options>
[[nodiscard]] std::vector<Parameter> list_parameters(const Options& options) {
  std::vector<Parameter> list;
  Options::fields(options, detail::ParameterLister("", list));
  return list;
}

/// Sets one field. Throws io_error for an unknown name, a value of the wrong kind or out of range, and then changes nothing.
/// \param path  names of the groups and of the field, joined by dots
/// \param value as in a YAML file
template <class Options>
void set_parameter(Options& options, const std::string& path, const std::string& value) {
  YAML::Node node;
  try {
    node = detail::parse_yaml(value, "");
  } catch (const io_error& e) {
    throw io_error("'" + path + "': " + e.what());
  }
  std::size_t end = path.size();
  while (true) {
    const std::size_t dot = path.rfind('.', end - 1);
    const std::size_t begin = dot == std::string::npos ? 0 : dot + 1;
    YAML::Node outer(YAML::NodeType::Map);
    outer[path.substr(begin, end - begin)] = node;
    node.reset(outer);
    if (begin == 0) break;
    end = dot;
  }
  Options changed = options;
  detail::YamlReader reader(node, "", "");
  Options::fields(changed, reader);
  reader.finish();
  options = changed;
}

/// Sets the fields named in the YAML file; the others keep their values.
/// Throws io_error naming file, line and field for a missing file, a syntax error, an unknown name, a value of the
/// wrong kind or out of range, a name that is given twice and a second document.
template <class Options>
void read_parameters(const std::string& file, Options& options) {
  detail::YamlReader reader(detail::load_yaml(file, "a YAML file of parameters"), file, "");
  Options::fields(options, reader);
  reader.finish();
}

/// All fields as YAML text.
template <class Options>
[[nodiscard]] std::string write_parameters(const Options& options) {
  YAML::Node root(YAML::NodeType::Map);
  Options::fields(options, detail::YamlWriter(root));
  YAML::Emitter out;
  out << root;
  return out.c_str();
}

APSO_NAMESPACE_END
