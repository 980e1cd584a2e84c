# To be sourced. run_with_server BUILD_FOLDER PROGRAM [ARGUMENTS...] sets PEPESEG_SERVER to the server
# to use: the one that it names already, else the one that answers on this machine's default port, else
# one that is started there with the default data folder. Then it runs the program. When the script
# ends, or gets a signal, the program ends, and so does a server that was started.
# shellcheck shell=bash
server='' server_log='' program=''

join_or_start() {
  local build=$1 address=127.0.0.1:50051
  if [[ -n ${PEPESEG_SERVER-} ]]; then
    echo "using the server at $PEPESEG_SERVER" >&2
    return
  fi
  export PEPESEG_SERVER=$address
  if "$build/bin/pepeseg" health >/dev/null 2>&1; then
    echo "using the server that runs at $address" >&2
    return
  fi
  server_log=$build/server.log
  "$build/bin/pepesegd" --listen "$address" >"$server_log" 2>&1 &
  server=$!
  for _ in {1..300}; do
    if "$build/bin/pepeseg" health >/dev/null 2>&1; then
      echo "pepesegd listens on $address; its log is $server_log" >&2
      grep -o 'data in .*' "$server_log" | sed 's/^/its /' >&2 || true
      return
    fi
    kill -0 "$server" 2>/dev/null || break
    sleep 0.1
  done
  cat "$server_log" >&2
  echo "no server could be started on $address: name one in PEPESEG_SERVER" >&2
  exit 1
}

stop() {
  local status=$?
  trap - EXIT
  [[ -z $program ]] || kill -TERM "$program" 2>/dev/null || true
  if [[ -n $server ]] && kill -TERM "$server" 2>/dev/null; then
    wait "$server" || echo "the server did not stop cleanly: see $server_log" >&2
  fi
  exit "$status"
}

run_with_server() {
  trap stop EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM
  join_or_start "$1"
  shift
  "$@" &
  program=$!  # in the background, then waited for: bash handles signals only after a foreground program ends
  wait "$program"
}
