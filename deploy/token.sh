#!/usr/bin/env bash
# Signs a JSON Web Token (RS256) as an identity provider would, for tests and for trying out.
#   token.sh KEY_FILE --project P [--scope "read write train"] [--subject NAME] [--seconds 3600]
#            [--issuer pepeseg] [--audience pepeseg] [--not-before SECONDS_FROM_NOW]
# Prints the token. With negative --seconds the token has expired.
set -euo pipefail

usage() {
  sed -n '3,5s/^# \{0,1\}//p' "$0" >&2
  exit 2
}

[[ $# -ge 1 && $1 != -* ]] || usage
key=$1
shift
declare -A claim=([scope]="read write train" [subject]=someone [issuer]=pepeseg [audience]=pepeseg
  [seconds]=3600 [not-before]=0 [project]='')
while (($# > 0)); do
  name=${1#--}
  [[ $1 == --* && $# -gt 1 && -v claim[$name] ]] || usage
  claim[$name]=$2
  shift 2
done
[[ -n ${claim[project]} ]] || usage
[[ -r $key ]] || { echo "$key: cannot be read" >&2; exit 1; }
for name in "${!claim[@]}"; do
  # The value is written into JSON without escapes.
  [[ ${claim[$name]} =~ ^[A-Za-z0-9.,:/@_\ -]+$ ]] ||
    { echo "--$name: letters, digits and .,:/@_- only" >&2; exit 2; }
done
for name in seconds not-before; do
  [[ ${claim[$name]} =~ ^-?[0-9]{1,9}$ ]] || { echo "--$name: a number of seconds" >&2; exit 2; }
done

# Prints base64url without padding, the encoding of tokens.
encode() {
  openssl base64 -A | tr '+/' '-_' | tr -d '='
}

now=$(date +%s)
header='{"alg":"RS256","typ":"JWT"}'
printf -v claims '{"iss":"%s","aud":"%s","sub":"%s","iat":%d,"nbf":%d,"exp":%d,"project":"%s","scope":"%s"}' \
  "${claim[issuer]}" "${claim[audience]}" "${claim[subject]}" "$now" \
  $((now + ${claim[not-before]})) $((now + ${claim[seconds]})) "${claim[project]}" "${claim[scope]}"
signed=$(printf %s "$header" | encode).$(printf %s "$claims" | encode)
signature=$(printf %s "$signed" | openssl dgst -sha256 -sign "$key" | encode)
printf '%s.%s\n' "$signed" "$signature"
