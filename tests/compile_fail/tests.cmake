# Programs that must not compile, with the sentence the compiler has to show in its first ten lines (the first line of
# each file). Compiled with -DCONTROL, and without the flags of a second line `// with: flags`, each of them is correct, so it is the
# mistake that fails and nothing else.
find_program(APSO_GXX g++)
find_program(APSO_CLANGXX clang++)
get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
# Each compiler and each standard once; the correct programs with one of them, the quicker one.
set(_control GXX)
if(APSO_CLANGXX)
  set(_control CLANGXX)
endif()
foreach(_pair IN ITEMS GXX:17 CLANGXX:20)
  string(REPLACE ":" ";" _pair ${_pair})
  list(GET _pair 0 _compiler)
  list(GET _pair 1 _standard)
  if(APSO_${_compiler})
    string(COMPARE EQUAL ${_compiler} ${_control} _is_control)
    string(TOLOWER compile_fail_${_compiler}_${_standard} _name)
    add_test(NAME ${_name} COMMAND ${CMAKE_COMMAND} -DCOMPILER=${APSO_${_compiler}} -DSTANDARD=${_standard}
                                   -DINCLUDE=${PROJECT_SOURCE_DIR}/include -DEIGEN=${_eigen}
                                   -DCASES=${CMAKE_CURRENT_LIST_DIR} -DCONTROL=${_is_control}
                                   -DSCRATCH=${CMAKE_CURRENT_BINARY_DIR}/${_name}
                                   -P ${CMAKE_CURRENT_LIST_DIR}/check.cmake)
    set_tests_properties(${_name} PROPERTIES TIMEOUT 900)
  endif()
endforeach()
