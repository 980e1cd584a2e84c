# To be sourced by a script that runs the real programs, with their folder in $programs. Starts
# pepesegd, with the flags of the array $server_flags if there is one, and stops it when the script
# ends. Sets $work, a folder that is removed then, and
# PEPESEG_SERVER, and defines fail, pepeseg, pepeseg-benchmark and expect.
# shellcheck shell=bash
: "${programs:?the folder of the programs}"
work=$(mktemp -d)
server=
stop() {
  [[ -z $server ]] || kill -TERM "$server" 2>/dev/null || true
  [[ -z $server ]] || wait "$server" || true
  rm -rf "$work"
}
trap stop EXIT
touch "$work/output" "$work/errors"
fail() { echo "FAILED: $*" >&2; cat "$work/output" "$work/errors" "$work/server.log" >&2; exit 1; }

"$programs/pepesegd" --listen 127.0.0.1:0 --sam off --data "$work/data" --port-file "$work/port" \
  ${server_flags[@]+"${server_flags[@]}"} >"$work/server.log" 2>&1 &
server=$!
for _ in {1..200}; do [[ -s $work/port ]] && break; sleep 0.1; done
[[ -s $work/port ]] || fail 'the server does not start'
PEPESEG_SERVER=127.0.0.1:$(cat "$work/port")
export PEPESEG_SERVER
pepeseg() { "$programs/pepeseg" "$@"; }
pepeseg-benchmark() { "$programs/pepeseg-benchmark" "$@"; }
expect() {  # expect EXIT_CODE COMMAND...: runs a command and checks its exit code
  local code=0
  "${@:2}" >"$work/output" 2>"$work/errors" || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}
