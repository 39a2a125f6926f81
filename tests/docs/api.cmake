# The API reference from a folder in which nothing was built, as in a fresh clone.
# usage: cmake -DSOURCE=... -DDOXYGEN=... -DSCRATCH=... -P api.cmake
cmake_minimum_required(VERSION 3.18)
file(REMOVE_RECURSE ${SCRATCH})
file(COPY ${SOURCE}/include DESTINATION ${SCRATCH})
file(COPY ${SOURCE}/docs/Doxyfile DESTINATION ${SCRATCH}/docs)
execute_process(COMMAND ${DOXYGEN} docs/Doxyfile WORKING_DIRECTORY ${SCRATCH} RESULT_VARIABLE failed ERROR_VARIABLE words)
if(failed)
  message(FATAL_ERROR "doxygen docs/Doxyfile:\n${words}")
endif()
file(GLOB pages ${SCRATCH}/build-api/html/index.html)
if(NOT pages)
  message(FATAL_ERROR "doxygen wrote no index.html")
endif()
