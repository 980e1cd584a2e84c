#!/usr/bin/env bash
# Starts a server on a free loopback port, runs a command with PEPESEG_SERVER set to it, and stops
# the server. Its data is in OUT_FOLDER while it runs; its log stays there as server.log.
#   with_server.sh BUILD_FOLDER OUT_FOLDER COMMAND [ARGUMENTS...]
# PEPESEGD_FLAGS: further flags of the server, such as --devices=cuda.
set -euo pipefail
build=${1:?usage: with_server.sh BUILD_FOLDER OUT_FOLDER COMMAND...}
out=${2:?usage: with_server.sh BUILD_FOLDER OUT_FOLDER COMMAND...}
shift 2
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

read -ra flags <<<"${PEPESEGD_FLAGS:-}"
"$build/bin/pepesegd" --listen 127.0.0.1:0 --data "$data" --port-file "$data.port" \
  "${flags[@]}" >"$out/server.log" 2>&1 &
server=$!
for _ in {1..300}; do
  [[ -s $data.port ]] && break
  kill -0 "$server" 2>/dev/null || { cat "$out/server.log" >&2; exit 1; }
  sleep 0.1
done
PEPESEG_SERVER=127.0.0.1:$(cat "$data.port")
export PEPESEG_SERVER
rm -f "$data.port"
echo "pepesegd listens on $PEPESEG_SERVER; its log is $out/server.log" >&2
"$@" &
client=$!  # in the background, then waited for: bash handles signals only after a foreground program ends
wait "$client"
client=
