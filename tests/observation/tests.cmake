# The program of the tutorial that finds motion checks itself.
if(TARGET find_motion)
  add_test(NAME find_motion COMMAND find_motion)
endif()
