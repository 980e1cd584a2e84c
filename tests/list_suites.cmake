# Writes the CTest cases of a test program, one for each of its suites, into CASES:
#   cmake -DNAME=core_scene_test -DPROGRAM=... -DALONE=filter -DCASES=file -P list_suites.cmake
# The tests that ALONE names (as --gtest_filter does, may be empty) are one case, which runs while no
# other does.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests --gtest_filter=-${ALONE}
                OUTPUT_VARIABLE listed TIMEOUT 60 COMMAND_ERROR_IS_FATAL ANY)
# Suites start a line and end with a dot; tests are indented.
string(REGEX MATCHALL "\n[A-Za-z0-9_/]+[.]" suites "\n${listed}")
set(cases)
# A case all of whose tests are skipped counts as skipped.
set(properties "TIMEOUT 900 SKIP_REGULAR_EXPRESSION \"PASSED  . 0 tests\"")
foreach(suite ${suites})
  string(STRIP "${suite}" suite)
  string(REGEX REPLACE "[.]$" "" title "${suite}")
  string(APPEND cases "add_test([=[${NAME}.${title}]=] [=[${PROGRAM}]=]"
                      " [=[--gtest_filter=${suite}*-${ALONE}]=])\n"
                      "set_tests_properties([=[${NAME}.${title}]=] PROPERTIES ${properties})\n")
endforeach()
if(ALONE)
  string(APPEND cases "add_test([=[${NAME}.ALONE]=] [=[${PROGRAM}]=]"
                      " [=[--gtest_filter=${ALONE}]=])\n"
                      "set_tests_properties([=[${NAME}.ALONE]=] PROPERTIES RUN_SERIAL ON ${properties})\n")
endif()
file(WRITE ${CASES} "${cases}")
