/// \file
/// Runs apso_track as a child process, for programs that need many runs: a sequence is written
/// `NAME,option=value,...` with the options of apso_track, e.g. `synthetic:stress_dark,seed=3` or
/// `path/to/recording,camera=bonn,max-frames=200`. `camera-truth=FILE` is not for apso_track: it names the ground truth for errors of
/// motion, where that of the recording follows a body other than the camera. A complete run is not repeated.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/io/tum_text.hpp>

#include "command_line.hpp"
#include "kept_file.hpp"

namespace track {

/// A sequence with the options it is run with.
struct SequenceSpec {
  std::string text;
  std::string name;  ///< usable as the name of a folder
  std::vector<std::string> arguments;
  std::string camera_truth;  ///< ground truth in the camera's frame; empty: that of the recording is

  [[nodiscard]] bool synthetic() const { return arguments[0].rfind("synthetic:", 0) == 0; }
};

inline std::string folder_name(const std::string& text) {
  std::string s;
  for (const char c : text) s += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' ? c : '_';
  return s;
}

inline SequenceSpec parse_sequence(const std::string& text) {
  SequenceSpec spec;
  spec.text = text;
  std::stringstream parts(text);
  std::string part;
  std::getline(parts, part, ',');
  spec.arguments.push_back(part);
  namespace fs = std::filesystem;
  spec.name = spec.synthetic() ? part.substr(10) : fs::path(part).lexically_normal().filename().string();
  while (std::getline(parts, part, ',')) {
    const auto eq = part.find('=');
    if (eq != std::string::npos && part.substr(0, eq) == "camera-truth") {
      spec.camera_truth = part.substr(eq + 1);
      continue;
    }
    spec.arguments.push_back("--" + part.substr(0, eq));
    if (eq != std::string::npos) spec.arguments.push_back(part.substr(eq + 1));
    if (part.rfind("camera", 0) != 0) spec.name += "_" + part;
  }
  spec.name = folder_name(spec.name);
  return spec;
}

/// Folder of the running program, which also contains apso_track.
inline std::filesystem::path program_folder() {
  std::error_code failed;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", failed);
  return failed ? std::filesystem::path(".") : self.parent_path();
}

/// Runs a program and waits for it; its output goes to `log`. \return its exit code, -1 if it did not exit by itself
inline int run_program(const std::vector<std::string>& command, const std::string& log) {
  std::vector<char*> argv;
  for (const std::string& s : command) argv.push_back(const_cast<char*>(s.c_str()));
  argv.push_back(nullptr);
  const pid_t child = ::fork();
  if (child < 0) return -1;
  if (child == 0) {  // other threads may be running: nothing here may allocate
    const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (file < 0 || ::dup2(file, 1) < 0 || ::dup2(file, 2) < 0) ::_exit(127);
    ::execvp(argv[0], argv.data());
    ::_exit(127);
  }
  int status = 0;
  if (::waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

/// The last line of what a program wrote, without a hint at --help.
inline std::string last_words(const std::string& log) {
  std::ifstream lines(log);
  std::string last;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.rfind("Run with --help", 0) != 0) last = line;
  }
  return last;
}

/// One run to make.
struct Job {
  std::filesystem::path folder;
  std::vector<std::string> arguments;  ///< of apso_track, without --output and --quiet
  std::filesystem::path kept_frames;   ///< file for rendered frames that runs on one sequence share; empty: none
};

/// A run is complete if it has a summary that can be read, which apso_track writes last, and that tells of no failure.
inline bool complete(const std::filesystem::path& folder) {
  const auto summary = nlohmann::json::parse(std::ifstream(folder / "summary.json"), nullptr, false);
  return summary.is_object() && !summary.contains("failure");
}

/// Runs in the order in which workers take them. Runs on one synthetic sequence share files of rendered frames and of features: one of them
/// makes these, and while it does the others are put off as long as something else can be done. They are removed with the last of its runs.
/// One worker at a time may call a member.
class RunQueue {
 public:
  explicit RunQueue(const std::vector<Job>& jobs) {
    for (const Job& job : jobs) {
      left_.push_back(&job);
      if (job.kept_frames.empty()) continue;
      Users& users = files_[job.kept_frames];
      ++users.left;
      users.to_make += complete(job.folder) ? 0 : 1;
    }
  }
  ~RunQueue() {
    std::error_code used;  // there is something else in the folder
    for (const auto& file : files_) std::filesystem::remove(file.first.parent_path(), used);
  }
  RunQueue(const RunQueue&) = delete;
  RunQueue& operator=(const RunQueue&) = delete;

