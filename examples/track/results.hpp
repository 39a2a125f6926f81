/// \file
/// Folders and files of results: nothing of the user's is overwritten, and results of two runs never mix.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/io/tum_text.hpp>

namespace track {

/// Files that apso_track may write, besides overlays/NNNNNN.png, masks/NAME.png and thumbnails/NNNNNN.jpg.
inline std::vector<std::string> result_files(bool report = false) {
  std::vector<std::string> names{"frames.csv",     "trajectory.txt", "trajectory_features.txt", "groundtruth.txt",
                                 "trajectory.png", "trajectory.svg", "trajectory.pdf",          "scores.png",
                                 "scores.svg",     "scores.pdf",     "contact_sheet.png",       "overview.png",
                                 "overview.svg",   "summary.json"};
  if (report) names.emplace_back("report.html");
  return names;
}

/// An input of a program: what the user calls it, and where it is. An empty path is no input.
struct Input {
  std::string name;
  std::string path;
};

/// `inner` is `outer` or lies in it, also through links. `inner` need not exist.
inline bool lies_in(const std::filesystem::path& inner, const std::filesystem::path& outer) {
  namespace fs = std::filesystem;
  std::error_code different;
  for (fs::path p = fs::weakly_canonical(fs::absolute(inner));; p = p.parent_path()) {
    if (fs::equivalent(p, outer, different)) return true;
    if (p == p.parent_path()) return false;
  }
}

/// Throws io_error when the output is, contains or lies in one of the inputs.
inline void keep_apart(const std::string& output, const std::vector<Input>& inputs) {
  for (const Input& in : inputs) {
    std::error_code unreadable;
    if (in.path.empty() || !std::filesystem::exists(in.path, unreadable)) continue;
    const bool inside = lies_in(output, in.path);
    const bool outside = lies_in(in.path, output);
    if (!inside && !outside) continue;
    throw apso::io_error("cannot write to " + output + ": it " +
                         (inside && outside ? "is "
                          : inside          ? "lies in "
                                            : "contains ") +
                         in.name + " (" + in.path + "), which is only read; take another place");
  }
}

/// The error of a stream that has just failed.
inline apso::io_error cannot_write(const std::filesystem::path& file) {
  return apso::io_error(file.string() + ": cannot write: " + std::strerror(errno));
}

/// Writes a file as a whole: under another name first, so that a file of this name is never half written.
inline void write_file(const std::filesystem::path& file, const std::string& bytes) {
  std::filesystem::path part = file;
  part += ".part";
  std::ofstream out(part, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) {
    const apso::io_error error = cannot_write(file);
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw error;
  }
  std::filesystem::rename(part, file);
}

/// Bytes that are not UTF-8, e.g. in names of files, are written as U+FFFD.
inline void write_json(const std::filesystem::path& file, const nlohmann::json& content) {
  write_file(file, content.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n');
}

/// \param file its extension is the format
inline void write_image(const std::filesystem::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(file.extension().string(), image, bytes)) throw apso::io_error(file.string() + ": cannot encode the image");
  write_file(file, std::string(bytes.begin(), bytes.end()));
}

/// Holds a folder for one program at a time.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder) : file_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (file_ < 0) throw apso::io_error("--output: " + folder.string() + ": cannot be read");
    if (::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;  // some file systems have no locks
    ::close(file_);
    throw apso::io_error("--output: " + folder.string() + ": another run is writing into it");
  }
  ~FolderLock() { ::close(file_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_;
};

/// A folder of results. What a run writes goes to the subfolder unfinished/; finish() puts it in the place of the results of
/// the run before. The list apso_files.txt names what a run wrote: only that is ever removed or replaced.
class ResultFolder {
 public:
  /// \param names files that the run is going to write at least
  /// Throws io_error if one of them is there already and no run wrote it, or another run is at work in the folder.
  ResultFolder(const std::string& output, const std::vector<std::string>& names)
      : folder_(output), part_(folder_ / "unfinished"), lock_(made(folder_)), old_(listed(folder_)) {
    for (const std::string& name : names) refuse_foreign(name);
    if (std::filesystem::is_symlink(part_)) throw apso::io_error(part_.string() + ": is a link, expected a folder for new results");
    clear_unfinished(listed(part_));  // of a run that was killed
    list_.open(made(part_) / list_name);
  }
  ResultFolder(const ResultFolder&) = delete;
  ResultFolder& operator=(const ResultFolder&) = delete;

  /// The folder that is written to until finish().
  [[nodiscard]] const std::filesystem::path& unfinished() const { return part_; }

  /// Where to write a result. \param name relative to the folder of results, e.g. masks/1.png
  std::filesystem::path file(const std::string& name) {
    made((part_ / name).parent_path());
    list_ << name << '\n';
    list_.flush();
    if (!list_) throw cannot_write(part_ / list_name);
    new_.push_back(name);
    return part_ / name;
  }

  /// Removes the results of the run before and moves the new ones to their place, in the order in which they were asked for.
  void finish() {
    namespace fs = std::filesystem;
    for (const std::string& name : new_) refuse_foreign(name);
    std::string both;  // whatever happens from here on, the next run knows what is ours
    for (const std::string& name : old_) both += name + '\n';
    for (const std::string& name : new_) both += name + '\n';
    write_file(folder_ / list_name, both);
    remove_listed(folder_, old_);
    for (const std::string& name : new_) {
      if (!fs::exists(part_ / name)) continue;  // a picture may be left out
      made((folder_ / name).parent_path());
      fs::rename(part_ / name, folder_ / name);
    }
    list_.close();
    fs::rename(part_ / list_name, folder_ / list_name);
    clear_unfinished({new_.begin(), new_.end()});
  }

 private:
  using Names = std::set<std::string>;
  static constexpr const char* list_name = "apso_files.txt";

  static const std::filesystem::path& made(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    return folder;
  }
  /// The files of a folder that a run wrote.
  static Names listed(const std::filesystem::path& folder) {
    Names names;
    std::ifstream in(folder / list_name);
    for (std::string name; std::getline(in, name);) {
      const std::filesystem::path p(name);
      if (name.empty() || p.is_absolute() || std::find(p.begin(), p.end(), "..") != p.end()) {
        throw apso::io_error((folder / list_name).string() + ": not a list of results, it names '" + name + "'");
      }
      names.insert(name);
    }
    return names;
  }
  /// A folder between `folder` and the file is a link, so the file lies somewhere else.
  static bool through_link(const std::filesystem::path& folder, const std::filesystem::path& name) {
    for (auto p = name.parent_path(); !p.empty(); p = p.parent_path()) {
      if (std::filesystem::is_symlink(folder / p)) return true;
    }
    return false;
  }
  static void remove_if_empty(const std::filesystem::path& folder) {
    namespace fs = std::filesystem;
    if (fs::is_directory(fs::symlink_status(folder)) && fs::is_empty(folder)) fs::remove(folder);
  }
  /// Removes files, and the subfolders that are then empty.
  static void remove_listed(const std::filesystem::path& folder, const Names& names) {
    for (const std::string& name : names) {
      if (!through_link(folder, name)) std::filesystem::remove(folder / name);
    }
    for (const std::string& name : names) {
      if (through_link(folder, name)) continue;
      for (auto p = std::filesystem::path(name).parent_path(); !p.empty(); p = p.parent_path()) remove_if_empty(folder / p);
    }
  }
  void clear_unfinished(const Names& names) const {
    if (!std::filesystem::exists(part_)) return;
    remove_listed(part_, names);
    std::filesystem::remove(part_ / list_name);
    remove_if_empty(part_);
  }
  void refuse_foreign(const std::string& name) const {
    const std::filesystem::path file = folder_ / name;
    const bool there = std::filesystem::exists(std::filesystem::symlink_status(file));
    if ((!there || old_.count(name) != 0) && !through_link(folder_, name)) return;
    throw apso::io_error("--output: " + file.string() + " is there, and no run has it in its list " + list_name +
                         "; remove it or take another folder" + (new_.empty() ? "" : " (the new results are in " + part_.string() + ")"));
  }

  std::filesystem::path folder_;
  std::filesystem::path part_;
  FolderLock lock_;
  Names old_;
  std::vector<std::string> new_;
  std::ofstream list_;
};

}  // namespace track
