# The numbers that others have published need recordings that are not part of the repository. Where they are absent, this
# test is reported as skipped and not as passed; set APSO_DATA_DIR to the folder that holds trajectories/.
if(TARGET apso_test_evaluation)
  add_test(NAME evaluation_published_numbers COMMAND apso_test_evaluation --test-case=published:*)
  set_tests_properties(evaluation_published_numbers PROPERTIES SKIP_REGULAR_EXPRESSION "assertions: +0 [|]")
endif()
