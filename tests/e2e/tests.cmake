if(TARGET apso_track)
  find_package(nlohmann_json REQUIRED)
  add_dependencies(apso_test_e2e apso_track apso_eval apso_synth apso_motion residual_weights)
  find_package(OpenCV REQUIRED COMPONENTS videoio)
  target_link_libraries(apso_test_e2e PRIVATE nlohmann_json::nlohmann_json opencv_videoio)
  target_compile_definitions(apso_test_e2e PRIVATE APSO_TRACK="$<TARGET_FILE:apso_track>" APSO_EVAL="$<TARGET_FILE:apso_eval>"
                                                     APSO_SYNTH="$<TARGET_FILE:apso_synth>"
                                                     APSO_MOTION="$<TARGET_FILE:apso_motion>"
                                                     APSO_WEIGHTS="$<TARGET_FILE:residual_weights>")
  set(_limit 900)
  if(APSO_SANITIZE)  # under which programs are about ten times as slow
    set(_limit 3600)
  endif()
  set_tests_properties(e2e PROPERTIES TIMEOUT ${_limit})
  add_test(NAME e2e_live COMMAND ${CMAKE_CURRENT_LIST_DIR}/live.sh $<TARGET_FILE:apso_track>)
  set_tests_properties(e2e_live PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 120)
endif()
