#!/usr/bin/env bash
# Runs `pepeseg demo` on a server that it starts for it.
#   demo.sh BUILD_FOLDER [OPTIONS OF pepeseg demo...]
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:?usage: demo.sh BUILD_FOLDER}
shift
out=$build/demo
exec deploy/with_server.sh "$build" "$out" \
  "$build/bin/pepeseg" demo --data tests/data/apc_shelf --out "$out" "$@"
