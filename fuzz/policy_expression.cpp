// Motion policies as text: an expression is parsed or refused; neither ends the stack.
#include <apso/observation/policy_expression.hpp>

#include "input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const auto names = apso::policy_names(text);
    fuzz::require(!names.empty() && names.size() <= static_cast<std::size_t>(apso::kMaxPolicyParts), "one to a hundred names");
  } catch (const apso::contract_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
