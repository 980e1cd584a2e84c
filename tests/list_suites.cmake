# Writes the CTest cases of a test program, one for each of its suites, into CASES:
#   cmake -DNAME=core_scene_test -DPROGRAM=... -DCASES=file -P list_suites.cmake
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed TIMEOUT 60
                COMMAND_ERROR_IS_FATAL ANY)
# Suites start a line and end with a dot; tests are indented.
string(REGEX MATCHALL "\n[A-Za-z0-9_/]+[.]" suites "\n${listed}")
set(cases)
foreach(suite ${suites})
  string(STRIP "${suite}" suite)
  string(REGEX REPLACE "[.]$" "" case "${NAME}.${suite}")
  # A case all of whose tests are skipped counts as skipped. The expression goes on to the end of the
  # output, where tests that failed would be listed: CTest does not look at the exit status of a case
  # that matches.
  string(APPEND cases
    "add_test([=[${case}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${suite}*]=])\n"
    "set_tests_properties([=[${case}]=] PROPERTIES TIMEOUT 900\n"
    "  SKIP_REGULAR_EXPRESSION\n"
    "  \"PASSED  . 0 tests[.]\\n(.  SKIPPED . [^\\n]*\\n)+$\")\n")
endforeach()
file(WRITE ${CASES} "${cases}")
