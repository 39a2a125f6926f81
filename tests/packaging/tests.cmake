# The ways to use the library. Those whose tool is not installed are left out, and the configuration says which.
get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
find_program(APSO_PKG_CONFIG NAMES pkgconf pkg-config)
find_program(APSO_DPKG dpkg)
find_program(APSO_MESON meson)
find_program(APSO_PYTHON python3)
set(_ways installed component subdirectory fetched copied documented single two_versions vcpkg)
foreach(_way_tool IN ITEMS pkgconfig:PKG_CONFIG deb:DPKG meson:MESON conan:PYTHON)
  string(REPLACE ":" ";" _way_tool ${_way_tool})
  list(GET _way_tool 0 _way)
  list(GET _way_tool 1 _tool)
  if(APSO_${_tool})
    list(APPEND _ways ${_way})
  else()
    message(STATUS "packaging_${_way} is not tested: its tool was not found (${_tool})")
  endif()
endforeach()
foreach(_way IN LISTS _ways)
  add_test(NAME packaging_${_way}
           COMMAND ${CMAKE_COMMAND} -DWAY=${_way} -DSOURCE=${PROJECT_SOURCE_DIR} -DBUILD=${PROJECT_BINARY_DIR}
                   -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/packaging_${_way} -DCOMPILER=${CMAKE_CXX_COMPILER}
                   -DEIGEN=${_eigen} -DVERSION=${PROJECT_VERSION} -DPKG_CONFIG=${APSO_PKG_CONFIG} -DMESON=${APSO_MESON}
                   -DPYTHON=${APSO_PYTHON} -P ${CMAKE_CURRENT_LIST_DIR}/check.cmake)
  set_tests_properties(packaging_${_way} PROPERTIES TIMEOUT 900)
endforeach()

add_test(NAME version COMMAND ${PROJECT_SOURCE_DIR}/scripts/check_version.sh)
find_program(APSO_GIT git)
if(APSO_GIT)
  add_test(NAME release COMMAND ${CMAKE_CURRENT_LIST_DIR}/check_release.sh ${PROJECT_SOURCE_DIR}
                                ${CMAKE_CURRENT_BINARY_DIR}/release ${CMAKE_CXX_COMPILER} ${_eigen})
else()
  message(STATUS "the release script is not tested: git was not found")
endif()
