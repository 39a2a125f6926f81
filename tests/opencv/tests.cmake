# Tiny networks for the tests of the detector, written by a script.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_Interpreter_FOUND)
  set(_models ${CMAKE_CURRENT_BINARY_DIR}/tiny_models)
  set(_script ${CMAKE_CURRENT_LIST_DIR}/make_tiny_models.py)
  add_custom_command(OUTPUT ${_models}/tiny_yolov8.onnx COMMAND Python3::Interpreter ${_script} ${_models}
                     DEPENDS ${_script} VERBATIM)
  add_custom_target(apso_tiny_models DEPENDS ${_models}/tiny_yolov8.onnx)
  add_dependencies(apso_test_opencv apso_tiny_models)
  target_compile_definitions(apso_test_opencv PRIVATE APSO_TINY_MODELS="${_models}")
else()
  message(STATUS "Python 3 not found: the tests of the network detector are left out")
endif()
