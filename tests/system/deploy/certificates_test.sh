#!/usr/bin/env bash
# Tests that server, client and operator accept the certificates of deploy/certificates.sh: TLS with
# clients' certificates and keys, health, the admin listener, and renewed certificates.
#   certificates_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
programs=$1 root=$2
work=$(mktemp -d)
server=
stop() {
  [[ -z $server ]] || kill -TERM "$server" 2>/dev/null || true
  [[ -z $server ]] || wait "$server" || true
  rm -rf "$work"
}
trap stop EXIT
fail() { echo "FAILED: $*" >&2; cat "$work/server.log" "$work/output" >&2; exit 1; }
expect() {  # expect EXIT_CODE COMMAND...
  local code=0
  "${@:2}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}
touch "$work/server.log" "$work/output"

tls=$work/tls
expect 2 "$root/deploy/certificates.sh"
expect 2 "$root/deploy/certificates.sh" "$tls" --days many
expect 2 "$root/deploy/certificates.sh" "$tls" --name 'a,IP:1.2.3.4'
expect 0 "$root/deploy/certificates.sh" "$tls" --days 3 --name scenes.example
for file in server gateway gateway-client operator; do
  expect 0 openssl verify -CAfile "$tls/ca.pem" "$tls/$file.pem"
  [[ $(stat -c %a "$tls/$file.key") == 600 ]] || fail "others may read $file.key"
done
grep -q 'PRIVATE KEY' "$tls/gateway.pem" || fail 'gateway.pem has no key, as HAProxy wants it'
expect 0 openssl x509 -noout -checkhost scenes.example -in "$tls/server.pem"
grep -q 'does match' "$work/output" || fail 'the server certificate lacks the name that was given'

# Checks a token's signature and claims.
expect 2 "$root/deploy/token.sh" "$tls/jwt.key"
expect 2 "$root/deploy/token.sh" "$tls/jwt.key" --project 'a","scope":"operate'
token=$("$root/deploy/token.sh" "$tls/jwt.key" --project lab --scope 'read train')
python3 - "$token" "$work" <<'PYTHON'
import base64, json, pathlib, sys, time
token, work = sys.argv[1], pathlib.Path(sys.argv[2])
part = [base64.urlsafe_b64decode(p + "=" * (-len(p) % 4)) for p in token.split(".")]
assert json.loads(part[0])["alg"] == "RS256"
claims = json.loads(part[1])
assert claims["project"] == "lab" and claims["scope"] == "read train", claims
assert 3500 < claims["exp"] - time.time() <= 3600, claims
(work / "signed").write_text(token.rpartition(".")[0])
(work / "signature").write_bytes(part[2])
PYTHON
expect 0 openssl dgst -sha256 -verify "$tls/jwt.pub" -signature "$work/signature" "$work/signed"

"$programs/pepesegd" --listen 127.0.0.1:0 --data "$work/data" --port-file "$work/port" \
  --admin "unix:$work/admin" --require-keys --devices cpu --tls-certificate "$tls/server.pem" \
  --tls-key "$tls/server.key" --tls-client-ca "$tls/ca.pem" >"$work/server.log" 2>&1 &
server=$!
for _ in {1..200}; do [[ -s $work/port ]] && break; sleep 0.1; done
[[ -s $work/port ]] || fail 'the server does not serve'
export PEPESEG_SERVER=https://localhost:$(cat "$work/port")
pepeseg() { "$programs/pepeseg" "$@"; }
as_operator=(--ca "$tls/ca.pem" --certificate "$tls/operator.pem"
  --certificate-key "$tls/operator.key")

expect 5 pepeseg health --ca "$tls/ca.pem"  # without a client certificate
expect 0 pepeseg health "${as_operator[@]}"
grep -q 'the server serves' "$work/output" || fail 'health does not say so'
expect 0 pepeseg --json health pepeseg.v1.JobService "${as_operator[@]}"
expect 0 pepeseg health --alive "${as_operator[@]}"
expect 3 pepeseg health pepeseg.v1.NoService "${as_operator[@]}"
# Runs the health check of a container: all settings from the environment, the server's certificate.
expect 0 env PEPESEG_CA="$tls/ca.pem" PEPESEG_CERTIFICATE="$tls/server.pem" \
  PEPESEG_CERTIFICATE_KEY="$tls/server.key" "$programs/pepeseg" health
expect 10 pepeseg scenes "${as_operator[@]}"
"$programs/pepesegd" keys create --data "$work/data" --project lab --scopes read,operate \
  >"$work/key" 2>"$work/output"
expect 0 pepeseg scenes "${as_operator[@]}" --key-file "$work/key"

# The admin listener uses the same certificates.
admin=(--admin "unix:$work/admin" "${as_operator[@]}" --key-file "$work/key")
expect 0 pepeseg top --once "${admin[@]}"
expect 0 pepeseg drain "${admin[@]}"
expect 5 pepeseg health "${as_operator[@]}"
grep -q 'does not serve' "$work/output" || fail 'health does not report a drained server'
expect 0 pepeseg drain --off "${admin[@]}"
expect 0 pepeseg health "${as_operator[@]}"

rm "$tls/server.pem"
expect 0 "$root/deploy/certificates.sh" "$tls"
for _ in {1..100}; do
  (($(grep -c 'TLS: .* is in use' "$work/server.log") < 2)) || break
  sleep 0.1
done
(($(grep -c 'TLS: .* is in use' "$work/server.log") >= 2)) || fail 'the new certificate is not read'
expect 0 pepeseg health "${as_operator[@]}"
echo 'every step as expected'
