// apso_report: one or more runs of apso_track as one HTML file that opens without a network: paths, errors, scores, times,
// events, and every frame with its picture, numbers and reason.

#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "report/page.hpp"
#include "track/command_line.hpp"

int main(int argc, char** argv) {
  std::vector<std::string> folders;
  std::string output = "report.html";
  double megabytes = report::default_megabytes;
  CLI::App app{
      "Makes one HTML file of one or more runs of apso_track, which opens without a network. Several runs stand side by side\n"
      "on common axes. Pictures of every frame are there if apso_track ran with --report, else those of overlays/."};
  app.add_option("RUN", folders, "folders written by apso_track")->required()->check(track::not_empty());
  app.add_option("--output", output, "HTML file to write; an earlier report is replaced, nothing else is")
      ->check(track::not_empty())
      ->capture_default_str();
  app.add_option("--megabytes", megabytes, "size to keep below, by smaller pictures")
      ->check(track::number_in(1, 1000))
      ->capture_default_str();
  return track::run_main("apso_report", app, argc, argv, [&] {
    report::refuse_foreign(output);
    const std::size_t bytes = report::write(output, {folders.begin(), folders.end()}, megabytes);
    std::printf("%s: %zu run%s, %.1f MB\n", output.c_str(), folders.size(), folders.size() == 1 ? "" : "s",
                static_cast<double>(bytes) / 1e6);
    return 0;
  });
}
