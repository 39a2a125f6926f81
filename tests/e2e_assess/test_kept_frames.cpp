// Rendered frames that several runs share: no result depends on them, whatever happens to their file.
#ifdef APSO_PROGRAMS
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "../run_program.hpp"

namespace {

const std::string sequence = "synthetic:walking_xyz --seed 103 --max-frames 14 --threads 1 --quiet ";

std::string bytes(const fs::path& file) {
  std::stringstream all;
  all << std::ifstream(file, std::ios::binary).rdbuf();
  return all.str();
}

void check_same_results(const fs::path& a, const fs::path& b, bool pictures = true) {
  CAPTURE(b.string());
  CHECK(fs::exists(b / "contact_sheet.png") == pictures);
  std::vector<const char*> files{"trajectory.txt", "trajectory_features.txt"};
  if (pictures) files.push_back("contact_sheet.png");
  for (const char* file : files) {
    CAPTURE(file);
    REQUIRE(fs::file_size(a / file) > 0);
    CHECK(bytes(a / file) == bytes(b / file));
  }
  const Table one(a / "frames.csv");
  const Table other(b / "frames.csv");
  REQUIRE(one.header == other.header);
  REQUIRE(one.rows.size() == other.rows.size());
  for (std::size_t row = 0; row < one.rows.size(); ++row) {
    for (const std::string& column : one.header) {
      if (column.rfind("ms_", 0) == 0) continue;
      CAPTURE(column);
      CHECK(one.field(row, column) == other.field(row, column));
    }
  }
}

double median_load(const fs::path& folder) {
  const Table table(folder / "frames.csv");
  std::vector<double> ms;
  for (std::size_t row = 0; row < table.rows.size(); ++row) ms.push_back(std::stod(table.field(row, "ms_load")));
  std::sort(ms.begin(), ms.end());
  return ms.at(ms.size() / 2);
}

}  // namespace

TEST_CASE("frames that another run has rendered are taken from its file, and the results are the same bytes") {
  const Folder f;
  const auto track = [&](const std::string& options, const std::string& name) {
    const Outcome o = run(APSO_PROGRAMS "/apso_track " + sequence + options + " --output " + (f.path / name).string(), f.path);
    INFO(o.text);
    REQUIRE(o.code == 0);
    return o.text;
  };
  const std::string keep = "--keep-frames " + (f.path / "kept").string();
  track("--true-masks", "alone");
  track("--true-masks " + keep, "writes");
  const std::uintmax_t frame = 640 * 480 * 8 + 8;  // colour, depth, person, and a checksum
  CHECK(fs::file_size(f.path / "kept") == 16 + 14 * frame);
  const std::string first = bytes(f.path / "kept");
  CHECK(track("--true-masks " + keep, "reads").find("warning") == std::string::npos);
  CHECK(median_load(f.path / "reads") < 0.5 * median_load(f.path / "alone"));
  CHECK(bytes(f.path / "kept") == first);
  check_same_results(f.path / "alone", f.path / "writes");
  check_same_results(f.path / "alone", f.path / "reads");

  // broken: bytes of frame 3, all of frame 5, and the end
  {
    std::fstream file(f.path / "kept", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(16 + 3 * frame + 500000));
    file << "broken";
    file.seekp(static_cast<std::streamoff>(16 + 5 * frame));
    file << std::string(frame, '\0');
  }
  fs::resize_file(f.path / "kept", 16 + 9 * frame + 12345);
  // and of the features those of frame 5: tracks of the frames after it come from images whose features were kept
  const std::string features = bytes(f.path / "kept.features");
  const std::size_t place = (features.size() - 16) / 14;
  REQUIRE(features.size() == 16 + 14 * place);
  CHECK(place > 1000 * 32);
  {
    std::fstream file(f.path / "kept.features", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(16 + 5 * place + 3000));
    file << "broken";
  }
  track("--true-masks " + keep, "mends");
  check_same_results(f.path / "alone", f.path / "mends");
  CHECK(bytes(f.path / "kept") == first);
  track("--true-masks " + keep, "mended");
  check_same_results(f.path / "alone", f.path / "mended");

  // other settings of the features find others
  std::ofstream(f.path / "fewer.yaml") << "tracker:\n  orb:\n    features: 600\n";
  const std::string fewer = "--true-masks --config " + (f.path / "fewer.yaml").string() + " ";
  track(fewer, "fewer_alone");
  track(fewer + keep, "fewer");
  check_same_results(f.path / "fewer_alone", f.path / "fewer");
  CHECK(bytes(f.path / "fewer" / "trajectory.txt") != bytes(f.path / "alone" / "trajectory.txt"));

  // frames of another recording are not taken
  const std::string other = "--people 1 ";
  track(other, "other_alone");
  track(other + keep, "other");
  check_same_results(f.path / "other_alone", f.path / "other");
  CHECK(bytes(f.path / "other" / "trajectory.txt") != bytes(f.path / "alone" / "trajectory.txt"));
}

