# What is installed, and how it becomes Debian packages. The component headers is text only, the same on every architecture;
# programs and doc are there unless APSO_HEADERS_ONLY is set.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(_package_dir ${CMAKE_INSTALL_DATADIR}/cmake/apso)

install(DIRECTORY include/apso DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT headers FILES_MATCHING PATTERN "*.hpp")
install(TARGETS apso EXPORT apsoTargets COMPONENT headers)
install(EXPORT apsoTargets NAMESPACE apso:: DESTINATION ${_package_dir} COMPONENT headers)
configure_package_config_file(cmake/apsoConfig.cmake.in ${PROJECT_BINARY_DIR}/apsoConfig.cmake
                              INSTALL_DESTINATION ${_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/apsoConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(FILES ${PROJECT_BINARY_DIR}/apsoConfig.cmake ${PROJECT_BINARY_DIR}/apsoConfigVersion.cmake
              cmake/apsoComponents.cmake
        DESTINATION ${_package_dir} COMPONENT headers)
configure_file(cmake/apso.pc.in ${PROJECT_BINARY_DIR}/apso.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/apso.pc DESTINATION ${CMAKE_INSTALL_DATADIR}/pkgconfig COMPONENT headers)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libapso-dev RENAME copyright COMPONENT headers)
install(FILES CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libapso-dev COMPONENT headers)

if(APSO_BUILD_EXAMPLES AND APSO_IS_MAIN)
  include(cmake/programs.cmake)
endif()

if(APSO_IS_MAIN)
  set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # installing builds nothing: not the tests, and for the headers not the programs
  set(CPACK_GENERATOR DEB)
  set(CPACK_PACKAGE_NAME apso)
  set(CPACK_PACKAGE_VENDOR "the apso authors")
  set(CPACK_PACKAGE_CONTACT "the apso authors <apso@example.org>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  # one package for each component
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_COMPONENTS_GROUPING IGNORE)
  set(CPACK_COMPONENTS_ALL headers)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_HEADERS_PACKAGE_NAME libapso-dev)
  set(CPACK_DEBIAN_HEADERS_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_HEADERS_PACKAGE_SECTION libdevel)
  set(CPACK_DEBIAN_HEADERS_PACKAGE_DEPENDS "libeigen3-dev (>= 3.3)")
  set(CPACK_DEBIAN_HEADERS_PACKAGE_SUGGESTS "libopencv-dev (>= 4), libyaml-cpp-dev")
  set(CPACK_DEBIAN_HEADERS_DESCRIPTION "Header-only C++17 library: what moves in a frame, can the frame be trusted,
and where is the camera really if not. Needs Eigen; includes adapters for OpenCV and Sophus.")
  if(APSO_BUILD_EXAMPLES)
    list(APPEND CPACK_COMPONENTS_ALL programs doc)
    set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME apso)
    set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION science)
    set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
    set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS gnuplot-nox)
    set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS apso-doc)
    set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION "Tracks RGB-D recordings, evaluates trajectories, compares motion policies,
makes synthetic recordings and reports.")
    set(CPACK_DEBIAN_DOC_PACKAGE_NAME apso-doc)
    set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
    set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
    set(CPACK_DEBIAN_DOC_DESCRIPTION "Pages in Markdown, and the sources of the programs that they show.")
  endif()
  include(CPack)
endif()
