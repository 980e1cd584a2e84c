#!/usr/bin/env bash
# Makes certificates for tests and for trying the service out: a small authority, and certificates
# that it signs. An installation that has an authority uses that one.
#   certificates.sh FOLDER [--days N] [--name HOST]... [--owner USER]
# Makes these files in FOLDER unless they exist. So removing one and running this again renews it;
# the servers read theirs again when they change:
#   ca.pem ca.key                          the authority
#   server.pem server.key                  pepesegd: localhost, pepesegd, 127.0.0.1, ::1, each --name
#   gateway.pem gateway.key                the gateway, for clients: gateway, and the same names
#   gateway-client.pem gateway-client.key  the gateway, for pepesegd: pepeseg-gateway
#   operator.pem operator.key              who calls pepesegd without the gateway: pepeseg-operator
#   jwt.pub jwt.key                        for tokens that token.sh signs, RSA
# gateway.pem and gateway-client.pem also contain their key, as HAProxy reads them.
set -euo pipefail

usage() {
  sed -n '2,5s/^# \{0,1\}//p' "$0" >&2
  exit 2
}

[[ $# -ge 1 && $1 != -* ]] || usage
folder=$1
shift
days=365 owner='' names=(localhost pepesegd)
while (($# > 0)); do
  (($# > 1)) || usage
  case $1 in
    --days) days=$2 ;;
    --name) names+=("$2") ;;
    --owner) owner=$2 ;;
    *) usage ;;
  esac
  shift 2
done
[[ $days =~ ^[1-9][0-9]{0,4}$ ]] || { echo "--days: '$days' is not a number of days" >&2; exit 2; }
for name in "${names[@]}"; do
  # The name becomes part of a list with commas.
  [[ $name =~ ^[A-Za-z0-9.:*_-]+$ ]] || { echo "--name: '$name' is not a host name" >&2; exit 2; }
done
command -v openssl >/dev/null || { echo "this needs openssl" >&2; exit 1; }
umask 077
[[ -d $folder ]] || mkdir -p -m 755 "$folder"  # others read the certificates in it, not the keys
cd "$folder"

made=()
# Runs openssl and prints its output only if it fails: openssl shows progress on standard error.
run() {
  local output
  output=$(openssl "$@" 2>&1) || { printf '%s\n' "$output" >&2; exit 1; }
}

authority() {
  [[ ! -s ca.pem || ! -s ca.key ]] || return 0
  run req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc -days "$days" \
    -subj "/CN=pepeseg test authority" -keyout ca.key.new -out ca.pem.new \
    -addext basicConstraints=critical,CA:TRUE -addext keyUsage=critical,keyCertSign,cRLSign
  mv ca.key.new ca.key && mv ca.pem.new ca.pem
  made+=(ca.pem)
  rm -f server.pem gateway.pem gateway-client.pem operator.pem  # signed by another authority
}

# Prints names as "DNS:localhost,IP:127.0.0.1,...".
alternative_names() {
  local list='' name
  for name in "$@"; do
    if [[ $name =~ ^[0-9.]+$ || $name == *:* ]]; then list+="IP:$name,"; else list+="DNS:$name,"; fi
  done
  echo "${list%,}"
}

# certificate FILE COMMON_NAME USAGE ALTERNATIVE_NAMES
certificate() {
  [[ ! -s $1.pem || ! -s $1.key ]] || return 0
  run req -x509 -CA ca.pem -CAkey ca.key -newkey ec -pkeyopt ec_paramgen_curve:P-256 -noenc \
    -days "$days" -subj "/CN=$2" -keyout "$1.key.new" -out "$1.pem.new" \
    -addext basicConstraints=critical,CA:FALSE -addext "extendedKeyUsage=$3" \
    -addext "subjectAltName=$4"
  [[ $1 != gateway* ]] || cat "$1.key.new" >>"$1.pem.new"
  mv "$1.key.new" "$1.key" && mv "$1.pem.new" "$1.pem"
  made+=("$1.pem")
}

signing_key() {
  [[ ! -s jwt.key || ! -s jwt.pub ]] || return 0
  run genpkey -algorithm RSA -pkeyopt rsa_keygen_bits:2048 -out jwt.key.new
  run pkey -in jwt.key.new -pubout -out jwt.pub.new
  mv jwt.key.new jwt.key && mv jwt.pub.new jwt.pub
  made+=(jwt.pub)
}

authority
# The server's health check shows this certificate as a client's if clients need one.
certificate server pepesegd serverAuth,clientAuth \
  "$(alternative_names "${names[@]}" 127.0.0.1 ::1)"
certificate gateway gateway serverAuth "$(alternative_names gateway "${names[@]}" 127.0.0.1 ::1)"
certificate gateway-client pepeseg-gateway clientAuth DNS:pepeseg-gateway
certificate operator pepeseg-operator clientAuth DNS:pepeseg-operator
signing_key
chmod 644 ca.pem server.pem operator.pem jwt.pub  # nothing secret
if [[ -n $owner ]]; then
  chown "$owner" server.* gateway.* gateway-client.* operator.* jwt.pub ca.pem
fi
if ((${#made[@]} > 0)); then
  echo "made in $PWD: ${made[*]}"
else
  echo "nothing to make in $PWD: all files exist"
fi
