# The integrations of docs/integrate, compiled against stand-ins of the systems they are for, and run.
if(NOT APSO_INNER)
  set(_here ${CMAKE_CURRENT_LIST_DIR})
  set(_examples ${PROJECT_SOURCE_DIR}/examples/integrate)

  # ORB-SLAM3: a host that is C++17, and one that is C++14 with the bridge between. Other names keep the two apart.
  add_library(apso_orb_slam3_cxx17 OBJECT ${_here}/orb_slam3/host.cpp)
  add_library(apso_orb_slam3_cxx14 OBJECT ${_here}/orb_slam3/host.cpp)
  set_target_properties(apso_orb_slam3_cxx14 PROPERTIES CXX_STANDARD 14 CXX_STANDARD_REQUIRED ON)
  target_compile_definitions(apso_orb_slam3_cxx14 PRIVATE APSO_HOST_IS_CXX14 ORB_SLAM3=ORB_SLAM3_14 ApsoHook=ApsoHook14)
  target_compile_features(apso_orb_slam3_cxx17 PRIVATE cxx_std_17)
  get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  foreach(_host IN ITEMS apso_orb_slam3_cxx17 apso_orb_slam3_cxx14)
    target_include_directories(${_host} PRIVATE ${_examples}/orb_slam3 ${_here}/../sophus/stand_in)
    target_include_directories(${_host} SYSTEM PRIVATE ${_eigen} ${OpenCV_INCLUDE_DIRS})
    target_compile_options(${_host} PRIVATE -Wall -Wextra)
  endforeach()
  target_include_directories(apso_orb_slam3_cxx17 PRIVATE ${PROJECT_SOURCE_DIR}/include)
  add_executable(apso_test_orb_slam3 ${_here}/orb_slam3/test_orb_slam3.cpp ${_examples}/orb_slam3/apso_bridge.cpp
                                     $<TARGET_OBJECTS:apso_orb_slam3_cxx17> $<TARGET_OBJECTS:apso_orb_slam3_cxx14>)
  target_link_libraries(apso_test_orb_slam3 PRIVATE apso_test_main apso::apso apso_flags opencv_core opencv_imgproc)
  target_compile_definitions(apso_test_orb_slam3 PRIVATE APSO_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  add_test(NAME integrate_orb_slam3 COMMAND apso_test_orb_slam3)
endif()
