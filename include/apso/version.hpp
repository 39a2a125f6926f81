/// \file
/// The version of apso. This is the only place where it is written: CMake reads it from here.
#pragma once

#define APSO_VERSION_MAJOR 0
#define APSO_VERSION_MINOR 1
#define APSO_VERSION_PATCH 0
#define APSO_VERSION "0.1.0"
