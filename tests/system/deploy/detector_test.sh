#!/usr/bin/env bash
# Tests that deploy/detector.sh reports errors, keeps only files with the right digests, and does not
# change a complete folder.
#   detector_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
root=$2 script=detector.sh
# shellcheck source=tests/system/deploy/npm_script.sh
source "$(dirname "$0")/npm_script.sh"

expect 2 'detector.sh [FOLDER]' one two
expect 1 'this needs npm' "$work/detector"
npm 'exit 1'
expect 1 'this needs python3' "$work/detector"
[[ ! -e $work/detector ]] || fail 'a folder is left without programs'
printf '#!/bin/sh\nexit 1\n' >"$work/bin/python3"
chmod 755 "$work/bin/python3"
expect 1 'is its registry reachable' "$work/detector"

package_of models/centernet.json models/centernet.bin
expect 1 '@vladmandic/human@3.3.6 has no file src/object/labels.ts' "$work/detector"
package_of src/object/labels.ts
expect 1 'centernet.json is not the expected file: its SHA-256 is ' "$work/detector"
[[ -z $(ls -A "$work/detector") ]] || fail 'something is left of files with wrong digests'

# The default folder is in pepesegd's default data directory.
XDG_DATA_HOME=$work/xdg expect 1 'not the expected' && [[ -d $work/xdg/pepeseg/detector ]] ||
  fail 'XDG_DATA_HOME is not heeded'

# With the real files (PEPESEG_DETECTOR) nothing is downloaded.
if [[ -n ${PEPESEG_DETECTOR-} ]]; then
  npm 'exit 1'
  expect 0 "the detector is in $PEPESEG_DETECTOR" "$PEPESEG_DETECTOR"
fi
