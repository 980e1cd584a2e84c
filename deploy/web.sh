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
run_with_server "$build" node clients/web/dist/server/main.js "$@"
