cmake_minimum_required(VERSION 3.18)
set(here ${CMAKE_CURRENT_LIST_DIR})
file(REMOVE_RECURSE ${SCRATCH})
file(MAKE_DIRECTORY ${SCRATCH})

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(failed)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\n${output}")
  endif()
endfunction()

if(WAY STREQUAL "installed")
  # Installed, moved elsewhere, found by find_package; a wrong version is refused.
  run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${SCRATCH}/first)
  file(RENAME ${SCRATCH}/first ${SCRATCH}/moved)
  set(options -G Ninja -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_PREFIX_PATH=${SCRATCH}/moved -DWAY=installed)
  run(${CMAKE_COMMAND} -S ${here}/consumer -B ${SCRATCH}/build ${options} -DVERSION=${VERSION})
  run(${CMAKE_COMMAND} --build ${SCRATCH}/build)
  run(${SCRATCH}/build/consumer)
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${here}/consumer -B ${SCRATCH}/refused ${options} -DVERSION=9.0
                  RESULT_VARIABLE failed OUTPUT_QUIET ERROR_QUIET)
  if(NOT failed)
    message(FATAL_ERROR "find_package(apso 9.0) was satisfied by ${VERSION}")
  endif()
elseif(WAY STREQUAL "subdirectory")
  # Inside another project: only the library itself is added, none of its programs, tests and flags.
  run(${CMAKE_COMMAND} -S ${here}/consumer -B ${SCRATCH}/build -G Ninja -DCMAKE_CXX_COMPILER=${COMPILER}
      -DWAY=subdirectory -DAPSO_SOURCE=${SOURCE})
  run(${CMAKE_COMMAND} --build ${SCRATCH}/build)
  run(${SCRATCH}/build/consumer)
elseif(WAY STREQUAL "copied")
  # No CMake at all: the folder, a compiler and Eigen. Two source files share the headers.
  file(COPY ${SOURCE}/include/apso DESTINATION ${SCRATCH}/third_party)
  run(${COMPILER} -std=c++17 -I${SCRATCH}/third_party -I${EIGEN} ${here}/consumer/main.cpp ${here}/consumer/second.cpp
      -o ${SCRATCH}/consumer)
  run(${SCRATCH}/consumer)
else()
  message(FATAL_ERROR "unknown way '${WAY}'")
endif()
message(STATUS "${WAY}: works")
