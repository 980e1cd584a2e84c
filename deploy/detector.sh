#!/usr/bin/env bash
# Installs a small detector, which finds things of 80 everyday words (COCO's classes: apple, cup,
# chair, ...) in photographs for `pepeseg find`: 4 MB of an npm package, converted to ONNX once.
#   detector.sh [FOLDER]
# FOLDER: the folder of `pepesegd --detector`; the default is the one where pepesegd looks, detector
# in its default data directory. A complete folder is not changed. Needs npm, npm's registry once,
# and Python 3.
#
# From @vladmandic/human 3.3.6 (MIT): models/centernet.json and .bin, a CenterNet with MobileNetV3
# whose source is named there (MIT), trained on COCO. The weights are not part of pepeseg: whoever
# runs this script decides to use them.
# From onnxruntime-node 1.30.0 (MIT): libonnxruntime.so.1, which runs them; taken from the folder
# that sam.sh has made, FOLDER/../sam, if that has it.
set -euo pipefail
what=detector
here=$(dirname "$(readlink -f "$0")")
# shellcheck source=deploy/npm_files.sh
source "$here/npm_files.sh"

readonly topology=bfb942eaacc5becf738d536663bc4580a0ae9e560722306e6d4dd7fe4a09de05
readonly weights=1b635a15009071f506f9f2b3519b31c072c534888989f30d269ffd44734ef7ef
readonly labels=cdbe430f6415737eb191497734ffbb2627f8cc7144fbcdbf23b0f9cb9fe7150c
# Digests of what they become.
readonly network=444ae157050e424096ffb2a41b67dd7d5d7ea51716a17083bf726fe6f0ef02bc
readonly words=bd17f1ee35d5f3c862a4894605855abbb9dda4b0621fdb0ac4c2c8c7bb7e730a

report() {
  echo "the detector is in $folder"
  echo "Next: restart pepesegd$(flag_of_folder) if it runs, since it looks for the detector when it starts. Then:"
  echo "pepeseg find SCENE apple. The words are in $folder/words.txt"
}

read_arguments 2,15 "$@"
begin report "$network  detector.onnx
$words  words.txt
$runtime  libonnxruntime.so.1" python3
get @vladmandic/human@3.3.6 models/centernet.json models/centernet.bin src/object/labels.ts
check "$topology" centernet.json
check "$weights" centernet.bin
check "$labels" labels.ts
if [[ $(sha256sum <"$folder/../sam/libonnxruntime.so.1") == "$runtime  -" ]] 2>/dev/null; then
  cp "$folder/../sam/libonnxruntime.so.1" "$made/"
else
  get "$runtime_package" "$runtime_file"
fi
python3 "$here/graph_model_to_onnx.py" "$made/centernet.json" "$made/detector.onnx" \
  images=tower_0/images scores=tower_0/keypoints sides=tower_0/wh
sed -n "s/.*label: '\([^']*\)'.*/\1/p" "$made/labels.ts" >"$made/words.txt"
finish
