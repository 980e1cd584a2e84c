#!/usr/bin/env bash
# Builds the image for trying out and uses it: the page, the sample's names, a click, a restart with
# the same volume, SIGTERM.
#   test.sh STORE      (see ../build.sh)
# Run it as root. It uses the ports 8080 and 50051 of loopback.
set -euo pipefail
cd "$(dirname "$0")/../../.."
[[ $# == 1 ]] || { sed -n '4p' "$0" | cut -c3- >&2; exit 2; }
deploy/image/tryout/build.sh "$1"
store=$(realpath "$1")
. deploy/image/engine.sh

work=$(mktemp -d "$store/tryout.XXXXXX")
mkdir "$work/data"
chown 10001:10001 "$work/data"
stop() {
  local status=$?
  trap - EXIT
  podman rm --force --time 0 pepeseg-tryout >/dev/null 2>&1 || true
  rm -rf "$work"
  exit "$status"
}
trap stop EXIT
fail() {
  echo "FAILED: $*" >&2
  podman logs --tail 40 pepeseg-tryout >&2 || true
  exit 1
}
start() {
  local begin=$SECONDS
  # The host's network and limits: on some machines an engine can make neither networks nor larger limits.
  podman run --detach --name pepeseg-tryout --network host --read-only --tmpfs /tmp:mode=1777 \
    --cap-drop all --security-opt no-new-privileges --ulimit nofile=1024:1024 \
    --ulimit nproc=1024:1024 --volume "$work/data:/var/lib/pepeseg" \
    localhost/pepeseg-tryout >/dev/null
  until podman healthcheck run pepeseg-tryout >/dev/null 2>&1 && inside pepeseg health >/dev/null 2>&1
  do
    ((SECONDS - begin < 60)) || fail 'it is not healthy'
    sleep 0.2
  done
}
inside() { podman exec pepeseg-tryout "$@"; }
end() {
  podman stop --time 30 pepeseg-tryout >/dev/null
  [[ $(podman inspect --format '{{.State.ExitCode}}' pepeseg-tryout) == 0 ]] || fail 'it did not stop cleanly'
  podman rm pepeseg-tryout >/dev/null
}

start
curl --silent --fail http://localhost:8080 | grep -q '<title>' || fail 'no page'
inside pepeseg labels demo | grep -q kleenex_tissue_box || fail 'the sample has no names'
inside pepeseg segment demo --view frame-000000.jpg --point 421,323 || fail 'a click'
inside pepeseg label demo mine --view frame-000000.jpg --point 421,323 >/dev/null
end
start
inside pepeseg labels demo | grep -q mine || fail 'a restart lost a name'
end
echo 'the image for trying out: passed'
