/// \file
/// What the command lines of all programs have in common: exit codes, messages, checks of values.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>

namespace track {

inline constexpr int exit_bad_input = 1;
inline constexpr int exit_usage = 2;
inline constexpr int exit_no_pose = 3;  ///< apso_track: no frame got a pose, which is a result

/// Runs a program: reads the arguments, calls the body, tells what went wrong on the standard error.
/// \param name of the program, for messages
/// \param body returns the exit code; an exception of it is bad input
template <class Body>
int run_main(const char* name, CLI::App& app, int argc, char** argv, Body&& body) {
  int code = 0;
  try {
    app.parse(argc, argv);
    code = body();
  } catch (const CLI::Success& e) {  // --help, --version
    app.exit(e);
  } catch (const CLI::ParseError& e) {
    for (const std::string& word : app.remaining()) {  // CLI11 may tell only that a required option is missing
      if (word.rfind('-', 0) == 0) std::fprintf(stderr, "%s: there is no option %s\n", name, word.c_str());
    }
    app.exit(e);
    return exit_usage;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", name, e.what());
    code = exit_bad_input;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fprintf(stderr, "%s: cannot write to the standard output\n", name);
    if (code == 0) code = exit_bad_input;
  }
  return code;
}

/// A command line that a shell reads back. Of the program, only the name of the file.
inline std::string shell_command(int argc, const char* const* argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    const std::string word = i == 0 ? std::filesystem::path(argv[0]).filename().string() : argv[i];
    const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 || std::strchr("_-+=./:,@%^", c) != nullptr;
    });
    if (i > 0) line += ' ';
    if (plain) {
      line += word;
      continue;
    }
    line += '\'';
    for (const char c : word) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

/// Accepts any text but an empty one, which as a path would be the current folder.
inline CLI::Validator not_empty() {
  return {[](std::string& text) { return std::string(text.empty() ? "is empty, expected a path" : ""); }, "", "not empty"};
}

/// Accepts finite numbers from `lowest` to `highest`. (CLI::Range lets NaN pass.)
inline CLI::Validator number_in(double lowest, double highest) {
  return {[=](std::string& text) {
            char* end = nullptr;
            const double v = std::strtod(text.c_str(), &end);
            if (!text.empty() && *end == 0 && v >= lowest && v <= highest) return std::string();
            char expected[80];
            std::snprintf(expected, sizeof expected, "expected a number from %g to %g", lowest, highest);
            return "'" + text + "': " + expected;
          },
          "NUMBER", "range"};
}

}  // namespace track
