/// \file
/// The page of a report without its data. CMake makes the definitions from assets/.
#pragma once

#include <string>

namespace report {

std::string page_begin();    ///< up to the data of the runs
std::string page_between();  ///< from there to the pictures
std::string page_end();      ///< what follows them

}  // namespace report
