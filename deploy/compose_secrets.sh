#!/usr/bin/env bash
# Makes the secrets of compose.yaml in deploy/secrets: certificates and passwords that do not exist
# yet. Run it as root: the files belong to user 10001, as which the containers run.
#   compose_secrets.sh NAME...        host names under which clients reach the gateway
# An installation with its own authority and identity provider replaces the certificates and the
# public key (jwt.pub) that this makes.
set -euo pipefail
[[ $# -ge 1 && $1 != -* ]] || { sed -n '2,4s/^# \{0,1\}//p' "$0" >&2; exit 2; }
cd "$(dirname "$0")"
folder=${PEPESEG_SECRETS:-secrets}
owner=10001:10001
names=()
for name in "$@"; do names+=(--name "$name"); done
./certificates.sh "$folder" --owner "$owner" "${names[@]}"
umask 077
password() {  # of hex digits: it goes into files of several formats
  [[ -s $folder/$1 ]] || openssl rand -hex 24 >"$folder/$1"
}
password postgres_password
password grafana_password
[[ -s $folder/pgpass ]] ||
  echo "postgres:5432:pepeseg:pepeseg:$(cat "$folder/postgres_password")" >"$folder/pgpass"
chown "$owner" "$folder"/{postgres_password,grafana_password,pgpass}
