#!/usr/bin/env bash
# Tests deploy/kubernetes as far as `podman play kube` supports it: one server and one gateway with the
# manifests' commands, security contexts, init container and PostgreSQL; a call through the gateway; a
# stop by SIGTERM. In a network namespace of its own, because the manifests have fixed ports.
#   kube_play.sh STORE      run it after deploy/image/test.sh, whose images it uses; as root
set -euo pipefail
[[ ${2:-} == inside ]] || exec unshare --net "$0" "${1:?usage: kube_play.sh STORE}" inside
cd "$(dirname "$0")/../../.."
ip link set lo up
store=$(realpath "$1")
. deploy/image/engine.sh
work=$(mktemp -d "$store/kube.XXXXXX")
chmod 755 "$work"
postgres=
stop() {
  local status=$?
  trap - EXIT
  podman pod rm --force --all --time 0 >/dev/null 2>&1 || true
  [[ -z $postgres ]] || { kill -INT "$postgres" && wait "$postgres" || true; }
  rm -rf "$work"
  exit "$status"
}
trap stop EXIT
fail() {
  echo "FAILED: $*" >&2
  for name in pepesegd-pepesegd pepeseg-gateway-haproxy; do podman logs --tail 20 $name >&2 || true; done
  exit 1
}

password=$(openssl rand -hex 16)
mkdir -p "$work"/{data,secrets/pgpass,postgresql}
deploy/certificates.sh "$work/secrets/tls" --owner 10001:10001
deploy/token.sh "$work/secrets/tls/jwt.key" --project lab >"$work/token"
echo "127.0.0.1:5432:pepeseg:pepeseg:$password" >"$work/secrets/pgpass/pgpass"
chown -R 10001:10001 "$work/secrets/pgpass" "$work/data" "$work/token"
bin=/usr/lib/postgresql/15/bin
echo "$password" >"$work/postgresql/password"
chown -R postgres "$work/postgresql"
as_postgres=(setpriv --reuid postgres --regid postgres --clear-groups)
"${as_postgres[@]}" "$bin/initdb" --pgdata "$work/postgresql/data" --no-sync --username=pepeseg \
  --auth=scram-sha-256 --pwfile="$work/postgresql/password" --encoding=UTF8 --locale=C >/dev/null
"${as_postgres[@]}" "$bin/postgres" -D "$work/postgresql/data" -k "$work/postgresql" \
  -c listen_addresses=127.0.0.1 >"$work/postgresql.log" 2>&1 &
postgres=$!
export PGPASSWORD=$password
for _ in {1..100}; do
  psql -q 'host=127.0.0.1 user=pepeseg dbname=postgres' -c 'CREATE DATABASE pepeseg' >/dev/null 2>&1 && break
  sleep 0.2
done

kubectl kustomize deploy/kubernetes/base |
  python3 tests/system/deploy/kube_pods.py "$work/secrets" "$work/data" >"$work/pods.yaml"
# Uses the engine's limits if larger ones cannot be set.
CONTAINERS_CONF=$work/containers.conf
export CONTAINERS_CONF
echo '[containers]
default_ulimits = ["nofile=1024:1024", "nproc=1024:1024"]' >"$CONTAINERS_CONF"
podman play kube "$work/pods.yaml" >"$work/played" 2>"$work/errors" || { cat "$work/errors" >&2; fail 'play kube'; }
for _ in {1..60}; do
  podman exec pepesegd-pepesegd pepeseg health >/dev/null 2>&1 && break
  sleep 0.5
done
podman exec pepesegd-pepesegd pepeseg health || fail 'the server does not serve'
status=$(podman exec pepesegd-pepesegd cat /proc/1/status)
grep -Eq '^CapBnd:[[:space:]]+0+$' <<<"$status" || fail 'the server has capabilities'
if podman exec pepesegd-pepesegd touch /x 2>/dev/null; then fail 'the root can be written'; fi
sleep 2  # the gateway's checks
podman run --rm --network host --volume "$work/secrets/tls:/etc/pepeseg/tls:ro" \
  --volume "$PWD/tests/data/apc_shelf:/scene:ro" --volume "$work/token:/token:ro" \
  --ulimit nofile=1024:1024 --ulimit nproc=1024:1024 --env PEPESEG_SERVER=https://localhost:8443 \
  --entrypoint pepeseg localhost/pepeseg --key-file /token upload shelf /scene >/dev/null ||
  fail 'no upload through the gateway'
scenes=$(psql -qtA 'host=127.0.0.1 user=pepeseg dbname=pepeseg' -c "SELECT project FROM scenes WHERE id = 'shelf'")
[[ $scenes == lab ]] || fail 'PostgreSQL does not have the scene'
podman stop --time 80 pepesegd-pepesegd >/dev/null
[[ $(podman inspect --format '{{.State.ExitCode}}' pepesegd-pepesegd) == 0 ]] || fail 'the server left with a fault'
echo 'played'
