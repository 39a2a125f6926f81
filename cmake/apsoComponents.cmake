# Targets of apso that need one more library, made on demand: the library is looked for only when its component is asked
# for, so neither building nor installing apso needs it. Used by the package file and, inside other projects, by
# apso_add_component(opencv).
#
#   opencv   apso::opencv   headers of apso/opencv/
#   sophus   apso::sophus   headers of apso/sophus/
#   io       apso::io       headers of apso/io/ (yaml-cpp)
set(APSO_COMPONENTS_KNOWN core opencv sophus io)

macro(apso_add_component _apso_name)
  if("${_apso_name}" STREQUAL "core" OR TARGET apso::${_apso_name})
    # nothing to do
  elseif("${_apso_name}" STREQUAL "opencv")
    find_package(OpenCV COMPONENTS core imgproc imgcodecs features2d video calib3d objdetect QUIET)
    if(OpenCV_FOUND)
      add_library(apso::opencv INTERFACE IMPORTED)
      target_link_libraries(apso::opencv INTERFACE apso::apso opencv_core opencv_imgproc opencv_imgcodecs opencv_features2d
                                                   opencv_video opencv_calib3d opencv_objdetect)
    endif()
  elseif("${_apso_name}" STREQUAL "sophus")
    find_package(Sophus QUIET)
    if(TARGET Sophus::Sophus)
      add_library(apso::sophus INTERFACE IMPORTED)
      target_link_libraries(apso::sophus INTERFACE apso::apso Sophus::Sophus)
    endif()
  elseif("${_apso_name}" STREQUAL "io")
    find_package(yaml-cpp QUIET)
    if(yaml-cpp_FOUND)
      add_library(apso::io INTERFACE IMPORTED)
      target_link_libraries(apso::io INTERFACE apso::apso)
      if(TARGET yaml-cpp::yaml-cpp)
        target_link_libraries(apso::io INTERFACE yaml-cpp::yaml-cpp)
      else()
        target_link_libraries(apso::io INTERFACE yaml-cpp)
      endif()
    endif()
  endif()
endmacro()
