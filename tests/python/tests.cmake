# The Python module, as a user gets it: `pip install` from the sources without network, then tests that compare it with a C++ program.
# Without NumPy, pybind11 and pip the test is reported as skipped. Debian's Python has them even where another one comes first on the path.
set(_found)
foreach(_candidate IN ITEMS python3 /usr/bin/python3)
  execute_process(COMMAND ${_candidate} -c "import setuptools, wheel, pip, numpy, pybind11, sys; print(sys.executable)"
                  OUTPUT_VARIABLE _out ERROR_QUIET RESULT_VARIABLE _result OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(_result EQUAL 0 AND NOT _found)
    set(_found ${_out})
  endif()
endforeach()
if(_found)
  add_executable(apso_python_reference ${PROJECT_SOURCE_DIR}/python/tests/reference.cpp)
  target_link_libraries(apso_python_reference PRIVATE apso::apso)
  add_test(NAME python COMMAND ${CMAKE_CURRENT_LIST_DIR}/test.sh ${_found} ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_BINARY_DIR}/python
                               $<TARGET_FILE:apso_python_reference>
                               $<$<TARGET_EXISTS:apso_synth>:$<TARGET_FILE:apso_synth>>)
  set_tests_properties(python PROPERTIES TIMEOUT 1800)
else()
  message(STATUS "the Python module is not tested: python3 has no numpy, pybind11, pip, setuptools and wheel")
  add_test(NAME python COMMAND ${CMAKE_COMMAND} -E echo "skipped: python3 has no numpy, pybind11, pip, setuptools and wheel")
  set_tests_properties(python PROPERTIES SKIP_REGULAR_EXPRESSION "skipped")
endif()
