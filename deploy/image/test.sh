#!/usr/bin/env bash
# Builds the images and uses them as a user would: server and gateway with a read-only root, as
# nobody, without capabilities; a scene is uploaded, trained, segmented and exported through the
# gateway with TLS and a token; a worker is killed; both stop within their grace periods.
#   test.sh STORE      (see build.sh)
# Run it as root. It uses loopback ports of its own; `make image-test` limits its time.
set -euo pipefail
cd "$(dirname "$0")/../.."
[[ $# == 1 ]] || { sed -n '5,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mkdir -p "$1"
store=$(realpath "$1")
. deploy/image/engine.sh

step() { printf '%(%T)T  %s\n' -1 "$*"; }
fail() {
  echo "FAILED: $*" >&2
  podman logs --tail 40 pepesegd >&2 || true
  podman logs --tail 20 pepeseg-gateway >&2 || true
  cat "$work/output" >&2
  exit 1
}
work=$(mktemp -d "$store/test.XXXXXX")
chmod 755 "$work"
touch "$work/output"
stop() {
  local status=$?
  trap - EXIT
  podman rm --force --time 0 pepesegd pepeseg-gateway >/dev/null 2>&1 || true
  rm -rf "$work"
  exit "$status"
}
trap stop EXIT
trap 'exit 143' TERM
trap 'exit 130' INT

step 'images'
deploy/image/build.sh "$store"
buildah bud --quiet --isolation chroot --network host --layers --format docker \
  --build-arg BASE=localhost/pepeseg-base -f deploy/image/gateway.Dockerfile \
  -t localhost/pepeseg-gateway . >/dev/null

step 'certificates, a token, folders of user 10001'
tls=$work/tls
deploy/certificates.sh "$tls" --owner 10001:10001
deploy/token.sh "$tls/jwt.key" --project shelves --subject tester >"$work/token"
deploy/token.sh "$tls/jwt.key" --project shelves --subject tester --seconds -60 >"$work/old-token"
deploy/token.sh "$tls/jwt.key" --project others --subject other >"$work/other-token"
mkdir "$work/data" "$work/out"
chown 10001:10001 "$work/data" "$work/out" "$work"/*token
read -r server_port gateway_port metrics_port < <(python3 -c '
import socket
sockets = [socket.socket() for _ in range(3)]
for s in sockets: s.bind(("127.0.0.1", 0))
print(*[s.getsockname()[1] for s in sockets])')

# As the service is meant to run, except for the host's network and the limits: on some machines an
# engine can make neither networks nor larger limits.
hardened=(--network host --read-only --tmpfs /tmp:mode=1777 --cap-drop all
  --security-opt no-new-privileges --ulimit nofile=1024:1024 --ulimit nproc=1024:1024)
step 'server and gateway start'
podman run --detach --name pepesegd "${hardened[@]}" --volume "$work/data:/var/lib/pepeseg" \
  --volume "$tls:/etc/pepeseg/tls:ro" --env "PEPESEG_SERVER=https://localhost:$server_port" \
  --env PEPESEG_CERTIFICATE=/etc/pepeseg/tls/server.pem \
  --env PEPESEG_CERTIFICATE_KEY=/etc/pepeseg/tls/server.key \
  localhost/pepeseg "--listen=127.0.0.1:$server_port" --require-keys \
  --tls-certificate=/etc/pepeseg/tls/server.pem --tls-key=/etc/pepeseg/tls/server.key \
  --tls-client-ca=/etc/pepeseg/tls/ca.pem --trusted-gateway=pepeseg-gateway \
  --checkpoint-seconds=1 --drain-seconds=1 --grace=20 >/dev/null
podman run --detach --name pepeseg-gateway "${hardened[@]}" --volume "$tls:/etc/pepeseg/tls:ro" \
  --env PEPESEG_GATEWAY_CERTIFICATE=/etc/pepeseg/tls/gateway.pem \
  --env PEPESEG_GATEWAY_CLIENT_CERTIFICATE=/etc/pepeseg/tls/gateway-client.pem \
  --env PEPESEG_SERVERS_CA=/etc/pepeseg/tls/ca.pem \
  --env "PEPESEG_SERVER_1=127.0.0.1:$server_port" --env PEPESEG_GATEWAY_CONNECTIONS=400 \
  --env "PEPESEG_GATEWAY_LISTEN=127.0.0.1:$gateway_port" \
  --env "PEPESEG_GATEWAY_METRICS=127.0.0.1:$metrics_port" \
  --env PEPESEG_JWT_KEY=/etc/pepeseg/tls/jwt.pub --env PEPESEG_JWT_ISSUER=pepeseg \
  --env PEPESEG_JWT_AUDIENCE=pepeseg localhost/pepeseg-gateway >/dev/null

# Runs the client of the image.
token=/token
pepeseg() {
  podman run --rm "${hardened[@]}" --volume "$tls:/etc/pepeseg/tls:ro" \
    --volume "$PWD/tests/data:/scenes:ro" --volume "$work/out:/out" \
    --volume "$work/token:/token:ro" --volume "$work/old-token:/old-token:ro" \
    --volume "$work/other-token:/other-token:ro" --volume "$work/bare:/bare:ro" \
    --env "PEPESEG_SERVER=https://localhost:$gateway_port" --entrypoint pepeseg \
    localhost/pepeseg --key-file "$token" "$@"
}
expect() {  # expect EXIT_CODE COMMAND...
  local code=0
  "${@:2}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}
inside() { podman exec pepesegd "$@"; }
mkdir "$work/bare" "$work/bare/images"
cp tests/data/apc_shelf/images/* "$work/bare/images/"

for _ in {1..60}; do
  if podman healthcheck run pepesegd >/dev/null 2>&1 &&
    podman healthcheck run pepeseg-gateway >/dev/null 2>&1; then break; fi
  sleep 0.5
done
expect 0 podman healthcheck run pepesegd
expect 0 podman healthcheck run pepeseg-gateway

step 'nobody, without rights, on a root that cannot be written'
[[ $(inside id -u) == 10001 ]] || fail 'the server does not run as 10001'
expect 1 inside touch /usr/bin/x
expect 1 inside touch /etc/pepeseg/tls/ca.pem
status=$(inside cat /proc/1/status)
grep -Eq '^CapBnd:[[:space:]]+0+$' <<<"$status" || fail 'the server has capabilities'
grep -Eq '^NoNewPrivs:[[:space:]]+1$' <<<"$status" || fail 'the server may get rights'
grep -Eq '^Seccomp:[[:space:]]+2$' <<<"$status" || fail 'no system call is filtered'
label=$(podman inspect --format '{{index .Config.Labels "pepeseg.packages.sha256"}}' localhost/pepeseg)
[[ $label == "$(inside sha256sum /usr/share/pepeseg/packages.txt | cut -d' ' -f1)" ]] ||
  fail 'the label does not name the list of packages in the image'
grep -q '^colmap 3' "$store/packages.txt" || fail 'the list lacks COLMAP'

step 'who has no token, an old one or none of the project is refused'
expect 0 pepeseg health
token=/old-token
expect 10 pepeseg scenes
grep -q 'expired' "$work/output" || fail 'an expired token is not reported as expired'
token=/token

step 'upload, training; its worker is killed once'
expect 0 pepeseg upload shelf /scenes/apc_shelf
job=$(pepeseg train shelf --steps 1500 --feature-steps 150 --image-scale 0.5 --detach)
worker=
for _ in {1..300}; do
  worker=$(inside sh -c 'grep -lx pepeseg-worker /proc/[0-9]*/comm' 2>/dev/null | head -n 1) || true
  worker=${worker//[!0-9]/}
  [[ -z $worker ]] || ! ls "$work/data/$job"/work/attempt-*/checkpoints/*.ckpt >/dev/null 2>&1 || break
  sleep 0.1
done
[[ -n $worker ]] || fail 'no worker'
filters() { inside sed -n 's/^Seccomp_filters:[[:space:]]*//p' "/proc/$1/status"; }
(($(filters "$worker") > $(filters 1))) || fail "the worker has no sandbox beyond the container's"
if grep -rq 'files are not limited' "$work/data/$job"; then
  echo 'note: this kernel has no Landlock that serves; workers read and write where the server may'
fi
inside sh -c "kill -KILL $worker"
expect 0 pepeseg watch "$job"

step 'queries, an export'
expect 0 pepeseg --json segment shelf --view frame-000000.jpg --point 320,280 --views all --out /out/masks
grep -q '"masks":\[{' "$work/output" || fail 'no masks'
[[ -s $work/out/masks/frame-000000_mask.png ]] || fail 'no mask is written'
expect 0 pepeseg export shelf /out/shelf.ply
[[ $(head -c 3 "$work/out/shelf.ply") == ply ]] || fail 'the export is not a PLY'
token=/other-token
expect 10 pepeseg scenes shelf
token=/token

step 'COLMAP in the image: photographs alone'
expect 0 pepeseg upload bare /bare
code=0
pepeseg train bare --steps 50 --feature-steps 20 --image-scale 0.25 -o features.num_pixels=200 \
  >"$work/output" 2>&1 || code=$?
# The shelf's photographs have too little in common for COLMAP; how many get poses depends on chance.
# COLMAP's last step reports the number, so a number shows that all steps have run.
if ((code != 0)); then
  [[ $code == 7 ]] && grep -Eq '[1-9][0-9]* of 15 show one|poses were found for [1-9][0-9]* of 15' "$work/output" ||
    fail "photographs alone: exit code $code"
fi

step 'what is orphaned is reaped'
inside sh -c '(sleep 0.3 &) ; (sleep 0.4 &)'
# A zombie keeps its name: when no process is named sleep, both were reaped.
for _ in {1..50}; do
  names=$(inside sh -c 'cat /proc/[0-9]*/comm 2>/dev/null; true')
  [[ $'\n'$names$'\n' == *$'\n'sleep$'\n'* ]] || break
  sleep 0.1
done
zombies=$(inside sh -c 'grep -hE "^State:[[:space:]]+Z" /proc/[0-9]*/status 2>/dev/null | wc -l')
[[ $zombies == 0 ]] || fail "$zombies zombies"

step 'both stop'
start=$SECONDS
podman stop --time 40 pepesegd >/dev/null
took=$((SECONDS - start))
[[ $(podman inspect --format '{{.State.ExitCode}}' pepesegd) == 0 ]] || fail 'the server left with a fault'
((took < 30)) || fail "the server took $took s to stop"
expect 5 pepeseg scenes
podman stop --time 20 pepeseg-gateway >/dev/null
code=$(podman inspect --format '{{.State.ExitCode}}' pepeseg-gateway)
[[ $code == 0 ]] || fail "the gateway left with $code"
step "done: image of $(podman image inspect --format '{{.Size}}' localhost/pepeseg) bytes," \
  "gateway of $(podman image inspect --format '{{.Size}}' localhost/pepeseg-gateway)," \
  "the server stopped within $took s"