TEST_CASE("without room or a file for the frames they are rendered, and nothing of the user's is changed") {
  const Folder f;
  const std::string d = f.path.string();
  const auto track = [&](const std::string& limit, const std::string& options, const std::string& name) {
    const Outcome o = run(limit + APSO_PROGRAMS "/apso_track " + sequence + options + " --output " + d + "/" + name, f.path);
    INFO(o.text);
    REQUIRE(o.code == 0);
    return o.text;
  };
  track("", "", "alone");
  // files end at 10 MB: four frames are kept, of the fifth a part
  CHECK(track("ulimit -f 20000; ", "--keep-frames " + d + "/small", "full").find("warning") == std::string::npos);
  CHECK(fs::file_size(f.path / "small") < 14 * 640 * 480 * 8);
  check_same_results(f.path / "alone", f.path / "full");

  std::ofstream(f.path / "thesis.txt") << "all that I know about frames\n";
  CHECK(track("", "--keep-frames " + d + "/thesis.txt", "foreign").find("is no file of frames, and stays as it is") != std::string::npos);
  CHECK(bytes(f.path / "thesis.txt") == "all that I know about frames\n");
  check_same_results(f.path / "alone", f.path / "foreign");
  CHECK(track("", "--keep-frames " + d + "/nowhere/kept", "nowhere").find("cannot be opened") != std::string::npos);
  check_same_results(f.path / "alone", f.path / "nowhere");

  const Outcome o = run(APSO_PROGRAMS "/apso_track " + d + " --camera bonn --keep-frames x --output " + d + "/x", f.path);
  CHECK(o.code == 2);
  CHECK(o.text.find("--keep-frames: only synthetic sequences have that") != std::string::npos);
}

TEST_CASE("apso_ablate renders a sequence once for its variants, two at a time, and cleans up") {
  const Folder f;
  const std::string d = f.path.string();
  const std::string ablate = APSO_PROGRAMS
                             "/apso_ablate synthetic:walking_xyz,seed=103,max-frames=14 --only plain,no_refinement,default,true_masks "
                             "--repeats 2 --jobs 2 --output " +
                             d + "/ab";
  Outcome o = run(ablate, f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  CHECK_FALSE(fs::exists(f.path / "ab/kept_frames"));
  const auto run_of = [&](const std::string& variant, int repetition) {
    return f.path / "ab" / variant / ("walking_xyz_seed_103_max-frames_14_r" + std::to_string(repetition));
  };
  for (const char* variant : {"plain", "no_refinement", "default", "true_masks"}) {
    const std::string alone = d + "/" + variant;
    const std::string masks = std::string(variant) == "true_masks" ? " --true-masks" : "";
    o = run(APSO_PROGRAMS "/apso_track " + sequence + "--config " + d + "/ab/configs/" + variant + ".yaml" + masks + " --output " + alone,
            f.path);
    REQUIRE(o.code == 0);
    check_same_results(alone, run_of(variant, 0), false);
    CHECK(read_json(run_of(variant, 1) / "summary.json")["command"].get<std::string>().find("--keep-frames") != std::string::npos);
  }
  // the second worker did not render the first's sequence too, as there was another to render
  int rendered = 0;
  for (const char* variant : {"plain", "no_refinement", "default", "true_masks"}) {
    for (const int repetition : {0, 1}) rendered += median_load(run_of(variant, repetition)) > 0.5 * median_load(d + "/plain") ? 1 : 0;
  }
  CHECK(rendered == 2);

  // stopped: two runs are left to do, and a file that a killed run was writing
  fs::remove(run_of("default", 1) / "summary.json");
  fs::remove(run_of("true_masks", 1) / "summary.json");
  const std::string before = bytes(run_of("default", 1) / "trajectory.txt");
  fs::create_directories(f.path / "ab/kept_frames");
  std::ofstream(f.path / "ab/kept_frames/walking_xyz_seed_103_max-frames_14_r1", std::ios::binary)
      << std::string("apso frames 1\n\0\0", 16) << std::string(3000000, 'x');
  o = run(ablate, f.path);
  REQUIRE(o.code == 0);
  CHECK(bytes(run_of("default", 1) / "trajectory.txt") == before);
  CHECK_FALSE(fs::exists(f.path / "ab/kept_frames"));
}
#endif
