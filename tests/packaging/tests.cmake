# The four ways to use the library, each tried by a small program outside of the source tree.
get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
foreach(_way IN ITEMS installed subdirectory copied)
  add_test(NAME packaging_${_way}
           COMMAND ${CMAKE_COMMAND} -DWAY=${_way} -DSOURCE=${PROJECT_SOURCE_DIR} -DBUILD=${PROJECT_BINARY_DIR}
                   -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/packaging_${_way} -DCOMPILER=${CMAKE_CXX_COMPILER}
                   -DEIGEN=${_eigen} -DVERSION=${PROJECT_VERSION} -P ${CMAKE_CURRENT_LIST_DIR}/check.cmake)
  set_tests_properties(packaging_${_way} PROPERTIES TIMEOUT 600)
endforeach()
