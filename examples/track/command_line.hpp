/// \file
/// What the command lines of all programs have in common: exit codes, messages, checks of values.
#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

namespace track {

inline constexpr int exit_bad_input = 1;
inline constexpr int exit_usage = 2;
inline constexpr int exit_no_pose = 3;  ///< apso_track: no frame got a pose, which is a result

/// Runs a program: reads the arguments, calls the body, tells what went wrong on the standard error.
/// \param name of the program, for messages
/// \param body returns the exit code; an exception of it is bad input
int run_main(const char* name, CLI::App& app, int argc, char** argv, const std::function<int()>& body);

/// A command line that a shell reads back. Of the program, only the name of the file.
std::string shell_command(int argc, const char* const* argv);

/// Accepts any text but an empty one, which as a path would be the current folder.
CLI::Validator not_empty();

/// Accepts finite numbers from `lowest` to `highest`. (CLI::Range lets NaN pass.)
CLI::Validator number_in(double lowest, double highest);

/// Accepts whole numbers that are not negative. (CLI::NonNegativeNumber prints the largest double as the end of its range.)
CLI::Validator count();

}  // namespace track
