# The tests run the program itself.
if(TARGET apso_eval AND TARGET apso_test_e2e_eval)
  find_package(nlohmann_json REQUIRED)
  target_link_libraries(apso_test_e2e_eval PRIVATE nlohmann_json::nlohmann_json)
  target_compile_definitions(apso_test_e2e_eval PRIVATE APSO_EVAL_PROGRAM="$<TARGET_FILE:apso_eval>")
  add_dependencies(apso_test_e2e_eval apso_eval)
endif()
