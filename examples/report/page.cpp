#include "page.hpp"

#include <fstream>
#include <utility>

#include <nlohmann/json.hpp>

#include <apso/io/parameters.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/version.hpp>

#include "../track/config.hpp"
#include "../track/pictures.hpp"
#include "../track/results.hpp"
#include "assets.hpp"
#include "pictures.hpp"
#include "run_data.hpp"

namespace report {
namespace {

// One run of a report.
struct RunReport {
  json data;  ///< of run_data()
  Pictures pictures;
};

// JSON that may stand in a script element: nothing in it can end the element, and bytes that are not UTF-8 are replaced.
std::string embeddable(const json& content) {
  const std::string text = content.dump(-1, ' ', false, json::error_handler_t::replace);
  std::string out;
  out.reserve(text.size());
  for (const char c : text) c == '<' ? out += "\\u003c" : out += c;  // '<' is found within strings only
  return out;
}

// \param megabytes limit of the size of the page; the pictures are made smaller to keep it
std::string page(std::vector<RunReport> runs, double megabytes) {
  std::vector<Pictures> pictures;
  json data{{"version", APSO_VERSION}, {"runs", json::array()}};
  for (RunReport& r : runs) {
    data["runs"].push_back(std::move(r.data));
    pictures.push_back(std::move(r.pictures));
  }
  data["defaults"] = flat(track::yaml_to_json(apso::write_parameters(track::Config{})));
  const std::string numbers = embeddable(data);
  const double frame_of_page = static_cast<double>(std::string(page_begin()).size() + std::string(page_end()).size());
  fit(pictures, (megabytes * 1e6 - static_cast<double>(numbers.size()) - frame_of_page) * 0.74);  // base64 makes 4 bytes of 3
  json links = json::array();
  for (const Pictures& run : pictures) {
    json of_run = json::object();
    for (const auto& [frame, jpeg] : run) of_run[std::to_string(frame)] = track::data_uri("image/jpeg", jpeg);
    links.push_back(std::move(of_run));
  }
  return page_begin() + numbers + page_between() + embeddable(links) + page_end();
}

}  // namespace

std::size_t write(const std::filesystem::path& file, const std::vector<std::filesystem::path>& folders, double megabytes,
                  const std::string& name) {
  std::vector<RunReport> runs;
  for (const std::filesystem::path& folder : folders) runs.push_back({run_data(folder, name), read_pictures(folder)});
  const std::string text = page(std::move(runs), megabytes);
  track::write_file(file, text);
  return text.size();
}

void refuse_foreign(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  fs::path part = file;
  part += ".part";  // of write_file()
  if (fs::exists(fs::symlink_status(part))) throw apso::io_error(part.string() + ": is in the way, remove it or take another name");
  if (!fs::exists(fs::symlink_status(file))) return;
  if (fs::is_directory(file)) throw apso::io_error(file.string() + ": is a folder, expected the name of a file");
  std::string begin(400, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (fs::is_regular_file(fs::symlink_status(file)) && begin.find("name=\"generator\" content=\"apso_report\"") != std::string::npos)
    return;
  throw apso::io_error(file.string() + ": is there and is no report of apso; remove it or take another name");
}

}  // namespace report
