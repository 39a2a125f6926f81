/// \file
/// What a score is, and lists of scores with their weights and options.
///
/// A score of a frame by itself is one struct. Only the first three members are required:
/// \code
/// struct Contrast {
///   static constexpr const char* name = "S_contrast";  // column of tables; weight and options are named "contrast"
///   using Value = apso::Quality;                        // or apso::Deviation, if higher is worse
///   apso::MaybeQuality operator()(const apso::FrameContext& c);  // nullopt = there is no evidence
///
///   static constexpr double default_weight = 0.2;       // among the others, which are then scaled to a sum of 1
///   struct Options { ...fields()... };  Options options;          // settings, see options.hpp
///   struct Measured { ...columns()... };  Measured measured;      // what was measured, for tables; see below
///   static std::string reason(Value v, const Measured& m);        // for explain()
///   void learn();    // called when the frame just scored turned out GOOD
///   void reset();    // forget what was learned
/// };
/// \endcode
/// A score of change has `struct Memory`, `void remember(const FrameContext&, Memory&)`, and
/// `operator()(const ChangeContext<Memory>&)`. `Measured::columns` lists doubles like `fields` does: `column("S_cov", m.S_cov)`;
/// a value that is not finite is not shown.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/quality/frame_context.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// A list of score types. Their order is the order of weights, columns and explanations.
template <class... Scores>
struct ScoreList {
  static constexpr std::size_t size = sizeof...(Scores);
};

/// Which way a score is better.
enum class Better { Higher, Lower };

/// What a scenario of the paper asks a score about. A list has at most one score of a role.
enum class ScoreRole {
  None,
  FeatureQuality,   ///< are there good features? Raises S_final of a static scene, weighs the feature pose in the blend
  ObjectConfidence  ///< are the objects well detected? Raises S_final
};

/// "0.12", for reasons.
[[nodiscard]] inline std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

/// For scores without settings, and for scores that measure nothing beside their value.
struct Nothing {
  template <class Self, class V>
  static void fields(Self&, V&&) {}
  template <class Self, class V>
  static void columns(Self&, V&&) {}
};

/// For scores that measure how many objects there are.
struct CountedObjects : Nothing {
  int objects = 0;
  [[nodiscard]] std::string text() const { return std::to_string(objects) + (objects == 1 ? " object" : " objects"); }
};

namespace detail {
template <class S>
using score_name_t = decltype(S::name);
template <class S>
using score_value_t = typename S::Value;
template <class S>
using score_options_t = typename S::Options;
template <class S>
using score_measured_t = typename S::Measured;
template <class S>
using score_memory_t = typename S::Memory;
template <class S>
using score_options_name_t = decltype(S::options_name);
template <class S>
using score_weight_name_t = decltype(S::weight_name);
template <class S>
using score_weight_t = decltype(S::default_weight);
template <class S>
using score_role_t = decltype(S::role);
template <class S>
using score_learn_t = decltype(std::declval<S&>().learn());
template <class S>
using score_reset_t = decltype(std::declval<S&>().reset());
template <class S>
using score_reason_t = decltype(S::reason(std::declval<typename S::Value>(), std::declval<const typename S::Measured&>()));
template <class S>
using score_of_frame_t = decltype(std::declval<S&>()(std::declval<const FrameContext&>()));
template <class S>
using score_of_change_t = decltype(std::declval<S&>()(std::declval<const ChangeContext<typename S::Memory>&>()));
template <class S>
using score_remember_t = decltype(std::declval<S&>().remember(std::declval<const FrameContext&>(), std::declval<typename S::Memory&>()));
template <class S>
using score_share_t = decltype(S::visible_share(std::declval<const typename S::Measured&>()));
template <class S>
using score_calibrate_t =
    decltype(S::calibrate(std::declval<const std::vector<typename S::Measured>&>(),
                          std::declval<const std::vector<typename S::Measured>&>(), std::declval<typename S::Options&>()));
template <class S>
using score_revalue_t = decltype(S::revalue(std::declval<const typename S::Measured&>(), std::declval<const typename S::Options&>()));

template <class S, template <class> class Member, class Otherwise, class = void>
struct member_or {
  using type = Otherwise;
};
template <class S, template <class> class Member, class Otherwise>
struct member_or<S, Member, Otherwise, std::void_t<Member<S>>> {
  using type = Member<S>;
};
}  // namespace detail

