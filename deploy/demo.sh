#!/usr/bin/env bash
# Runs `pepeseg-benchmark demo` on the server of PEPESEG_SERVER, else on the one on 127.0.0.1:50051, which it
# starts for that time if none answers there. The scene stays in the server's data.
#   demo.sh BUILD_FOLDER [OPTIONS OF pepeseg-benchmark demo...]
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:?usage: demo.sh BUILD_FOLDER}
shift
# shellcheck source=deploy/local_server.sh
source deploy/local_server.sh
run_with_server "$build" "$build/bin/pepeseg-benchmark" demo --data tests/data/apc_shelf --out "$build/demo" "$@"
