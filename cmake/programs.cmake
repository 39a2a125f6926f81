# The programs for users, apso_*, with a manual page each (component programs), and the documentation (component doc).
file(GLOB _programs CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/examples ${PROJECT_SOURCE_DIR}/examples/apso_*.cpp)
list(TRANSFORM _programs REPLACE "\\.cpp$" "")
install(TARGETS ${_programs} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)

find_program(APSO_HELP2MAN help2man)
find_program(APSO_GZIP gzip)
mark_as_advanced(APSO_HELP2MAN APSO_GZIP)
if(APSO_HELP2MAN AND APSO_GZIP)
  list(JOIN _programs "(1), " _see_also)
  string(APPEND _see_also "(1)")
  configure_file(cmake/manual.h2m.in ${PROJECT_BINARY_DIR}/man/manual.h2m @ONLY)
  set(_pages)
  foreach(_program IN LISTS _programs)
    set(_page ${PROJECT_BINARY_DIR}/man/${_program}.1)
    add_custom_command(OUTPUT ${_page}.gz
                       COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:${_program}> -DHELP2MAN=${APSO_HELP2MAN} -DGZIP=${APSO_GZIP}
                               -DINCLUDE=${PROJECT_BINARY_DIR}/man/manual.h2m -DOUTPUT=${_page}
                               -P ${PROJECT_SOURCE_DIR}/cmake/make_manual.cmake
                       DEPENDS ${_program} cmake/make_manual.cmake ${PROJECT_BINARY_DIR}/man/manual.h2m VERBATIM)
    list(APPEND _pages ${_page}.gz)
  endforeach()
  add_custom_target(apso_manuals ALL DEPENDS ${_pages})
  add_dependencies(apso_programs apso_manuals)
  install(FILES ${_pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
else()
  message(STATUS "the programs get no manual pages: help2man or gzip was not found")
endif()

set(_doc ${CMAKE_INSTALL_DATADIR}/doc)
install(FILES LICENSE DESTINATION ${_doc}/apso RENAME copyright COMPONENT programs)
install(FILES LICENSE DESTINATION ${_doc}/apso-doc RENAME copyright COMPONENT doc)
# Pages and the sources that they show, as in the repository, so that their links work.
install(FILES README.md CHANGELOG.md CONTRIBUTING.md CITATION.cff LICENSE DESTINATION ${_doc}/apso COMPONENT doc)
install(DIRECTORY docs examples DESTINATION ${_doc}/apso COMPONENT doc PATTERN "Doxyfile" EXCLUDE PATTERN "*.dox" EXCLUDE PATTERN "*.py" EXCLUDE)
