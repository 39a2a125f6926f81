// What messages are looked through with.
#pragma once

#include <string>

[[nodiscard]] inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
