# Sourced by deb_in_chroot.sh and deb_under_systemd.sh, which run inside the Debian of deb_test.sh.
# shellcheck shell=bash
set -euo pipefail
step() { printf '%(%T)T    %s\n' -1 "$*"; }
fail() {
  echo "FAILED: $*" >&2
  cat /tmp/output /tmp/server.log /tmp/web.log >&2 2>/dev/null || true
  exit 1
}
expect() {  # expect EXIT_CODE COMMAND...
  local code=0
  "${@:2}" >/tmp/output 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}
wait_for() {  # wait_for COMMAND...: until it succeeds, at most 30 s
  for _ in {1..300}; do
    ! "$@" >/dev/null 2>&1 || return 0
    sleep 0.1
  done
  fail "in vain: $*"
}
# The client runs as a user who has no rights.
pepeseg() { runuser -u games -- env HOME=/tmp /usr/bin/pepeseg "$@"; }
click() {
  expect 0 pepeseg segment shelf --view frame-000000.jpg --point 320,280 --out "$1"
  [[ $(head -c 4 "$1/frame-000000_mask.png" | tail -c 3) == PNG ]] || fail 'a click leaves no mask'
}
# A page of the web app, and a call through it.
ask_web() {
  wait_for node -e 'fetch("http://127.0.0.1:8080/").then((r) => process.exit(r.ok ? 0 : 1), () => process.exit(1))'
  expect 0 node -e '
    fetch("http://127.0.0.1:8080/api/rpc/pepeseg.v1.SceneService/ListScenes", {
      method: "POST", headers: {"content-type": "application/json"}, body: "{}",
    }).then(async (r) => console.log(r.status, await r.text()));'
  grep -q '^200 .*"scenes/shelf"' /tmp/output || fail 'the web app does not list the scene'
}
