# The documentation: code in it is that of compiled files, the site has no dead links, and the API reference no warnings.
if(NOT APSO_INNER)
  add_test(NAME docs_snippets COMMAND ${PROJECT_SOURCE_DIR}/scripts/snippets.sh --check)
  find_program(APSO_MKDOCS mkdocs)
  if(APSO_MKDOCS)
    add_test(NAME docs_site COMMAND ${APSO_MKDOCS} build --strict --quiet --config-file ${PROJECT_SOURCE_DIR}/mkdocs.yml
                                    --site-dir ${CMAKE_CURRENT_BINARY_DIR}/site)
  else()
    message(STATUS "docs_site is not tested: mkdocs was not found")
  endif()
  find_program(APSO_DOXYGEN doxygen)
  if(APSO_DOXYGEN)
    add_test(NAME docs_api COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DDOXYGEN=${APSO_DOXYGEN}
                                   -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/api -P ${CMAKE_CURRENT_LIST_DIR}/api.cmake)
  else()
    message(STATUS "docs_api is not tested: doxygen was not found")
  endif()
endif()
