#!/usr/bin/env bash
# Runs the web app against PEPESEG_SERVER, or against a server that it starts, whose data stays in
# BUILD_FOLDER/web-data.
#   web.sh BUILD_FOLDER [OPTIONS OF THE BACK END...]
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:?usage: web.sh BUILD_FOLDER}
shift
server= web=

stop() {
  local status=$?
  trap - EXIT
  [[ -z $web ]] || kill -TERM "$web" 2>/dev/null || true
  if [[ -n $server ]] && kill -TERM "$server" 2>/dev/null; then
    wait "$server" || echo "the server did not stop cleanly: see $build/web-server.log" >&2
  fi
  exit "$status"
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

if [[ -z ${PEPESEG_SERVER-} ]]; then
  mkdir -p "$build/web-data"
  port_file=$(mktemp "$build/web-port.XXXXXX")
  "$build/bin/pepesegd" --listen 127.0.0.1:0 --data "$build/web-data" --port-file "$port_file" \
    >"$build/web-server.log" 2>&1 &
  server=$!
  for _ in {1..300}; do
    [[ -s $port_file ]] && break
    kill -0 "$server" 2>/dev/null || { cat "$build/web-server.log" >&2; exit 1; }
    sleep 0.1
  done
  export PEPESEG_SERVER="127.0.0.1:$(cat "$port_file")"
  rm -f "$port_file"
  echo "pepesegd listens on $PEPESEG_SERVER; its data is in $build/web-data"
fi
node clients/web/dist/server/main.js "$@" &
web=$!  # in the background, then waited for: bash handles signals only after a foreground program ends
wait "$web"
