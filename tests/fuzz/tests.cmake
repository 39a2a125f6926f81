# The fuzz targets of text, each over its seeds and a few thousand inputs made of them: that they compile, and that what was mended
# stays so. fuzz/README.md has the longer runs.
find_program(APSO_CLANGXX clang++)
if(APSO_CLANGXX)
  get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  add_test(NAME fuzz_smoke COMMAND ${CMAKE_CURRENT_LIST_DIR}/smoke.sh ${APSO_CLANGXX} ${PROJECT_SOURCE_DIR}
                                   ${CMAKE_CURRENT_BINARY_DIR}/fuzz_smoke ${_eigen})
  set_tests_properties(fuzz_smoke PROPERTIES TIMEOUT 600 SKIP_RETURN_CODE 77)
endif()
