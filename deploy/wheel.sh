#!/usr/bin/env bash
# Makes the wheel of clients/python/pepeseg, by setuptools.
#   wheel.sh FOLDER
set -euo pipefail
[[ $# == 1 && $1 != -* ]] || { sed -n '3s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mkdir -p "$1"
out=$(realpath "$1")
cd "$(dirname "$0")/.."
# The time of the files in it: that of the last commit.
: "${SOURCE_DATE_EPOCH:=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)}"
export SOURCE_DATE_EPOCH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# A copy, because setuptools writes into its folder; without what it has written there before.
cp -r clients/python/pepeseg "$work/source"
cd "$work/source"
rm -rf build dist ./*.egg-info
find . -name __pycache__ -prune -exec rm -r {} +
rm -f "$out"/pepeseg-*.whl
for python in python3 /usr/bin/python3; do
  "$python" -c 'import setuptools, wheel' 2>/dev/null || continue
  "$python" -c 'import setuptools.build_meta as b, sys; b.build_wheel(sys.argv[1])' "$out" >"$work/log" 2>&1 ||
    { cat "$work/log" >&2; exit 1; }
  sha256sum "$out"/pepeseg-*.whl
  exit
done
echo 'wheel.sh: no python3 with setuptools and wheel: see deploy/packages/build.txt' >&2
exit 1
