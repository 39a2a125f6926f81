/// \file
/// The report of one or more runs as one HTML file that needs nothing else.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace report {

inline constexpr double default_megabytes = 14.5;  ///< what mail and web pages take

/// Writes the report of folders of runs. \returns its size [bytes]. \param name of the run, if there is one; empty: that of its folder
std::size_t write(const std::filesystem::path& file, const std::vector<std::filesystem::path>& folders, double megabytes,
                  const std::string& name = {});

/// Throws io_error if a file is there that is no report.
void refuse_foreign(const std::filesystem::path& file);

}  // namespace report