  /// The next run; null if none is left.
  [[nodiscard]] const Job* take() {
    if (left_.empty()) return nullptr;
    auto chosen = std::find_if(left_.begin(), left_.end(), [&](const Job* job) {
      const auto file = files_.find(job->kept_frames);
      return file == files_.end() || !file->second.rendering || complete(job->folder);
    });
    if (chosen == left_.end()) chosen = left_.begin();
    const Job* const job = *chosen;
    left_.erase(chosen);
    return job;
  }
  /// A run starts. \return arguments of apso_track for its frames: none if nobody else would use them
  [[nodiscard]] std::vector<std::string> begin(const Job& job) {
    const auto file = files_.find(job.kept_frames);
    if (file == files_.end() || (file->second.to_make < 2 && !std::filesystem::exists(file->first))) return {};
    file->second.rendering = !file->second.rendered;
    std::error_code failed;  // then apso_track renders
    std::filesystem::create_directories(file->first.parent_path(), failed);
    return {"--keep-frames", file->first.string()};
  }
  /// A run has ended. \param made  it has been run, and was not complete before
  void done(const Job& job, bool made) {
    const auto file = files_.find(job.kept_frames);
    if (file == files_.end()) return;
    if (made) {
      file->second.rendering = false;
      file->second.rendered = true;
    }
    if (--file->second.left > 0) return;
    std::error_code failed;
    std::filesystem::remove(file->first, failed);
    std::filesystem::remove(file->first.string() + kept_features_suffix, failed);
  }

 private:
  struct Users {
    int left = 0;     // runs that are not done
    int to_make = 0;  // runs that were not complete at the start
    bool rendering = false;
    bool rendered = false;
  };
  std::vector<const Job*> left_;
  std::map<std::filesystem::path, Users> files_;
};

/// Makes the runs that are not complete, `workers` at a time, and prints progress. \return one message per failed run
inline std::vector<std::string> run_jobs(const std::vector<Job>& jobs, int workers, const char* title) {
  namespace fs = std::filesystem;
  int done = 0;
  std::mutex lock;  // of all that follows
  std::vector<std::string> problems;
  const std::string program = (program_folder() / "apso_track").string();
  RunQueue queue(jobs);
  const auto work = [&] {
    std::unique_lock<std::mutex> guard(lock);
    while (const Job* const job = queue.take()) {
      const bool had = complete(job->folder);
      int code = 0;
      const std::string log = (job->folder / "log.txt").string();
      if (!had) {
        fs::create_directories(job->folder);
        std::vector<std::string> command{program};
        command.insert(command.end(), job->arguments.begin(), job->arguments.end());
        // Each worker has one thread, so that times are those of a thread, unless the sequence says otherwise.
        if (std::count(command.begin(), command.end(), "--threads") == 0) command.insert(command.end(), {"--threads", "1"});
        const std::vector<std::string> kept = queue.begin(*job);
        command.insert(command.end(), kept.begin(), kept.end());
        command.insert(command.end(), {"--quiet", "--output", job->folder.string()});
        guard.unlock();
        code = run_program(command, log);
        guard.lock();
      }
      const bool failed = code != 0 && code != exit_no_pose;
      queue.done(*job, !had);
      if (failed) {
        const std::string words = last_words(log);
        problems.push_back(log + ": exit code " + std::to_string(code) + (words.empty() ? "" : ": " + words));
      }
      std::fprintf(stderr, "%s %d/%zu  %s%s\n", title, ++done, jobs.size(), job->folder.filename().string().c_str(),
                   had ? " (was done)" : (failed ? " FAILED" : ""));
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < workers; ++i) threads.emplace_back(work);
  work();
  for (std::thread& t : threads) t.join();
  return problems;
}

}  // namespace track
