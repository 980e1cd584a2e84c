#!/usr/bin/env bash
# Makes Debian packages of what is built, by debhelper: pepeseg-server, pepeseg, pepeseg-web. They go to
# BUILD_FOLDER/packages. Two builds of one commit in equal environments give the same bytes.
#   deb.sh BUILD_FOLDER
set -euo pipefail
cd "$(dirname "$0")/.."
[[ $# == 1 && -f $1/CMakeCache.txt ]] || { sed -n '4s/^# \{0,1\}//p' "$0" >&2; exit 2; }
PEPESEG_BUILD=$(realpath "$1") PEPESEG_ROOT=$PWD
export PEPESEG_BUILD PEPESEG_ROOT
version=$(sed -n 's/^project(pepeseg VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
# All times in the packages: that of the last commit.
: "${SOURCE_DATE_EPOCH:=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)}"
export SOURCE_DATE_EPOCH

packages=$PEPESEG_BUILD/packages
rm -rf "$packages"
mkdir -p "$packages/source"
cp -r deploy/debian "$packages/source/debian"
maintainer=$(sed -n 's/^Maintainer: //p' deploy/debian/control)
cat >"$packages/source/debian/changelog" <<CHANGELOG
pepeseg ($version) bookworm; urgency=medium

  * Version $version: see CHANGELOG.md.

 -- $maintainer  $(date -u -R -d "@$SOURCE_DATE_EPOCH")
CHANGELOG
cd "$packages/source"
dpkg-buildpackage --build=binary --no-sign >"$packages/log" 2>&1 || { tail -n 40 "$packages/log" >&2; exit 1; }
cd ..
rm -r source
sha256sum -- *.deb
