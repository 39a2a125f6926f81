/// \file
/// Settings from a dict: {"alignment.alpha": 1.5, "backward": True}. The names are the fields of the options structs.
#pragma once

#include <set>
#include <string>
#include <type_traits>

#include <pybind11/pybind11.h>

#include <apso/options.hpp>

namespace py = pybind11;

namespace apso_python {

class OptionSetter {
 public:
  OptionSetter(const py::dict& values, std::set<std::string>& used, std::string prefix = {})
      : values_(values), used_(&used), prefix_(std::move(prefix)) {}

  template <class T, class L, class H>
  void operator()(const char* name, T& value, L, H) const {  // the range is checked by whoever takes the options
    if (const py::object given = find(name)) value = number<T>(given, prefix_ + name);
  }
  template <class T>
  void operator()(const char* name, T& value) const {
    if constexpr (apso::detail::has_fields<T>::value) {
      T::fields(value, OptionSetter(values_, *used_, prefix_ + name + '.'));
    } else if (const py::object given = find(name)) {
      if constexpr (std::is_enum_v<T>) {
        value = named<T>(given, prefix_ + name);
      } else {
        value = number<T>(given, prefix_ + name);
      }
    }
  }

 private:
  [[nodiscard]] py::object find(const char* name) const {
    const py::str key(prefix_ + name);
    if (!values_.contains(key)) return {};
    used_->insert(prefix_ + name);
    return values_[key];
  }
  template <class T>
  static T number(const py::object& given, const std::string& path) {
    try {
      return given.cast<T>();
    } catch (const py::cast_error&) {
      throw py::type_error("option '" + path + "' is " + std::string(py::repr(given)) + ", expected " +
                           (std::is_same_v<T, bool> ? "True or False"
                            : std::is_integral_v<T> ? "a whole number"
                                                    : "a number"));
    }
  }
  template <class T>
  static T named(const py::object& given, const std::string& path) {
    std::string known;
    int i = 0;
    for (const char* name : enum_names(T{})) {
      if (py::isinstance<py::str>(given) && given.cast<std::string>() == name) return static_cast<T>(i);
      known += (i++ > 0 ? ", " : "") + std::string(name);
    }
    throw py::value_error("option '" + path + "' is " + std::string(py::repr(given)) + ", expected one of " + known);
  }
  py::dict values_;
  std::set<std::string>* used_;
  std::string prefix_;
};

/// Sets the options that a dict names; the others keep their values. Throws for a name that no option has.
template <class Options>
void set_options(Options& options, const py::dict& values) {
  std::set<std::string> used;
  Options::fields(options, OptionSetter(values, used));
  for (const auto& item : values) {
    const std::string name = py::str(item.first);
    if (used.count(name) == 0) throw py::value_error("there is no option '" + name + "'");
  }
}

/// The value of an enumeration with this name.
template <class E>
E enum_of(const std::string& name, const char* argument) {
  std::string known;
  int i = 0;
  for (const char* n : enum_names(E{})) {
    if (name == n) return static_cast<E>(i);
    known += (i++ > 0 ? ", " : "") + std::string(n);
  }
  throw py::value_error(std::string(argument) + " is '" + name + "', expected one of " + known);
}

}  // namespace apso_python
