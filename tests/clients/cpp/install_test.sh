#!/usr/bin/env bash
# Installs the client library, builds the example against it, and runs it: it must report that no
# server answers.
#   install_test.sh BUILD EXAMPLE WORK
set -euo pipefail
build=$1 example=$2 work=$3
rm -rf "$work"
cmake --install "$build" --component dev --prefix "$work/prefix" >"$work.log"
[[ -f $work/prefix/include/pepeseg-client/clients/cpp/client.h ]]
# The build type differs from that of the library, and warnings are not errors.
cmake -S "$example" -B "$work/build" -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Debug \
  >>"$work.log" || { cat "$work.log"; exit 1; }
cmake --build "$work/build" >>"$work.log" || { cat "$work.log"; exit 1; }
code=0
answer=$("$work/build/click" 127.0.0.1:1 shelf view.jpg 1 2 2>&1) || code=$?
echo "$answer"
((code == 1)) && [[ $answer == UNAVAILABLE* ]]
