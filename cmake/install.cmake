# What is installed, and how it becomes a Debian package. Headers and text only: the same on every architecture.
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

if(APSO_IS_MAIN)
  set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # nothing that is installed has to be built
  set(CPACK_GENERATOR DEB)
  set(CPACK_PACKAGE_NAME libapso-dev)
  set(CPACK_PACKAGE_VENDOR "the apso authors")
  set(CPACK_PACKAGE_CONTACT "the apso authors <apso@example.org>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
  set(CPACK_PACKAGE_DESCRIPTION "Header-only C++17 library: what moves in a frame, can the frame be trusted,\n\
 and where is the camera really if not. Needs Eigen; includes adapters for OpenCV and Sophus.")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_PACKAGE_SECTION libdevel)
  set(CPACK_DEBIAN_PACKAGE_DEPENDS "libeigen3-dev (>= 3.3)")
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libopencv-dev (>= 4), libyaml-cpp-dev")
  set(CPACK_STRIP_FILES OFF)
  include(CPack)
endif()
