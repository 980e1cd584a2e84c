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

readonly model_package=@vladmandic/human@3.3.6 runtime_package=onnxruntime-node@1.30.0
readonly topology=bfb942eaacc5becf738d536663bc4580a0ae9e560722306e6d4dd7fe4a09de05
readonly weights=1b635a15009071f506f9f2b3519b31c072c534888989f30d269ffd44734ef7ef
readonly labels=cdbe430f6415737eb191497734ffbb2627f8cc7144fbcdbf23b0f9cb9fe7150c
# Digests of what they become.
readonly network=444ae157050e424096ffb2a41b67dd7d5d7ea51716a17083bf726fe6f0ef02bc
readonly words=bd17f1ee35d5f3c862a4894605855abbb9dda4b0621fdb0ac4c2c8c7bb7e730a

fail() {
  echo "detector.sh: $*" >&2
  exit 1
}

case $(uname -m) in
  x86_64) arch=x64 runtime=ffb75a925ba05e47b235bb66e3e3911714a80b328a9c9425539feb204aa32a23 ;;
  aarch64) arch=arm64 runtime=1f549d46250b005580b597f4164984aaf75b3bcb9f3aeb07c7f8a8fe60b23c76 ;;
  *) fail "there is no ONNX Runtime for $(uname -m), only for x86_64 and aarch64" ;;
esac

default_folder() {
  local data=${XDG_DATA_HOME-}
  [[ $data == /* ]] || data=${HOME:?detector.sh: name a FOLDER, or set HOME}/.local/share
  echo "$data/pepeseg/detector"
}

[[ $# -le 1 && ${1-} != -* ]] || { sed -n '2,15s/^# \{0,1\}//p' "$0" >&2; exit 2; }
folder=${1:-$(default_folder)}
converter=$(dirname "$(readlink -f "$0")")/graph_model_to_onnx.py

report() {
  local flag=
  [[ $folder == "$(HOME=${HOME-/} default_folder)" ]] || flag=" with --detector $folder"
  echo "the detector is in $folder"
  echo "Next: restart pepesegd$flag if it runs, since it looks for the detector when it starts. Then:"
  echo "pepeseg find SCENE apple. The words are in $folder/words.txt"
}

# In the format of sha256sum. pepesegd reads it, too, and refuses files that differ.
sums="$network  detector.onnx
$words  words.txt
$runtime  libonnxruntime.so.1"

complete() {
  [[ -f $1/SHA256SUMS && $(<"$1/SHA256SUMS") == "$sums" ]] &&
    (cd "$1" && sha256sum --status --check SHA256SUMS)
} 2>/dev/null

if complete "$folder"; then
  report
  exit 0
fi
command -v npm >/dev/null ||
  fail "this needs npm, which gets the files; on Debian: apt-get install --no-install-recommends npm"
command -v python3 >/dev/null ||
  fail "this needs Python 3; on Debian: apt-get install --no-install-recommends python3"

mkdir -p "$folder"
# Next to the final folder, so that renaming puts it there when it is complete.
made=$(mktemp -d "$folder/.new.XXXXXX")
trap 'rm -rf "$made"' EXIT

# check DIGEST FILE: refuses a file with another digest.
check() {
  local found
  found=$(sha256sum <"$made/$2")
  [[ ${found%% *} == "$1" ]] ||
    fail "$2 is not the expected file: its SHA-256 is ${found%% *}, not $1; nothing is kept"
}
# get PACKAGE FILES...: takes files of a package, without their folders.
get() {
  local package=$1 file archives
  echo "getting $package by npm"
  (cd "$made" && npm pack --silent --ignore-scripts "$package" >/dev/null) ||
    fail "npm could not get $package: is its registry reachable from here? (npm ping)"
  archives=("$made"/*.tgz)
  for file in "${@:2}"; do
    tar -xzf "${archives[0]}" -C "$made" --transform 's,.*/,,' "package/$file" 2>/dev/null ||
      fail "$package has no file $file"
  done
  rm -f "$made"/*.tgz
}

get "$model_package" models/centernet.json models/centernet.bin src/object/labels.ts
check "$topology" centernet.json
check "$weights" centernet.bin
check "$labels" labels.ts
if [[ $(sha256sum <"$folder/../sam/libonnxruntime.so.1") == "$runtime  -" ]] 2>/dev/null; then
  cp "$folder/../sam/libonnxruntime.so.1" "$made/"
else
  get "$runtime_package" "bin/napi-v6/linux/$arch/libonnxruntime.so.1"
fi
check "$runtime" libonnxruntime.so.1

python3 "$converter" "$made/centernet.json" "$made/detector.onnx" \
  images=tower_0/images scores=tower_0/keypoints sides=tower_0/wh
sed -n "s/.*label: '\([^']*\)'.*/\1/p" "$made/labels.ts" >"$made/words.txt"
check "$network" detector.onnx
check "$words" words.txt
rm "$made"/centernet.* "$made/labels.ts"

chmod 644 "$made"/*
# The list is written last: pepesegd does not use a folder without it.
rm -f "$folder/SHA256SUMS"
mv -f "$made"/detector.onnx "$made"/words.txt "$made"/libonnxruntime.so.1 "$folder/"
echo "$sums" >"$made/SHA256SUMS"
mv -f "$made/SHA256SUMS" "$folder/SHA256SUMS"
report
