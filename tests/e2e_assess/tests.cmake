# The tests run the programs themselves.
if(TARGET apso_track AND TARGET apso_test_e2e_assess)
  find_package(nlohmann_json REQUIRED)
  target_link_libraries(apso_test_e2e_assess PRIVATE nlohmann_json::nlohmann_json)
  target_compile_definitions(apso_test_e2e_assess PRIVATE APSO_PROGRAMS="$<TARGET_FILE_DIR:apso_track>"
                                                            APSO_SOURCE="${PROJECT_SOURCE_DIR}")
  add_dependencies(apso_test_e2e_assess apso_track apso_assess apso_calibrate apso_ablate apso_motion apso_synth)
  set_tests_properties(e2e_assess PROPERTIES TIMEOUT 900)
endif()
