/// \file
/// Motion policies named in a line of text, e.g. "geometric | dnn" or "depth-refined-mask(hog-people) & geometric".
///
///     expression := term { ("|" | "+") term }             union: dynamic when one says so
///     term       := factor { ("*" | "&") factor }         "*" product per pixel, "&" object by object, see SemanticGate
///     factor     := NAME [ "(" expression ")" ] | "(" expression ")"
///
/// "*" and "&" bind tighter than "|", which is "+"; equals group from the left, blanks do not matter. NAME is made of letters, digits
/// and "-"; a name with an argument is a policy around another one. An expression has at most kMaxPolicyParts names and brackets.
#pragma once

#include <cctype>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/combined_policy.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/printable.hpp>

APSO_NAMESPACE_BEGIN

/// Makes the policy with a given name; `inner` is the argument in brackets, if there is one. Throws contract_error for a name it
/// does not know, or an argument that is missing or not taken.
using PolicyFactory = std::function<AnyMotionPolicy(const std::string& name, std::optional<AnyMotionPolicy> inner)>;

/// A name and what makes its policy: a function without arguments, or one that takes the policy in brackets.
/// \code
/// {"border", [] { return Border{}; }}
/// {"every-second", [](AnyMotionPolicy inner) { return EverySecond(std::move(inner)); }}
/// \endcode
struct NamedPolicy {
  template <class Make>
  NamedPolicy(std::string name_, Make make, std::string summary_ = {}) : name(std::move(name_)), summary(std::move(summary_)) {
    if constexpr (std::is_invocable_v<Make>) {
      plain = std::move(make);
    } else {
      static_assert(std::is_invocable_v<Make, AnyMotionPolicy>,
                    "apso: a NamedPolicy needs a function `[] { return MyMotion{}; }` or "
                    "`[](apso::AnyMotionPolicy inner) { return MyWrapper(std::move(inner)); }`");
      around = std::move(make);
    }
  }
  [[nodiscard]] bool takes_policy() const { return around != nullptr; }

  std::string name;     ///< letters, digits and "-"
  std::string summary;  ///< for help texts
  std::function<AnyMotionPolicy()> plain;
  std::function<AnyMotionPolicy(AnyMotionPolicy)> around;
};
/// Policies by name. Of two entries with the same name the first one counts.
using PolicyTable = std::vector<NamedPolicy>;

/// Names and opening brackets of an expression: each may be one more call inside another, when it is read and in every frame.
inline constexpr int kMaxPolicyParts = 100;

namespace detail {
class PolicyParser {
 public:
  PolicyParser(const std::string& text, const PolicyFactory& make) : text_(text), make_(make) {}

  AnyMotionPolicy parse() {
    AnyMotionPolicy policy = expression();
    if (peek() != '\0') fail("expected '|', '+', '*', '&' or the end");
    return policy;
  }

 private:
  AnyMotionPolicy expression() {
    AnyMotionPolicy left = term();
    while (take('|') || take('+')) left = join(std::move(left), term(), PolicyCombination::Union);
    return left;
  }
  AnyMotionPolicy term() {
    AnyMotionPolicy left = factor();
    for (;;) {
      if (take('*')) {
        left = join(std::move(left), factor(), PolicyCombination::Product);
      } else if (take('&')) {
        left = join(std::move(left), factor(), PolicyCombination::Gate);
      } else {
        return left;
      }
    }
  }
  AnyMotionPolicy factor() {
    if (++parts_ > kMaxPolicyParts) fail("more than " + std::to_string(kMaxPolicyParts) + " names and brackets");
    if (take('(')) return closed();
    peek();
    const std::size_t begin = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '-')) ++at_;
    if (at_ == begin) fail("expected the name of a policy or '('");
    const std::string name = text_.substr(begin, at_ - begin);
    std::optional<AnyMotionPolicy> inner;
    if (take('(')) inner.emplace(closed());
    return make_(name, std::move(inner));
  }
  AnyMotionPolicy closed() {
    AnyMotionPolicy inside = expression();
    if (!take(')')) fail("expected ')'");
    return inside;
  }
  static AnyMotionPolicy join(AnyMotionPolicy a, AnyMotionPolicy b, PolicyCombination how) {
    return CombinedPolicy<AnyMotionPolicy, AnyMotionPolicy>(std::move(a), std::move(b), how);
  }
  char peek() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  [[noreturn]] void fail(const std::string& what) const {
    contract_violation("motion policy '" + printable(text_) + "': at character " + std::to_string(at_ + 1) + ": " + what);
  }

  const std::string& text_;
  const PolicyFactory& make_;
  std::size_t at_ = 0;
  int parts_ = 0;
};
}  // namespace detail

/// The policy an expression describes. Throws contract_error that says where the expression is wrong.
[[nodiscard]] inline AnyMotionPolicy parse_policy(const std::string& expression, const PolicyFactory& make) {
  return detail::PolicyParser(expression, make).parse();
}

/// The same with the names of a table.
[[nodiscard]] inline AnyMotionPolicy parse_policy(const std::string& expression, const PolicyTable& table) {
  const PolicyFactory make = [&](const std::string& name, std::optional<AnyMotionPolicy> inner) -> AnyMotionPolicy {
    std::string known;
    for (const NamedPolicy& entry : table) {
      if (entry.name == name) {
        if (entry.takes_policy() != inner.has_value()) {
          contract_violation("motion policy '" + printable(expression) + "': '" + name +
                             (inner ? "' takes no policy in brackets" : "' needs another policy in brackets"));
        }
        return inner ? entry.around(std::move(*inner)) : entry.plain();
      }
      known += (known.empty() ? "" : ", ") + entry.name + (entry.takes_policy() ? "(P)" : "");
    }
    contract_violation("motion policy '" + printable(expression) + "': no policy is called '" + printable(name) + "', known are: " + known);
  };
  return parse_policy(expression, make);
}

/// The names in an expression, in their order. Throws contract_error like parse_policy.
[[nodiscard]] inline std::vector<std::string> policy_names(const std::string& expression) {
  std::vector<std::string> names;
  const PolicyFactory note = [&](const std::string& name, const std::optional<AnyMotionPolicy>&) -> AnyMotionPolicy {
    names.push_back(name);
    return NoMotion{};
  };
  (void)parse_policy(expression, note);
  return names;
}

APSO_NAMESPACE_END
