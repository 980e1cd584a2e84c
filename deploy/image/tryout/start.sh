#!/bin/bash
# Runs the server, which listens within the container only, and the web app on port 8080, until one of
# them ends or SIGTERM comes. Arguments are options of pepesegd.
set -euo pipefail
data=/var/lib/pepeseg
# An empty volume gets the sample.
[[ -n $(ls -A "$data") ]] || cp -r /usr/share/pepeseg/sample/. "$data"

pepesegd --listen=127.0.0.1:50051 --data="$data" "$@" &
server=$!
node /usr/share/pepeseg/web/server/main.js --listen=0.0.0.0:8080 --server=127.0.0.1:50051 \
  --behind-login &
web=$!
stopped=0 status=0
trap 'stopped=1' TERM INT
wait -n || status=$?
kill -TERM "$server" "$web" 2>/dev/null || true
wait "$server" "$web" || true
((stopped == 0)) || status=0
exit "$status"