/// What a score says about itself, with the defaults for what it does not say.
template <class S>
struct score_traits {
  static_assert(detail::detected_as_v<const char*, detail::score_name_t, S>,
                "apso: a score needs `static constexpr const char* name`, e.g. S_contrast");
  static_assert(detail::detected_v<detail::score_value_t, S>,
                "apso: a score needs `using Value = apso::Quality;` (higher is better) or `using Value = apso::Deviation;`");
  using Value = typename S::Value;
  static_assert(std::is_same_v<Value, Quality> || std::is_same_v<Value, Deviation>,
                "apso: Value of a score is apso::Quality or apso::Deviation");
  using Options = typename detail::member_or<S, detail::score_options_t, Nothing>::type;
  using Measured = typename detail::member_or<S, detail::score_measured_t, Nothing>::type;

  static constexpr Better better = std::is_same_v<Value, Quality> ? Better::Higher : Better::Lower;
  static constexpr const char* name = S::name;
  /// The name without "S_".
  [[nodiscard]] static constexpr const char* key() { return S::name[0] == 'S' && S::name[1] == '_' ? S::name + 2 : S::name; }
  [[nodiscard]] static constexpr const char* options_name() {
    if constexpr (detail::detected_v<detail::score_options_name_t, S>) return S::options_name;
    else return key();
  }
  [[nodiscard]] static constexpr const char* weight_name() {
    if constexpr (detail::detected_v<detail::score_weight_name_t, S>) return S::weight_name;
    else return key();
  }
  [[nodiscard]] static constexpr double default_weight() {
    if constexpr (detail::detected_v<detail::score_weight_t, S>) return S::default_weight;
    else return 0.1;
  }
  [[nodiscard]] static constexpr ScoreRole role() {
    if constexpr (detail::detected_v<detail::score_role_t, S>) return S::role;
    else return ScoreRole::None;
  }
};

/// Names what a score of one frame lacks, in the compiler's message.
template <class S>
constexpr void check_frame_score() {
  (void)score_traits<S>::better;
  static_assert(detail::detected_as_v<std::optional<typename S::Value>, detail::score_of_frame_t, S>,
                "apso: a score of a frame needs `std::optional<Value> operator()(const apso::FrameContext& frame);`");
}
/// Names what a score of change lacks, in the compiler's message.
template <class S>
constexpr void check_change_score() {
  (void)score_traits<S>::better;
  static_assert(detail::detected_v<detail::score_memory_t, S>,
                "apso: a score of change needs `struct Memory {...};`, what it keeps of a frame");
  static_assert(detail::detected_v<detail::score_remember_t, S>,
                "apso: a score of change needs `void remember(const apso::FrameContext& frame, Memory& memory);`");
  static_assert(detail::detected_as_v<std::optional<typename S::Value>, detail::score_of_change_t, S>,
                "apso: a score of change needs `std::optional<Value> operator()(const apso::ChangeContext<Memory>& frames);`");
}

namespace detail {
/// The first base of a class that takes lists of scores, so that what a score lacks is said before anything else.
template <class FrameScores, class ChangeScores>
struct RequireScores;
template <class... F, class... C>
struct RequireScores<ScoreList<F...>, ScoreList<C...>> {
  static_assert(((check_frame_score<F>(), true) && ...), "see above");
  static_assert(((check_change_score<C>(), true) && ...), "see above");
};
}  // namespace detail

/// True when T is one of the list.
template <class T, class List>
inline constexpr bool contains_score_v = false;
template <class T, class... S>
inline constexpr bool contains_score_v<T, ScoreList<S...>> = (std::is_same_v<T, S> || ...);

