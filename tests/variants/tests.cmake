# Unit tests once more, built another way: as C++20, with Clang where it is installed, under the address and the
# undefined-behaviour sanitizer. One build for the three, of the modules that are quick to compile; the others, with
# their minutes, have the preset `asan`, and the fuzz targets put alignment, assessor and pipeline under both
# sanitizers in every run. With -O1, since without it tests run for minutes. Inside such a build (APSO_INNER) this test
# does not exist.
option(APSO_TEST_VARIANTS "Also run unit tests as C++20 with Clang under sanitizers (one more build)" ON)
if(APSO_TEST_VARIANTS AND NOT APSO_INNER)
  find_program(APSO_CLANGXX clang++)
  if(APSO_CLANGXX)
    set(_compiler ${APSO_CLANGXX})
  else()
    set(_compiler ${CMAKE_CXX_COMPILER})
  endif()
  set(_options -DCMAKE_CXX_COMPILER=${_compiler} -DCMAKE_CXX_STANDARD=20 -DCMAKE_CXX_FLAGS=-O0 -DAPSO_SANITIZE=address,undefined)
  string(REPLACE ";" "|" _options "${_options}")
  add_test(NAME variant_clang_cxx20_sanitizers
           COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DBINARY=${PROJECT_BINARY_DIR}/variant
                   "-DOPTIONS=${_options}" "-DMODULES=math|traits|quality|io|evaluation" -P ${CMAKE_CURRENT_LIST_DIR}/build_and_test.cmake)
  set_tests_properties(variant_clang_cxx20_sanitizers PROPERTIES TIMEOUT 2400 COST 1000)
endif()
