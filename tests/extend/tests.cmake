# The programs of docs/extend.md, each one file of a user's: compiled with warnings as errors, and run. They check
# themselves. Eigen is all they need.
if(NOT APSO_INNER)
  file(GLOB _programs CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/examples/extend/*.cpp)
  foreach(_source IN LISTS _programs)
    get_filename_component(_name ${_source} NAME_WE)
    add_executable(apso_extend_${_name} ${_source})
    target_link_libraries(apso_extend_${_name} PRIVATE apso::apso apso_flags)
    target_compile_options(apso_extend_${_name} PRIVATE -Werror)
    set(_scratch ${CMAKE_CURRENT_BINARY_DIR}/extend/${_name})  # some write files
    file(MAKE_DIRECTORY ${_scratch})
    add_test(NAME extend_${_name} COMMAND apso_extend_${_name} WORKING_DIRECTORY ${_scratch})
  endforeach()
endif()
