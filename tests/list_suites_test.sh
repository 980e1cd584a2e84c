#!/usr/bin/env bash
# A suite whose only test fails must count as failed, and one that skips all its tests as skipped.
#   list_suites_test.sh CMAKE CTEST
set -euo pipefail
cmake=$1 ctest=$2
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Prints what GoogleTest prints for each kind of suite.
cat > "$folder/program" <<'PROGRAM'
#!/bin/sh
case $1 in
  --gtest_list_tests) printf 'Fails.\n  Test\nSkips.\n  Test\nFailsAndSkips.\n  Test\nPasses.\n  Test\n' ;;
  *FailsAndSkips*)
    printf '[  PASSED  ] 0 tests.\n[  SKIPPED ] 1 test, listed below:\n[  SKIPPED ] FailsAndSkips.A\n'
    printf '[  FAILED  ] 1 test, listed below:\n[  FAILED  ] FailsAndSkips.B\n\n 1 FAILED TEST\n'
    exit 1 ;;
  *Fails*)
    printf '[  PASSED  ] 0 tests.\n[  FAILED  ] 1 test, listed below:\n[  FAILED  ] Fails.Test\n\n'
    printf ' 1 FAILED TEST\n'
    exit 1 ;;
  *Skips*)
    printf '[  PASSED  ] 0 tests.\n[  SKIPPED ] 1 test, listed below:\n[  SKIPPED ] Skips.Test\n' ;;
  *) printf '[  PASSED  ] 1 test.\n' ;;
esac
PROGRAM
chmod +x "$folder/program"
"$cmake" -DNAME=program -DPROGRAM="$folder/program" -DCASES="$folder/CTestTestfile.cmake" \
  -P "$here/list_suites.cmake"
output=$(cd "$folder" && "$ctest" 2>&1 || true)
for wanted in 'program[.]Fails .*Failed' 'program[.]FailsAndSkips .*Failed' \
  'program[.]Skips .*Skipped' 'program[.]Passes .*Passed'; do
  grep -q "$wanted" <<<"$output" || { echo "not found: $wanted"; echo "$output"; exit 1; }
done
