/// \file
/// One mechanism for all settings: an options struct lists its fields once, with their ranges, and from that
/// list come validation, YAML reading and writing, and tables of defaults.
///
/// \code
/// enum class Form { Geometric, Linear };
/// constexpr std::array<const char*, 2> enum_names(Form) { return {"geometric", "linear"}; }
///
/// struct FeatureOptions {
///   int n_ref = 500;             ///< keypoints of a full score
///   Form form = Form::Geometric;
///   template <class Self, class Visitor>
///   static void fields(Self& s, Visitor&& v) {
///     v("n_ref", s.n_ref, 1, 100000);  // name, field, smallest, largest allowed value
///     v("form", s.form);               // enums and bools have no range; nested options neither
///   }
/// };
/// validate(FeatureOptions{}, "feature");
/// \endcode
#pragma once

#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
struct AnyVisitor {
  template <class... A>
  void operator()(const char*, A&&...) const {}
};
template <class T, class = void>
struct has_fields : std::false_type {};
template <class T>
struct has_fields<T, std::void_t<decltype(T::fields(std::declval<T&>(), std::declval<AnyVisitor>()))>> : std::true_type {};

/// The checks of all options structs: one function for every kind of number, names put together only where one is wrong.
class Validator {
 public:
  explicit Validator(const char* name, const Validator* outer = nullptr) : name_(name), outer_(outer) {}

  template <class T, class L, class H>
  void operator()(const char* name, const T& value, L lowest, H highest) const {
    const bool whole = std::is_integral_v<T>;
    check(name, static_cast<double>(value), static_cast<double>(static_cast<T>(lowest)), static_cast<double>(static_cast<T>(highest)),
          whole);
  }
  template <class T>
  void operator()(const char* name, const T& value) const {
    if constexpr (has_fields<T>::value) T::fields(value, Validator(name, this));
  }

 private:
  APSO_NOINLINE void check(const char* name, double value, double lowest, double highest, bool whole) const {
    if (!(value >= lowest && value <= highest)) fail(name, value, lowest, highest, whole);  // true for NaN
  }
  [[noreturn]] APSO_COLD void fail(const char* name, double value, double lowest, double highest, bool whole) const {
    std::ostringstream text;
    const auto put = [&](double number) {
      if (whole) text << static_cast<long long>(number);
      else text << number;
    };
    text << "option ";
    path(text);
    text << '.' << name << " = ";
    put(value);
    text << " is out of range [";
    put(lowest);
    text << ", ";
    put(highest);
    text << "]";
    contract_violation(text.str());
  }
  APSO_COLD void path(std::ostringstream& text) const {
    if (outer_ != nullptr) {
      outer_->path(text);
      text << '.';
    }
    text << name_;
  }

  const char* name_;
  const Validator* outer_;
};
}  // namespace detail

/// True for a struct with a static `fields(self, visitor)`.
template <class T>
inline constexpr bool is_options_v = detail::has_fields<T>::value;

/// Throws contract_error naming the field, its value and its range when a field is out of range.
/// \param name how the struct is called in the message, e.g. "alignment"
template <class Options>
void validate(const Options& options, const std::string& name) {
  static_assert(is_options_v<Options>, "apso: options need `template <class Self, class V> static void fields(Self&, V&&)`");
  Options::fields(options, detail::Validator(name.c_str()));
}

APSO_NAMESPACE_END
