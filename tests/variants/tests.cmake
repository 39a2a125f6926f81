# The unit tests once more under the sanitizers, and as C++20 with Clang. Each is a build of its own, of the modules
# without programs, pictures and third parties' code. Inside such a build (APSO_INNER) these tests do not exist.
option(APSO_TEST_VARIANTS "Also run the unit tests under sanitizers and as C++20 with Clang (two more builds)" OFF)
if(APSO_TEST_VARIANTS AND NOT APSO_INNER)
  set(_variant ${CMAKE_CURRENT_LIST_DIR}/build_and_test.cmake)
  add_test(NAME variant_sanitizers
           COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DBINARY=${PROJECT_BINARY_DIR}/variant_sanitizers
                   "-DOPTIONS=-DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER}|-DCMAKE_CXX_FLAGS=-O1|-DAPSO_SANITIZE=address,undefined"
                   -P ${_variant})
  find_program(APSO_CLANGXX clang++)
  if(APSO_CLANGXX)
    add_test(NAME variant_clang_cxx20
             COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DBINARY=${PROJECT_BINARY_DIR}/variant_clang_cxx20
                     "-DOPTIONS=-DCMAKE_CXX_COMPILER=${APSO_CLANGXX}|-DCMAKE_CXX_FLAGS=-O2|-DCMAKE_CXX_STANDARD=20"
                     -P ${_variant})
    set_tests_properties(variant_clang_cxx20 PROPERTIES TIMEOUT 3000 RUN_SERIAL ON)
  endif()
  set_tests_properties(variant_sanitizers PROPERTIES TIMEOUT 3000 RUN_SERIAL ON)
endif()
