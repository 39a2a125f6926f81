#include "command_line.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include <apso/version.hpp>

#include "help.hpp"

namespace track {
namespace {

// Letters to insert, remove, exchange or swap with their neighbour to turn one word into the other.
std::size_t edits(const std::string& a, const std::string& b) {
  std::vector<std::size_t> last2, last, row(b.size() + 1);  // of the beginnings of a, with every beginning of b
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    last2 = std::exchange(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], last2[j - 2] + 1);
    }
  }
  return row.back();
}

// The option that was probably meant by one that does not exist: the first that begins with it, else the nearest of those
// that differ by a third of their letters at most. Empty: none.
std::string nearest_option(const CLI::App& app, const std::string& word) {
  std::string nearest;
  std::size_t fewest = 0;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      const std::string known = "--" + name;
      const bool begins = word.size() > 3 && known.rfind(word, 0) == 0;
      const std::size_t n = begins ? 0 : edits(word, known);
      if (3 * n > name.size() || (!nearest.empty() && n >= fewest)) continue;
      nearest = known;
      fewest = n;
    }
  }
  return nearest;
}

}  // namespace

int run_main(const char* name, CLI::App& app, int argc, char** argv, const std::function<int()>& body) {
  int code = 0;
  app.name(name);
  app.formatter(std::make_shared<HelpFormatter>());
  app.set_version_flag("--version", std::string(name) + ' ' + APSO_VERSION);
  try {
    app.parse(argc, argv);
    code = body();
  } catch (const CLI::Success& e) {  // --help, --version
    app.exit(e);
  } catch (const CLI::ParseError& e) {
    bool unknown = false;
    for (const std::string& word : app.remaining()) {  // CLI11 may tell only that a required option is missing
      if (word.rfind('-', 0) != 0) continue;
      const std::string option = word.substr(0, word.find('='));
      const std::string meant = nearest_option(app, option);
      std::fprintf(stderr, "%s: there is no option %s%s\n", name, option.c_str(),
                   meant.empty() ? "" : ("; did you mean " + meant + "?").c_str());
      unknown = true;
    }
    if (unknown) {
      std::fprintf(stderr, "Run with --help for more information.\n");
    } else {
      app.exit(e);
    }
    return exit_usage;
  } catch (const std::exception& e) {
    const bool named = std::strncmp(e.what(), "apso: ", 6) == 0;  // a message of the library; the program's name says it already
    std::fprintf(stderr, "%s: %s\n", name, e.what() + (named ? 6 : 0));
    code = exit_bad_input;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fprintf(stderr, "%s: cannot write to the standard output\n", name);
    if (code == 0) code = exit_bad_input;
  }
  return code;
}

std::string shell_command(int argc, const char* const* argv) {
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

CLI::Validator not_empty() {
  return {[](std::string& text) { return std::string(text.empty() ? "is empty, expected a path" : ""); }, "", "not empty"};
}

CLI::Validator number_in(double lowest, double highest) {
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

CLI::Validator count() {
  return {[](std::string& text) {
            const bool digits =
                !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
            return digits ? std::string() : "'" + text + "': expected a whole number, 0 or more";
          },
          "", "count"};
}

}  // namespace track
