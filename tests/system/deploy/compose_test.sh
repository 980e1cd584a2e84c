#!/usr/bin/env bash
# Runs deploy/compose.yaml by Debian's docker-compose on Podman, without a registry: server, gateway,
# PostgreSQL and Prometheus. Images that registries have are made of Debian's packages (compose/), the server's
# of those of `make deb` unless STORE has it (`make image`). Grafana is left out: Debian has none.
#   compose_test.sh STORE FOLDER_OF_PACKAGES PROGRAMS
# Run it as root. It has a network of its own.
set -euo pipefail
cd "$(dirname "$0")/../../.."
mkdir -p "${1:?the store of images}"
store=$(realpath "$1") packages=$(realpath "$2") programs=$(realpath "$3")
. deploy/image/engine.sh
step() { printf '%(%T)T  %s\n' -1 "$*"; }

if [[ ${4:-} != inside ]]; then
  step 'images'
  if ! podman image exists localhost/debian-12; then
    mirror=${PEPESEG_DEBIAN_MIRROR:-http://deb.debian.org}
    check=$(apt-config dump Acquire::Check-Valid-Until)
    mmdebstrap --quiet --variant=minbase ${check:+--aptopt="$check"} bookworm "$store/base.tar" \
      "deb $mirror/debian bookworm main" "deb $mirror/debian bookworm-updates main" \
      "deb $mirror/debian-security bookworm-security main"
    podman import --quiet "$store/base.tar" localhost/debian-12 >/dev/null
    rm "$store/base.tar"
  fi
  build() {
    buildah bud --quiet --isolation chroot --network host --layers --format docker \
      --build-arg BASE=localhost/debian-12 "$@" >/dev/null
  }
  build -f deploy/image/gateway.Dockerfile -t localhost/pepeseg-gateway .
  files=tests/system/deploy/compose
  build -f $files/postgres.Dockerfile -t docker.io/library/postgres:15 $files
  build -f $files/prometheus.Dockerfile -t docker.io/prom/prometheus:v2.53.3 $files
  # `make image` labels its image with its packages.
  packaged=$(podman image inspect --format '{{index .Labels "pepeseg.packages.sha256"}}' localhost/pepeseg || true)
  if [[ -n $packaged ]]; then
    step "the server's image is that of make image"
  else
    build -f "$PWD/$files/server.Dockerfile" -t localhost/pepeseg "$packages"
  fi
  exec unshare --net "$0" "$@" inside
fi

ip link set lo up
work=$(mktemp -d "$store/compose.XXXXXX")
chmod 755 "$work"
touch "$work/output"
engine='' prober=''
stop() {
  local status=$?
  trap - EXIT
  [[ -z $prober ]] || kill "$prober" 2>/dev/null || true
  compose down --volumes --timeout 5 >/dev/null 2>&1 || true
  [[ -z $engine ]] || kill "$engine" 2>/dev/null || true
  rm -rf "$work"
  exit "$status"
}
fail() {
  echo "FAILED: $*" >&2
  cat "$work/output" >&2
  for name in server gateway postgres prometheus; do podman logs --tail 15 pepeseg_${name}_1 >&2 || true; done
  exit 1
}
expect() {  # expect EXIT_CODE COMMAND...
  local code=0
  "${@:2}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}

# Uses the engine's limits where larger ones cannot be set.
export CONTAINERS_CONF=$work/containers.conf
cat >"$CONTAINERS_CONF" <<'CONF'
[containers]
default_ulimits = ["nofile=4096:4096", "nproc=4096:4096"]
[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
events_logger = "file"
CONF
cp -r deploy "$work/deploy"
rm -rf "$work/deploy/secrets"
cat >"$work/limits.yaml" <<'YAML'
services:
  gateway: {ulimits: {nofile: 4096, nproc: 4096}, environment: {PEPESEG_GATEWAY_CONNECTIONS: "400"}}
YAML
# docker-compose 1 takes the project's name by a flag only.
sed -i '/^name: pepeseg$/d' "$work/deploy/compose.yaml"
export DOCKER_HOST=unix://$work/engine PEPESEG_PORT=8443
compose() {
  docker-compose -f "$work/deploy/compose.yaml" -f "$work/limits.yaml" -p pepeseg --profile cpu "$@"
}
command podman "${places[@]}" --log-level fatal system service --time=0 "$DOCKER_HOST" >/dev/null 2>&1 &
engine=$!
trap stop EXIT
trap 'exit 143' TERM
trap 'exit 130' INT
# Without systemd Podman does not run health checks by itself.
while sleep 1; do
  for container in $(podman ps --quiet); do podman healthcheck run "$container" >/dev/null 2>&1 || true; done
done &
prober=$!

step 'both profiles are as docker-compose wants them'
expect 0 compose config --quiet
expect 0 docker-compose -f "$work/deploy/compose.yaml" -p pepeseg --profile gpu config --quiet

step 'secrets, then up'
"$work/deploy/compose_secrets.sh" localhost >"$work/output"
"$work/deploy/token.sh" "$work/deploy/secrets/jwt.key" --project lab >"$work/token"
for _ in {1..50}; do [[ ! -S $work/engine ]] || break; sleep 0.1; done
expect 0 compose up --no-build --detach server gateway postgres prometheus
healthy() { [[ $(podman ps --format '{{.Status}}' | grep -c '(healthy)') == "$1" ]]; }
for _ in {1..60}; do ! healthy 4 || break; sleep 1; done
podman ps --all --format '  {{.Names}} {{.Status}} {{.Ports}}'
healthy 4 || fail 'not all become healthy'
open=$(podman ps --format '{{.Names}} {{.Ports}}' | grep -e '->' | cut -d' ' -f1)
[[ $open == pepeseg_gateway_1 ]] || fail "from outside these can be reached: $open"

step 'a scene through the gateway'
pepeseg() { "$programs/pepeseg" --server https://localhost:8443 --ca "$work/deploy/secrets/ca.pem" "$@"; }
with_token() { pepeseg --key-file "$work/token" "$@"; }
# The gateway asks for the servers' addresses every few seconds.
served() { for _ in {1..60}; do ! with_token scenes >/dev/null 2>&1 || return 0; sleep 0.5; done; }
served
expect 10 pepeseg scenes
expect 0 with_token upload shelf tests/data/apc_shelf
expect 0 with_token train shelf --steps 60 --feature-steps 30 --image-scale 0.25 -o features.num_pixels=200
expect 0 with_token segment shelf --view frame-000000.jpg --point 320,280 --out "$work/first"

step 'an admin call; Prometheus reads server and gateway'
expect 0 podman exec pepeseg_server_1 pepesegd keys create --data /var/lib/pepeseg \
  --database 'postgresql:host=postgres dbname=pepeseg user=pepeseg' --project ops --scopes operate
key=$(grep -o 'pk_[^ ]*' "$work/output") || fail 'no key'
expect 0 podman exec --env "PEPESEG_KEY=$key" pepeseg_server_1 pepeseg --json resident --admin unix:/run/pepeseg/admin/socket
for _ in {1..40}; do
  expect 0 podman exec pepeseg_prometheus_1 wget -qO- 'http://127.0.0.1:9090/api/v1/targets?state=active'
  up=$(grep -o '"health":"up"' "$work/output" | wc -l || true)
  ((up < 2)) || break
  sleep 1
done
((up == 2)) || fail "Prometheus reads $up of 2"

step 'the server is restarted, then all are'
expect 0 compose restart server
served
expect 0 with_token segment shelf --view frame-000000.jpg --point 320,280 --out "$work/second"
expect 0 compose down --timeout 60
expect 0 compose up --no-build --detach server gateway postgres prometheus
served
expect 0 with_token segment shelf --view frame-000000.jpg --point 320,280 --out "$work/third"
for again in second third; do
  cmp "$work/first/frame-000000_mask.png" "$work/$again/frame-000000_mask.png" || fail "another answer: $again"
done
step 'stop'
expect 0 compose stop --timeout 60
code=$(podman inspect --format '{{.State.ExitCode}}' pepeseg_server_1)
[[ $code == 0 ]] || fail "the server leaves with $code"
step 'done'
