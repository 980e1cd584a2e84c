#!/usr/bin/env bash
# Builds the image with buildah and only Debian's packages: it needs no running container engine and
# no registry.
#   build.sh STORE [ARGUMENTS OF buildah bud...]
# STORE: a folder that keeps images and caches for the next time. The image is localhost/pepeseg in
# STORE's own storage (`podman --root STORE/storage ...`). PEPESEG_SAVE=1 also writes
# STORE/pepeseg.tar for `docker load`. Run it as root, for mmdebstrap and for buildah's chroot.
set -euo pipefail
cd "$(dirname "$0")/../.."
[[ $# -ge 1 ]] || { sed -n '4,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mkdir -p "$1"
store=$(realpath "$1")
shift
. deploy/image/engine.sh
mirror=${PEPESEG_DEBIAN_MIRROR:-http://deb.debian.org}

# Like debian:bookworm-slim: without manuals and translations, and with usr-is-merged in place of
# usrmerge, which brings 48 MB of Perl.
make_base() {
  ! podman image exists localhost/pepeseg-base || return 0
  echo 'making the base image from Debian packages'
  local check
  check=$(apt-config dump Acquire::Check-Valid-Until)
  # shellcheck disable=SC2016 # for the hook's shell
  local without_perl='chroot "$1" apt-get -qq --yes purge usrmerge "^perl$" "^perl-modules" \
    "^libperl5" "^lib.*-perl$" >/dev/null'
  mmdebstrap --quiet --variant=minbase --include=usr-is-merged ${check:+--aptopt="$check"} \
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
    --customize-hook="$without_perl" \
    bookworm "$store/base.tar" \
    "deb $mirror/debian bookworm main" "deb $mirror/debian bookworm-updates main" \
    "deb $mirror/debian-security bookworm-security main"
  podman import --quiet "$store/base.tar" localhost/pepeseg-base >/dev/null
  rm "$store/base.tar"
}

# Uses this machine's compiler cache, too.
ccache=()
if command -v ccache >/dev/null; then
  mkdir -p "${CCACHE_DIR:=$(ccache --get-config cache_dir)}"
  ccache=(--volume "$CCACHE_DIR:/host-ccache" --build-arg CCACHE_DIR=/host-ccache)
fi
version=$(sed -n 's/^project(pepeseg VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
revision=$(git rev-parse HEAD 2>/dev/null || echo unknown)
make_base
# Format docker, because OCI's has no health check.
buildah bud --isolation chroot --network host --layers --format docker \
  --build-arg BASE=localhost/pepeseg-base --build-arg "VERSION=$version" \
  --build-arg "REVISION=$revision" "${ccache[@]}" "$@" \
  -f deploy/image/Dockerfile -t localhost/pepeseg-unlabelled .

# The list of packages is known after the build; its digest distinguishes images.
container=$(buildah from --pull-never localhost/pepeseg-unlabelled)
trap 'buildah rm "$container" >/dev/null' EXIT
root=$(buildah mount "$container")
cp "$root/usr/share/pepeseg/packages.txt" "$store/packages.txt"
digest=$(sha256sum "$store/packages.txt" | cut -d' ' -f1)
buildah config --label "pepeseg.packages.path=/usr/share/pepeseg/packages.txt" \
  --label "pepeseg.packages.sha256=$digest" "$container"
buildah commit --quiet --format docker "$container" localhost/pepeseg >/dev/null
echo "localhost/pepeseg: $(wc -l <"$store/packages.txt") Debian packages, listed in" \
  "$store/packages.txt, $(du -smx "$root" | cut -f1) MiB"
if [[ ${PEPESEG_SAVE:-0} == 1 ]]; then
  rm -f "$store/pepeseg.tar"
  podman save --quiet --format docker-archive -o "$store/pepeseg.tar" localhost/pepeseg
fi
