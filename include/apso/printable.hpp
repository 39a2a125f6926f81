/// \file
/// Text from outside made fit for an error message.
#pragma once

#include <cstddef>
#include <string>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// What is quoted of a file or of an argument: short, and with everything but printable ASCII as hexadecimal escapes, so that
/// neither a terminal nor a log obeys it.
/// \param most characters of the text that are kept; "..." follows where there are more
[[nodiscard]] inline std::string printable(const std::string& text, std::size_t most = 64) {
  static constexpr char digits[] = "0123456789abcdef";
  std::string out;
  for (std::size_t i = 0; i < text.size() && i < most; ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c >= 0x20 && c < 0x7f) {
      out += text[i];
    } else {
      out += {'\\', 'x', digits[c / 16], digits[c % 16]};
    }
  }
  return text.size() > most ? out + "..." : out;
}

APSO_NAMESPACE_END
