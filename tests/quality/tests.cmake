# The programs of the tutorial that score a frame and adapt a threshold check themselves.
foreach(_program score_one_frame adapt_threshold)
  if(TARGET ${_program})
    add_test(NAME ${_program} COMMAND ${_program})
  endif()
endforeach()
