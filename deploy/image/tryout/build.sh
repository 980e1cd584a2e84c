#!/usr/bin/env bash
# Builds the image for trying out with buildah, on top of that of ../build.sh.
#   build.sh STORE      (see ../build.sh)
# The image is localhost/pepeseg-tryout. It needs the web app (`make web-app`), and that of the server
# if STORE has none.
set -euo pipefail
cd "$(dirname "$0")/../../.."
[[ $# == 1 ]] || { sed -n '3p' "$0" | cut -c3- >&2; exit 2; }
mkdir -p "$1"
store=$(realpath "$1")
. deploy/image/engine.sh
podman image exists localhost/pepeseg || deploy/image/build.sh "$store"
buildah bud --isolation chroot --network host --layers --format docker \
  --build-arg SERVER=localhost/pepeseg -f deploy/image/tryout/Dockerfile \
  -t localhost/pepeseg-tryout .
size=$(podman image inspect --format '{{.Size}}' localhost/pepeseg-tryout)
echo "localhost/pepeseg-tryout: $((size >> 20)) MiB"
