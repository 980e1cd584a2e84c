#!/usr/bin/env bash
# Trains with `--held-out-views` on a server, and checks which views are trained on, which may be
# scored, and which names are refused.
#   held_out_views.sh FOLDER_OF_PROGRAMS WRITE_MINIATURES
set -euo pipefail
programs=$1 write=$2
# shellcheck source=tests/clients/with_server.sh
source "$(dirname "$0")/../with_server.sh"

"$write" "$work/folders"
scene=$work/folders/scene  # the photographs 000.png to 009.png
train() {  # train SCENE OPTION...: a training of a second
  expect 0 pepeseg train "$1" -o reconstruct.num_steps=200 -o reconstruct.sh_degree=0 \
    -o features.num_steps=200 -o features.num_pixels=200 -o features.steps_per_chunk=50 "${@:2}"
}
held_out() { awk '/  held out$/ { printf "%s ", $1 }' "$work/output"; }
refused() {  # refused TEXT COMMAND...: the command refuses a value with this text
  expect 4 "${@:2}"
  grep -qF -- "$1" "$work/errors" || fail "${*:2}: the error lacks '$1'"
}

refused_estimate() { refused "$1" pepeseg estimate table --held-out-views "$2"; }

# The named views are held out, not every 8th.
expect 0 pepeseg upload table "$scene"
train table --held-out-views 003.png,007.png
expect 0 pepeseg scenes table
[[ $(held_out) == '003.png 007.png ' ]] || fail "held out: $(held_out)"

# A file with a name a line means the same; so does one option a name.
printf '003.png\n\n  007.png \n' >"$work/views.txt"
train table --held-out-views "$work/views.txt"
expect 0 pepeseg scenes table
[[ $(held_out) == '003.png 007.png ' ]] || fail "held out by a file: $(held_out)"
train table -o import.held_out_views=003.png -o import.held_out_views=007.png
expect 0 pepeseg scenes table
[[ $(held_out) == '003.png 007.png ' ]] || fail "held out by options: $(held_out)"

# No pixel of a held-out photograph is used: another one in its place changes no byte of the model.
# The same change to a photograph that is trained on does.
cp -r "$scene" "$work/changed"
cp "$scene/images/000.png" "$work/changed/images/003.png"
expect 0 pepeseg upload changed "$work/changed"
expect 0 pepeseg export table "$work/table.ply"
train changed --held-out-views 003.png,007.png
expect 0 pepeseg export changed "$work/changed.ply"
cmp -s "$work/table.ply" "$work/changed.ply" || fail 'a held-out photograph changes the Gaussians'
for name in table changed; do
  expect 0 pepeseg decompose $name --out "$work/parts-$name"
done
diff -r "$work/parts-table" "$work/parts-changed" >"$work/output" ||
  fail 'a held-out photograph changes the segments'
train changed --held-out-views 007.png
expect 0 pepeseg export changed "$work/changed.ply"
! cmp -s "$work/table.ply" "$work/changed.ply" ||
  fail 'a photograph that is trained on does not change the Gaussians'

# An evaluation scores the held-out views. The client refuses to score a trained view, and the server
# refuses one as a reference, unless the protocol allows it.
ball=(--min-pixels 20)
expect 0 pepeseg-benchmark --json evaluate table "$scene/labels" "${ball[@]}"
python3 - "$work/output" <<'PYTHON' || fail 'other views than 003.png and 007.png are scored'
import json, sys
response = json.load(open(sys.argv[1]))
views = {view["view"] for entity in response["entities"] for view in entity["views"]}
views |= {entity["reference_view"] for entity in response["entities"]}
sys.exit(views != {"003.png", "007.png"})
PYTHON
refused 'view "000.png" was trained on; give --trained-views' \
  pepeseg-benchmark evaluate table "$scene/labels" "${ball[@]}" --views 000.png,003.png
trained_prompt=(--prompt '1@000.png:points:48,36')
refused 'was trained on; score held-out views, or set options.accept_trained_views' \
  pepeseg-benchmark evaluate table "$scene/labels" "${ball[@]}" "${trained_prompt[@]}"
for protocol in prompt label-propagation promptable; do
  refused 'was trained on' pepeseg-benchmark evaluate table "$scene/labels" "${ball[@]}" \
    --protocol $protocol --prompt '1@000.png:own-mask'
done
refused 'was trained on' pepeseg-benchmark evaluate table "$scene/masks" --protocol sam-agreement --views 000.png
expect 0 pepeseg-benchmark evaluate table "$scene/labels" "${ball[@]}" --views 000.png,003.png --trained-views
expect 0 pepeseg-benchmark evaluate table "$scene/masks" --protocol sam-agreement --views 000.png --trained-views

# A name that no photograph has is refused, with names like it, by `train` and by `estimate`. No
# model is made.
not_trained() { refused "$1" pepeseg train table --held-out-views "$2"; }
expect 0 pepeseg models table
models=$(wc -l <"$work/output")
for refuse in not_trained refused_estimate; do
  $refuse 'held_out_views: the dataset has no photograph "03.png"; names like it: 003.png' \
    007.png,03.png
  $refuse 'the dataset has no photograph "003"; names like it: 003.png' 003
  $refuse 'the dataset has no photograph "010.png"; names like it: 000.png' 010.png
  $refuse 'all 10 photographs are held out' "$(seq -s, -f '%03g.png' 0 9)"
done
refused 'the model has no view "03.png"; did you mean 003.png' \
  pepeseg-benchmark evaluate table "$scene/labels" --views 03.png
expect 0 pepeseg models table
[[ $(wc -l <"$work/output") == "$models" ]] || fail 'a refused training made a model'
echo 'every step as expected'
