#!/usr/bin/env bash
# Runs the web app against the server of PEPESEG_SERVER, else against the one on 127.0.0.1:50051,
# which it starts if none answers there.
#   web.sh BUILD_FOLDER [OPTIONS OF THE BACK END...]
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:?usage: web.sh BUILD_FOLDER}
shift
# shellcheck source=deploy/local_server.sh
source deploy/local_server.sh
web=

stop() {
  local status=$?
  trap - EXIT
  [[ -z $web ]] || kill -TERM "$web" 2>/dev/null || true
  stop_server
  exit "$status"
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

join_or_start "$build"
node clients/web/dist/server/main.js "$@" &
web=$!  # in the background, then waited for: bash handles signals only after a foreground program ends
wait "$web"
