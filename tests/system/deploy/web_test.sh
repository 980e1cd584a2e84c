#!/usr/bin/env bash
# Tests that deploy/web.sh joins a server that answers, and else starts one on the default port with
# the default data folder, which it stops at its end. Scripts replace the programs.
#   web_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; cat "$work/output" "$work/calls" >&2; exit 1; }
program() { printf '#!/bin/bash\n%s\n' "$2" >"$work/$1"; chmod 755 "$work/$1"; }
mkdir -p "$work/bin" "$work/path"
program path/node 'echo "node $PEPESEG_SERVER ${*:2}" >>"$WORK/calls"'
# It answers while $WORK/serving exists.
program bin/pepeseg '[[ $1 == health && -e $WORK/serving ]]'
program bin/pepesegd 'echo "pepesegd $*" >>"$WORK/calls"
trap "rm -f $WORK/serving; echo stopped >>$WORK/calls; kill \$!; exit 0" TERM
echo "serving, data in a folder"
[[ ! -e $WORK/in-use ]] || { echo "port 50051 is in use"; exit 1; }
touch "$WORK/serving"
sleep 60 & wait'
export WORK=$work
unset PEPESEG_SERVER
web() { PATH=$work/path:$PATH "$root/deploy/web.sh" "$work" "$@" >"$work/output" 2>&1; }
expect() {  # expect CALLS: checks the calls since the last check
  [[ $(cat "$work/calls") == "$1" ]] || fail "the calls are not: $1"
  : >"$work/calls"
}

web --listen 127.0.0.1:9090
expect 'pepesegd --listen 127.0.0.1:50051
node 127.0.0.1:50051 --listen 127.0.0.1:9090
stopped'
touch "$work/serving"
web
expect 'node 127.0.0.1:50051 '
[[ -e $work/serving ]] || fail 'a server that ran before is stopped'
PEPESEG_SERVER=elsewhere:1 web
expect 'node elsewhere:1 '
rm "$work/serving"
touch "$work/in-use"
code=0
web || code=$?
((code == 1)) || fail "exit code $code, not 1, without a server"
grep -q 'port 50051 is in use' "$work/output" || fail "the server's log is not shown"
expect 'pepesegd --listen 127.0.0.1:50051'
echo 'every step as expected'
