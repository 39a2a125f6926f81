# The tests run the program itself.
if(TARGET apso_eval AND TARGET apso_test_e2e_eval)
  find_package(nlohmann_json REQUIRED)
  target_link_libraries(apso_test_e2e_eval PRIVATE nlohmann_json::nlohmann_json)
  target_compile_definitions(apso_test_e2e_eval PRIVATE APSO_EVAL_PROGRAM="$<TARGET_FILE:apso_eval>")
  add_dependencies(apso_test_e2e_eval apso_eval)
  # As in evaluation/: skipped where the recordings are absent. APSO_DATA_DIR holds trajectories/; APSO_EVO_DATA is test/data of
  # a clone of github.com/MichaelGrupp/evo.
  foreach(_data TUM KITTI EuRoC)
    add_test(NAME e2e_eval_published_${_data} COMMAND apso_test_e2e_eval "--test-case=published: apso_eval on ${_data}*")
    set_tests_properties(e2e_eval_published_${_data} PROPERTIES SKIP_REGULAR_EXPRESSION "assertions: +0 [|]")
  endforeach()
endif()
