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
struct has_fields<T, std::void_t<decltype(T::fields(std::declval<T&>(), std::declval<AnyVisitor>()))>>
    : std::true_type {};

class Validator {
 public:
  explicit Validator(std::string prefix) : prefix_(std::move(prefix)) {}

  template <class T, class L, class H>
  void operator()(const char* name, const T& value, L lowest, H highest) const {
    bool ok = value >= static_cast<T>(lowest) && value <= static_cast<T>(highest);  // false for NaN
    if (ok) return;
    std::ostringstream text;
    text << "option " << prefix_ << '.' << name << " = " << value << " is out of range [" << lowest << ", "
         << highest << "]";
    contract_violation(text.str());
  }
  template <class T>
  void operator()(const char* name, const T& value) const {
    if constexpr (has_fields<T>::value) T::fields(value, Validator(prefix_ + '.' + name));
  }

 private:
  std::string prefix_;
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
  Options::fields(options, detail::Validator(name));
}

APSO_NAMESPACE_END
