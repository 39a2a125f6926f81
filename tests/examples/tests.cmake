# The short programs of examples/: each checks its own result and needs no argument. The programs apso_* have tests of
# their own, in e2e*; what their command lines have in common is tested here.
if(NOT APSO_INNER)
  file(GLOB _programs CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/examples ${PROJECT_SOURCE_DIR}/examples/*.cpp)
  foreach(_source IN LISTS _programs)
    get_filename_component(_name ${_source} NAME_WE)
    if(TARGET ${_name} AND NOT _name MATCHES "^apso_|^residual_weights$|^minimal_tracker$")
      add_test(NAME example_${_name} COMMAND ${_name})
    elseif(TARGET ${_name} AND _name MATCHES "^apso_")
      add_test(NAME command_line_${_name} COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:${_name}>
                                                  -P ${CMAKE_CURRENT_LIST_DIR}/command_line.cmake)
    endif()
  endforeach()
endif()
