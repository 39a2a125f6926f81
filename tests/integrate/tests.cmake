# The integrations of docs/integrate, compiled against stand-ins of the systems they are for, and run.
if(NOT APSO_INNER)
  set(_here ${CMAKE_CURRENT_LIST_DIR})
  set(_examples ${PROJECT_SOURCE_DIR}/examples/integrate)

  # ORB-SLAM3: a host that is C++14 and sees nothing of apso, with the bridge between.
  add_library(apso_orb_slam3_host OBJECT ${_here}/orb_slam3/host.cpp)
  set_target_properties(apso_orb_slam3_host PROPERTIES CXX_STANDARD 14 CXX_STANDARD_REQUIRED ON)
  get_target_property(_eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  target_include_directories(apso_orb_slam3_host PRIVATE ${_examples}/orb_slam3 ${_here}/../sophus/stand_in)
  target_include_directories(apso_orb_slam3_host SYSTEM PRIVATE ${_eigen} ${OpenCV_INCLUDE_DIRS})
  # Not optimised, as a fork may be while it is debugged: in C++14 a constant of a class that is referred to then has no address.
  target_compile_options(apso_orb_slam3_host PRIVATE -O0 -Wall -Wextra -Wconversion -Wshadow -pedantic -Werror)
  add_executable(apso_test_orb_slam3 ${_here}/orb_slam3/test_orb_slam3.cpp ${_examples}/orb_slam3/apso_bridge.cpp
                                     $<TARGET_OBJECTS:apso_orb_slam3_host>)
  target_link_libraries(apso_test_orb_slam3 PRIVATE apso_test_main apso::apso apso_flags opencv_core opencv_imgproc opencv_video Threads::Threads)
  target_compile_definitions(apso_test_orb_slam3 PRIVATE APSO_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(apso_test_orb_slam3 PRIVATE $<$<CONFIG:Release>:-O2>)  # it tracks many frames
  add_test(NAME integrate_orb_slam3 COMMAND apso_test_orb_slam3)

  # OpenCV's own RGB-D odometry, where its contributed part is installed (libopencv-contrib-dev).
  find_package(OpenCV QUIET OPTIONAL_COMPONENTS rgbd)
  if(TARGET opencv_rgbd)
    add_executable(opencv_odometry ${_examples}/opencv_odometry/main.cpp)
    target_link_libraries(opencv_odometry PRIVATE apso_opencv apso_flags yaml-cpp opencv_rgbd)
    add_executable(apso_test_opencv_odometry ${_here}/opencv_odometry/test_opencv_odometry.cpp)
    target_include_directories(apso_test_opencv_odometry PRIVATE ${_examples}/opencv_odometry)
    target_link_libraries(apso_test_opencv_odometry PRIVATE apso_test_main apso_opencv apso_flags opencv_rgbd)
    target_compile_options(apso_test_opencv_odometry PRIVATE -Werror)  # of what the documentation shows, as below
    add_test(NAME integrate_opencv_odometry COMMAND apso_test_opencv_odometry)
  else()
    message(STATUS "integrate_opencv_odometry is not tested: OpenCV's module rgbd was not found")
  endif()

  # ROS 2: the node with its messages. main.cpp is compiled along, so that it cannot rot either.
  add_library(apso_ros_common OBJECT ${_examples}/ros_common/rgbd_slam.cpp)
  target_link_libraries(apso_ros_common PRIVATE apso_opencv apso_flags)
  target_compile_options(apso_ros_common PRIVATE -Werror)
  add_executable(apso_test_ros2 ${_here}/ros2/test_ros2_node.cpp $<TARGET_OBJECTS:apso_ros_common>)
  add_library(apso_ros2_main OBJECT ${_examples}/ros2/src/main.cpp)
  foreach(_target IN ITEMS apso_test_ros2 apso_ros2_main)
    target_include_directories(${_target} PRIVATE ${_examples}/ros_common ${_here}/ros2/stand_in)
    target_link_libraries(${_target} PRIVATE apso_opencv apso_flags)
  endforeach()
  target_link_libraries(apso_test_ros2 PRIVATE apso_test_main)
  add_test(NAME integrate_ros2 COMMAND apso_test_ros2)

  # ROS 1: a real build where Debian's packages of it are installed (libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev
  # libdiagnostic-msgs-dev). It is not run: that needs a master.
  find_package(PkgConfig QUIET)
  if(PkgConfig_FOUND)
    pkg_check_modules(ROS1 QUIET IMPORTED_TARGET roscpp sensor_msgs geometry_msgs diagnostic_msgs)
  endif()
  if(ROS1_FOUND)
    add_executable(apso_ros1_node ${_examples}/ros1/src/node.cpp $<TARGET_OBJECTS:apso_ros_common>)
    target_include_directories(apso_ros1_node PRIVATE ${_examples}/ros_common)
    target_link_libraries(apso_ros1_node PRIVATE apso_opencv PkgConfig::ROS1)
  else()
    message(STATUS "the node for ROS 1 is not built: roscpp and its messages were not found")
  endif()
endif()

# A bag of ROS 1 or ROS 2 becomes a folder in TUM format. rosbag and PIL from the packages are modules of the system's Python; without them
# the tests are reported as skipped.
if(NOT APSO_INNER AND TARGET apso_track)
  find_program(APSO_SYSTEM_PYTHON NAMES python3 PATHS /usr/bin NO_DEFAULT_PATH)
  find_program(APSO_SYSTEM_PYTHON NAMES python3)
  mark_as_advanced(APSO_SYSTEM_PYTHON)
  if(APSO_SYSTEM_PYTHON)
    add_test(NAME integrate_bag_to_tum
             COMMAND ${APSO_SYSTEM_PYTHON} ${CMAKE_CURRENT_LIST_DIR}/bag_to_tum.py ${PROJECT_SOURCE_DIR}/scripts/bag_to_tum.py
                     $<TARGET_FILE_DIR:apso_track> ${CMAKE_CURRENT_BINARY_DIR}/bag_to_tum)
    set_tests_properties(integrate_bag_to_tum PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600)
    add_test(NAME integrate_ros2_bag_to_tum
             COMMAND ${APSO_SYSTEM_PYTHON} ${CMAKE_CURRENT_LIST_DIR}/ros2_bag_to_tum.py ${PROJECT_SOURCE_DIR}/scripts/bag_to_tum.py
                     $<TARGET_FILE_DIR:apso_track> ${CMAKE_CURRENT_BINARY_DIR}/ros2_bag_to_tum)
    set_tests_properties(integrate_ros2_bag_to_tum PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 600)
  endif()
endif()
