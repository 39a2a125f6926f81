# The minimal tracker beside apso_track, on a recording in files.
if(TARGET minimal_tracker AND TARGET apso_track AND TARGET apso_test_e2e_tracker)
  find_package(nlohmann_json REQUIRED)
  target_link_libraries(apso_test_e2e_tracker PRIVATE nlohmann_json::nlohmann_json)
  target_compile_definitions(apso_test_e2e_tracker PRIVATE APSO_MINIMAL_TRACKER="$<TARGET_FILE:minimal_tracker>"
                                                           APSO_TRACK="$<TARGET_FILE:apso_track>"
                                                           APSO_SYNTH="$<TARGET_FILE:apso_synth>"
                                                           APSO_RECTIFY="$<TARGET_FILE:apso_rectify>")
  add_dependencies(apso_test_e2e_tracker minimal_tracker apso_track apso_synth apso_rectify)
endif()
