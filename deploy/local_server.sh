# To be sourced. join_or_start BUILD_FOLDER sets PEPESEG_SERVER to the server to use: the one that it
# names already, else the one that answers on this machine's default port, else one that is started
# there with the default data folder. stop_server ends a server that was started.
# shellcheck shell=bash
server='' server_log=''

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

stop_server() {
  if [[ -n $server ]] && kill -TERM "$server" 2>/dev/null; then
    wait "$server" || echo "the server did not stop cleanly: see $server_log" >&2
  fi
}