/// Place of T in the list.
template <class T, class... S>
[[nodiscard]] constexpr std::size_t score_index(ScoreList<S...>) {
  static_assert(contains_score_v<T, ScoreList<S...>>, "apso: this score is not in the list");
  std::size_t i = 0;
  bool found = false;
  ((found = found || std::is_same_v<T, S>, i += found ? 0 : 1), ...);
  return i;
}

namespace detail {
/// f(const char*) with the name of each score without "S_".
template <class... S, class F>
void for_each_key(ScoreList<S...>, F&& f) {
  (f(score_traits<S>::key()), ...);
}
}  // namespace detail

/// The weights of a list of scores: they are >= 0 and sum to 1.
template <class List>
class ScoreWeights;
template <class... S>
class ScoreWeights<ScoreList<S...>> {
 public:
  using List = ScoreList<S...>;
  using Values = std::array<double, sizeof...(S)>;

  ScoreWeights() {
    double sum = 0;
    for (const double w : values_) sum += w;
    if (std::abs(sum - 1) > 1e-9) {  // a list with scores of the user's
      for (double& w : values_) w /= sum;
    }
  }
  [[nodiscard]] static constexpr std::size_t size() { return sizeof...(S); }
  [[nodiscard]] double& operator[](std::size_t i) { return values_[i]; }
  [[nodiscard]] double operator[](std::size_t i) const { return values_[i]; }
  [[nodiscard]] const Values& values() const { return values_; }
  template <class T>
  [[nodiscard]] double& get() {
    return values_[score_index<T>(List{})];
  }
  template <class T>
  [[nodiscard]] double get() const {
    return values_[score_index<T>(List{})];
  }
  /// Takes one score out and gives its weight to the others in proportion. The last weight stays.
  void switch_off(std::size_t i) {
    const double rest = 1 - values_[i];
    if (!(rest > 0)) return;
    for (double& w : values_) w /= rest;
    values_[i] = 0;
  }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    std::size_t i = 0;
    (v(score_traits<S>::weight_name(), s.values_[i++], 0.0, 1.0), ...);
  }

 private:
  Values values_{score_traits<S>::default_weight()...};
};

/// The options of a list of scores.
template <class List>
class ScoreOptions;
template <class... S>
class ScoreOptions<ScoreList<S...>> {
 public:
  using List = ScoreList<S...>;
  template <class T>
  [[nodiscard]] auto& get() {
    return std::get<score_index<T>(List{})>(values_);
  }
  template <class T>
  [[nodiscard]] const auto& get() const {
    return std::get<score_index<T>(List{})>(values_);
  }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    (field<S>(s, v), ...);
  }

 private:
  template <class T, class Self, class V>
  static void field(Self& s, V& v) {
    if constexpr (!std::is_same_v<typename score_traits<T>::Options, Nothing>) {
      v(score_traits<T>::options_name(), s.template get<T>());
    }
  }
  std::tuple<typename score_traits<S>::Options...> values_;
};

namespace detail {
/// The scores of a list as objects.
template <class List>
struct ScoreObjects;
template <class... S>
struct ScoreObjects<ScoreList<S...>> {
  std::tuple<S...> each;

  explicit ScoreObjects(const ScoreOptions<ScoreList<S...>>& options) { (set_options(std::get<S>(each), options), ...); }
  void learn() { (learn_one(std::get<S>(each)), ...); }
  void reset() { (reset_one(std::get<S>(each)), ...); }
  template <class T>
  static typename score_traits<T>::Measured measured(const T& score) {
    if constexpr (detected_v<score_measured_t, T>) return score.measured;
    else return {};
  }

 private:
  template <class T>
  static void set_options(T& score, const ScoreOptions<ScoreList<S...>>& options) {
    if constexpr (detected_v<score_options_t, T>) score.options = options.template get<T>();
  }
  template <class T>
  static void learn_one(T& score) {
    if constexpr (detected_v<score_learn_t, T>) score.learn();
  }
  template <class T>
  static void reset_one(T& score) {
    if constexpr (detected_v<score_reset_t, T>) score.reset();
  }
};
}  // namespace detail

APSO_NAMESPACE_END
