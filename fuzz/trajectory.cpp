// Trajectories: what is read is made of rigid motions in the order of time, and what is written reads back as the same.
#include <filesystem>

#include <apso/io/tum_text.hpp>

#include "input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file;
  static fuzz::MemoryFile second;
  const std::string& path = file.write(data, size);
  try {
    std::vector<std::string> warnings;
    const apso::Trajectory t = apso::read_trajectory(path, &warnings);
    fuzz::require(!t.empty(), "a trajectory that was read has poses");
    for (const std::string& w : warnings) fuzz::require(fuzz::printable_message(w.c_str()), "a warning is printable");
    for (std::size_t i = 0; i < t.size(); ++i) {
      fuzz::require(apso::is_rigid(t[i].T_world_body), "poses are rigid motions");
      fuzz::require(i == 0 || t[i - 1].timestamp < t[i].timestamp, "stamps increase");
    }
    const std::string& copy = second.write(nullptr, 0);
    apso::write_trajectory(copy, t);
    const apso::Trajectory back = apso::read_trajectory(copy);
    if (t.back().timestamp < 1e9 && t.front().timestamp > -1e9) {  // beyond, stamps that a double tells apart may not be 1e-15 apart
      fuzz::require(back.size() <= t.size(), "no pose is made up");
    }
  } catch (const apso::io_error& e) {
    fuzz::require(fuzz::printable_message(e.what()), "a message is printable");
  }
  return 0;
}
