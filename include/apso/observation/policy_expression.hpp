/// \file
/// Motion policies named in a line of text, e.g. "geometric + dnn" or "depth-refined-mask(hog-people) & geometric".
///
///     expression := term { "+" term }                     union: dynamic when one says so
///     term       := factor { ("*" | "&") factor }         "*" product per pixel, "&" object by object, see SemanticGate
///     factor     := NAME [ "(" expression ")" ] | "(" expression ")"
///
/// "*" and "&" bind tighter than "+", equals group from the left, blanks do not matter. NAME is made of letters, digits
/// and "-"; a name with an argument is a policy around another one.
#pragma once

#include <cctype>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/motion_policy.hpp>

APSO_NAMESPACE_BEGIN

/// Makes the policy of a name; `inner` is the argument in brackets, if there is one. Throws contract_error for a name it
/// does not know, or an argument that is missing or not taken.
using PolicyFactory = std::function<AnyMotionPolicy(const std::string& name, std::optional<AnyMotionPolicy> inner)>;

namespace detail {
class PolicyParser {
 public:
  PolicyParser(const std::string& text, const PolicyFactory& make) : text_(text), make_(make) {}

  AnyMotionPolicy parse() {
    AnyMotionPolicy policy = expression();
    if (peek() != '\0') fail("expected '+', '*', '&' or the end");
    return policy;
  }

 private:
  AnyMotionPolicy expression() {
    AnyMotionPolicy left = term();
    while (take('+')) left = join(std::move(left), term(), PolicyCombination::Union);
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
    contract_violation("motion policy '" + text_ + "': at character " + std::to_string(at_ + 1) + ": " + what);
  }

  const std::string& text_;
  const PolicyFactory& make_;
  std::size_t at_ = 0;
};
}  // namespace detail

/// The policy an expression describes. Throws contract_error that says where the expression is wrong.
[[nodiscard]] inline AnyMotionPolicy parse_policy(const std::string& expression, const PolicyFactory& make) {
  return detail::PolicyParser(expression, make).parse();
}

/// The names in an expression, in their order. Throws contract_error like parse_policy.
[[nodiscard]] inline std::vector<std::string> policy_names(const std::string& expression) {
  std::vector<std::string> names;
  (void)parse_policy(expression, [&](const std::string& name, const std::optional<AnyMotionPolicy>&) -> AnyMotionPolicy {
    names.push_back(name);
    return NoMotion{};
  });
  return names;
}

APSO_NAMESPACE_END
