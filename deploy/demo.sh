#!/usr/bin/env bash
# Starts a server of its own on a free loopback port, runs `pepeseg demo`, stops the server.
#   demo.sh BUILD_FOLDER [OPTIONS OF pepeseg demo...]
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:?usage: demo.sh BUILD_FOLDER}
shift
out=$build/demo
mkdir -p "$out"
data=$(mktemp -d "$out/data.XXXXXX")
server= client=

stop() {
  local status=$?
  trap - EXIT
  [[ -z $client ]] || kill -TERM "$client" 2>/dev/null || true
  if [[ -n $server ]] && kill -TERM "$server" 2>/dev/null; then
    wait "$server" || echo "the server did not stop cleanly: see $out/server.log" >&2
  fi
  rm -rf "$data"
  exit "$status"
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

"$build/bin/pepesegd" --listen 127.0.0.1:0 --data "$data" --port-file "$data.port" \
  >"$out/server.log" 2>&1 &
server=$!
for _ in {1..100}; do
  [[ -s $data.port ]] && break
  kill -0 "$server" 2>/dev/null || { cat "$out/server.log" >&2; exit 1; }
  sleep 0.1
done
port=$(cat "$data.port")
rm -f "$data.port"
echo "pepesegd listens on 127.0.0.1:$port; its log is $out/server.log"
"$build/bin/pepeseg" --server "127.0.0.1:$port" demo \
  --data tests/data/apc_shelf --out "$out" "$@" &
client=$!  # waited for, not run in front: bash would hold a signal back until it ends
wait "$client"
client=
ls "$out"/*.png
