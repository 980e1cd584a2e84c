#!/usr/bin/env bash
# Tests how many shared libraries the service's programs load at their start, and that all libraries
# of its modules are there.
#   libraries_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
programs=$1
readonly most=60
fail() { echo "FAILED: $*" >&2; exit 1; }

for program in pepesegd pepeseg-worker pepeseg; do
  libraries=$(ldd "$programs/$program" | wc -l)
  ((libraries > 5 && libraries <= most)) || fail "$program loads $libraries libraries, allowed are $most"
  echo "$program: $libraries"
done
for module in video postgresql; do
  missing=$(ldd "$programs/../lib/pepeseg/$module.so" | grep 'not found' || true)
  [[ -z $missing ]] || fail "the module $module lacks $missing"
  echo "module $module: $(ldd "$programs/../lib/pepeseg/$module.so" | wc -l)"
done
