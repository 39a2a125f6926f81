// Programs from the outside: a folder that goes away with the test, what a run prints and returns, the tables it writes.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace fs = std::filesystem;
using json = nlohmann::json;

namespace {

struct Folder {
  fs::path path;
  Folder() : path(fs::temp_directory_path() / ("apso_run_program_" + std::to_string(::getpid()))) {
    fs::remove_all(path);
    fs::create_directories(path);
  }
  ~Folder() { fs::remove_all(path); }
};

struct Outcome {
  int code = -1;
  std::string text;  // both streams
};

Outcome run(const std::string& command, const fs::path& folder) {
  const std::string log = (folder / "log.txt").string();
  const int status = std::system((command + " > " + log + " 2>&1").c_str());
  std::stringstream text;
  text << std::ifstream(log).rdbuf();
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text.str()};
}

[[maybe_unused]] json read_json(const fs::path& file) { return json::parse(std::ifstream(file)); }

// A CSV file with a header. Fields in quotes may hold commas.
struct Table {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;

  explicit Table(const fs::path& file) {
    std::ifstream in(file);
    std::string line;
    std::getline(in, line);
    header = split(line);
    while (std::getline(in, line)) rows.push_back(split(line));
  }
  [[nodiscard]] bool has(const std::string& name) const { return std::find(header.begin(), header.end(), name) != header.end(); }
  [[nodiscard]] const std::string& field(std::size_t row, const std::string& name) const {
    if (!has(name)) throw std::runtime_error("no column " + name);
    return rows.at(row).at(static_cast<std::size_t>(std::find(header.begin(), header.end(), name) - header.begin()));
  }

 private:
  static std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> fields(1);
    bool quoted = false;
    for (char c : line) {
      if (c == '"') quoted = !quoted;
      if (c == ',' && !quoted) {
        fields.emplace_back();
      } else {
        fields.back() += c;
      }
    }
    return fields;
  }
};

}  // namespace
