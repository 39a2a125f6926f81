# With Sophus where it is installed, else with a stand-in of the same shape.
find_package(Sophus QUIET)
if(TARGET Sophus::Sophus)
  target_link_libraries(apso_test_sophus PRIVATE Sophus::Sophus)
else()
  target_include_directories(apso_test_sophus PRIVATE ${CMAKE_CURRENT_LIST_DIR}/stand_in)
endif()
