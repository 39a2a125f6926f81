if(TARGET apso_report)
  find_package(nlohmann_json REQUIRED)
  add_dependencies(apso_test_report apso_track apso_report)
  target_link_libraries(apso_test_report PRIVATE nlohmann_json::nlohmann_json)
  target_compile_definitions(apso_test_report PRIVATE APSO_TRACK="$<TARGET_FILE:apso_track>" APSO_REPORT="$<TARGET_FILE:apso_report>")
  set_tests_properties(report PROPERTIES TIMEOUT 300)

  # The page in a browser, which ./install_dependencies.sh --with-browser installs; without it the test is reported as
  # skipped. Selenium from the package is a module of the system's Python, which need not be the first one on the path.
  find_program(APSO_SYSTEM_PYTHON NAMES python3 PATHS /usr/bin NO_DEFAULT_PATH)
  find_program(APSO_SYSTEM_PYTHON NAMES python3)
  mark_as_advanced(APSO_SYSTEM_PYTHON)
  if(APSO_SYSTEM_PYTHON)
    add_test(NAME report_in_browser
             COMMAND ${APSO_SYSTEM_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/report/check_in_browser.py $<TARGET_FILE:apso_track> $<TARGET_FILE:apso_report>)
    set_tests_properties(report_in_browser PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 300)
  endif()
endif()
