# Rules about the headers as files: what may include what, that each compiles alone, and that no warning appears.
set(_rules ${CMAKE_CURRENT_LIST_DIR}/check_rules.cmake)
add_test(NAME headers_rules COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -P ${_rules})

# Formatted as .clang-format says, by the release it was written for: others break lines differently.
find_program(APSO_CLANG_FORMAT NAMES clang-format-14 clang-format)
if(APSO_CLANG_FORMAT)
  execute_process(COMMAND ${APSO_CLANG_FORMAT} --version OUTPUT_VARIABLE _version)
  if(_version MATCHES "version 14\\.")
    add_test(NAME format COMMAND ${PROJECT_SOURCE_DIR}/scripts/format.sh --check ${APSO_CLANG_FORMAT})
  endif()
endif()

get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
find_program(APSO_GXX g++)
find_program(APSO_CLANGXX clang++)
# Alone: one compilation per header, with the compiler that is quicker at it. Together: all headers in one file, twice.
if(APSO_CLANGXX)
  set(_jobs CLANGXX:17:alone CLANGXX:20:together)
else()
  set(_jobs GXX:17:alone)
endif()
foreach(_job IN ITEMS GXX:17:together GXX:20:together ${_jobs})
  string(REPLACE ":" ";" _job ${_job})
  list(GET _job 0 _compiler)
  list(GET _job 1 _standard)
  list(GET _job 2 _mode)
  if(APSO_${_compiler})
    string(TOLOWER headers_${_mode}_${_compiler}_${_standard} _name)
    add_test(NAME ${_name}
             COMMAND ${CMAKE_CURRENT_LIST_DIR}/syntax.sh ${APSO_${_compiler}} ${_standard} ${_mode}
                     ${PROJECT_SOURCE_DIR}/include ${CMAKE_CURRENT_BINARY_DIR}/${_name} ${_eigen})
    set_tests_properties(${_name} PROPERTIES TIMEOUT 1800)
  endif()
endforeach()
