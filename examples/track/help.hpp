/// \file
/// The text of --help: no line is wider than a terminal, and help2man makes a manual page of it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

namespace track {

inline constexpr std::size_t help_width = 100;  ///< longest line of --help [characters]

/// Fills lines up to `width`, broken at blanks, or after a comma where the words are too long. Lines that begin with a blank
/// stay lines of their own, e.g. those of a list. What follows a break is indented as the line, and by `hanging` more, in a list by 2.
inline std::string wrapped(const std::string& text, std::size_t width, std::size_t hanging = 0) {
  std::vector<std::string> paragraphs;
  std::istringstream lines(text);
  const auto flows = [](const std::string& line) { return !line.empty() && line.front() != ' '; };
  for (std::string line; std::getline(lines, line);) {
    if (!paragraphs.empty() && flows(line) && flows(paragraphs.back())) {
      paragraphs.back() += ' ' + line;
    } else {
      paragraphs.push_back(line);
    }
  }
  std::string out;
  for (std::string& line : paragraphs) {
    const std::size_t indent = std::min(line.find_first_not_of(' '), line.size()) + (flows(line) ? hanging : 2);
    while (line.size() > width) {
      const std::size_t blank = line.rfind(' ', width);
      const std::size_t comma = line.rfind(',', width - 1);
      const bool at_blank = blank != std::string::npos && blank > indent && (blank > width / 2 || comma == std::string::npos);
      if (!at_blank && (comma == std::string::npos || comma < indent)) break;
      out += line.substr(0, at_blank ? blank : comma + 1) + '\n';
      line = std::string(indent, ' ') + line.substr((at_blank ? blank : comma) + 1);
    }
    out += line + '\n';
  }
  return out;
}

/// The help of CLI11 within `help_width`.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_description(const CLI::App* app) const override { return wrapped(Formatter::make_description(app), help_width); }
  std::string make_usage(const CLI::App* app, std::string name) const override {
    return wrapped(Formatter::make_usage(app, std::move(name)), help_width, 2);
  }
  std::string make_footer(const CLI::App* app) const override { return wrapped(Formatter::make_footer(app), help_width); }
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override {
    return CLI::detail::find_and_replace(Formatter::make_option_name(option, is_positional), ",", ", ");
  }
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::ostringstream out;
    const auto column = [](const std::string& text, std::size_t width, std::size_t hanging) {
      std::string lines = wrapped(text, width, hanging);
      if (!lines.empty()) lines.pop_back();  // the last end of line
      return lines;
    };
    CLI::detail::format_help(out, column(make_option_name(option, is_positional) + make_option_opts(option), help_width - 2, 4),
                             column(make_option_desc(option), help_width - get_column_width(), 0), get_column_width());
    return out.str();
  }
};

}  // namespace track
