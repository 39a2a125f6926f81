/// \file
/// The folder of results that apso_track writes.
#pragma once

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/io/tum_text.hpp>

namespace track {

/// Files that a run writes, besides overlays/NNNNNN.png and masks/NAME.png. summary.json is written last.
inline const std::vector<std::string>& result_files() {
  static const std::vector<std::string> names{"summary.json",   "frames.csv", "trajectory.txt",    "trajectory_features.txt", "groundtruth.txt",
                                              "trajectory.png", "scores.png", "contact_sheet.png", "overview.png"};
  return names;
}

struct ResultFolder {
  std::filesystem::path path;
  bool holds_masks = false;  ///< masks/ was written by a run, so the next run may remove it
};

/// Prepares the folder for the results of a new run. If it contains an earlier run, the files which that run wrote are removed,
/// and nothing else.
/// \param masks_read folder of masks that the new run reads: kept even if an earlier run wrote it; empty: none
/// \param sequence   folder of the recording: refused as the folder of results
inline ResultFolder prepare_results(const std::string& output, bool write_masks, const std::string& masks_read,
                                    const std::string& sequence) {
  namespace fs = std::filesystem;
  const fs::path out(output);
  bool holds_masks = write_masks;
  std::error_code no_folder;  // synthetic recordings have none
  if (fs::equivalent(out, sequence, no_folder)) {
    throw apso::io_error("--output: " + output + " is the folder of the recording; take another one");
  }
  if (fs::exists(out / "frames.csv") || fs::exists(out / "summary.json")) {
    const auto before = nlohmann::json::parse(std::ifstream((out / "summary.json").string()), nullptr, false);
    const bool had_masks = before.is_object() && before.value("holds_masks", false);
    for (const std::string& name : result_files()) fs::remove(out / name);
    const auto remove_pictures = [&](const fs::path& folder, bool numbered) {
      if (!fs::is_directory(folder)) return;
      std::vector<fs::path> ours;
      for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string stem = entry.path().stem().string();
        const bool is_number = std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
        if (entry.path().extension() == ".png" && (is_number || !numbered)) ours.push_back(entry.path());
      }
      for (const fs::path& file : ours) fs::remove(file);
      if (fs::is_empty(folder)) fs::remove(folder);
    };
    remove_pictures(out / "overlays", true);
    const bool kept = had_masks && fs::equivalent(out / "masks", masks_read, no_folder);
    if (had_masks && !kept) remove_pictures(out / "masks", false);
    holds_masks = holds_masks || kept;
  }
  fs::create_directories(out / "overlays");
  if (write_masks) fs::create_directories(out / "masks");
  return {out, holds_masks};
}

}  // namespace track
