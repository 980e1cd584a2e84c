#!/usr/bin/env bash
# Scores a model with `pepeseg-benchmark evaluate` against outlines on a server: the scores are those against
# label images of the same things, wherever the outlines are.
#   outlines_as_truth.sh FOLDER_OF_PROGRAMS WRITE_MINIATURES
set -euo pipefail
programs=$1 write=$2
# shellcheck source=tests/clients/with_server.sh
source "$(dirname "$0")/../with_server.sh"

"$write" "$work/folders"
scene=$work/folders/scene  # the photographs 000.png to 009.png
expect 0 pepeseg upload table "$scene"
expect 0 pepeseg train table -o reconstruct.num_steps=200 -o reconstruct.sh_degree=0 \
  -o features.num_steps=200 -o features.num_pixels=200 -o features.steps_per_chunk=50

outlines() {  # outlines FILE STEM...: writes COCO's JSON of these photographs
  mkdir -p "$(dirname "$1")"
  python3 "$(dirname "$0")/../write_coco.py" "$scene/masks" "$@"
}
evaluate() {  # evaluate TRUTH OPTION...: writes the response without its time to $work/scores
  expect 0 pepeseg-benchmark --json evaluate table "$@" --min-pixels 20
  sed 's/,"compute":"[^"]*"//' "$work/output" >"$work/scores"
}

evaluate "$scene/labels"
cp "$work/scores" "$work/by_labels"
python3 - "$work/by_labels" <<'PYTHON' || fail 'the label images score fewer than two entities above zero'
import json, sys
scores = json.load(open(sys.argv[1]))["entities"]
sys.exit(sum(entity["automatic"]["mean"]["iou"] > 0 for entity in scores) < 2)
PYTHON

# A file, its folder, and a scene's folder; 000 and 008 are held out, 001 is not.
outlines "$work/outlined/annotations/things.json" 000 001 008
cp -r "$scene/images" "$work/outlined/images"
for truth in outlined/annotations/things.json outlined/annotations/ outlined; do
  evaluate "$work/$truth"
  cmp -s "$work/scores" "$work/by_labels" || fail "$truth has other scores than label images"
  ! grep -q 'not views' "$work/errors" || fail 'a warning about a view'
done
cp -r "$scene/labels" "$work/outlined/labels"
rm "$work/outlined/annotations/things.json"
evaluate "$work/outlined"
cmp -s "$work/scores" "$work/by_labels" || fail 'the label images of a scene have other scores'

# The other protocols and kinds of prompts take outlines, too.
outlines "$work/things.json" 000 001 008
for options in '--protocol clicks' '--protocol label-propagation --reference 000.png' \
  '--trained-views --views 000.png,001.png,008.png'; do
  read -ra words <<<"$options"
  evaluate "$scene/labels" "${words[@]}"
  cp "$work/scores" "$work/by_labels"
  evaluate "$work/things.json" "${words[@]}"
  cmp -s "$work/scores" "$work/by_labels" || fail "other scores than by label images: $options"
done

# Photographs that are not views of the model, and views without outlines.
sed 's/001\.png/0011.png/' "$work/things.json" >"$work/misnamed.json"
evaluate "$work/misnamed.json"
grep -q '^1 of 3 photographs with outlines are not views of the model, such as "0011.png".*mean 001' \
  "$work/errors" || fail 'no warning about a photograph that is not a view'
outlines "$work/one.json" 000
evaluate "$work/one.json" --score-reference
grep -q '^1 views have nothing in .*one.json, such as 008.png' "$work/errors" ||
  fail 'no note about a view without outlines'
outlines "$work/trained.json" 001
expect 3 pepeseg-benchmark evaluate table "$work/trained.json"
grep -q 'expected outlines of 000.png; found those of 1 other' "$work/errors" ||
  fail 'outlines of a trained view only are scored'

# Refusals.
sed 's/"counts"/"count"/' "$work/things.json" >"$work/malformed.json"
expect 4 pepeseg-benchmark evaluate table "$work/malformed.json"
grep -q 'malformed.json: annotation 0: segmentation is ' "$work/errors" || fail 'no such annotation'
expect 4 pepeseg-benchmark evaluate table "$scene/masks"  # of SAM
grep -q '000.json: neither outlines of LabelMe .* move it elsewhere' "$work/errors" ||
  fail 'masks of SAM are not refused as outlines'
expect 3 pepeseg-benchmark evaluate table "$work/nothing.json"
grep -q 'no such folder or file of outlines: .*nothing.json' "$work/errors" || fail 'no such file'
expect 3 pepeseg-benchmark evaluate table "$work/things.json" --protocol sam-agreement

same_pixels() {  # same_pixels PNG PNG: of two encoders
  local python
  for python in python3 /usr/bin/python3; do ! "$python" -c 'import PIL' 2>/dev/null || break; done
  "$python" - "$@" <<'PYTHON'
import sys
from PIL import Image
one, other = (Image.open(file).convert("L") for file in sys.argv[1:])
sys.exit((one.size, one.tobytes()) != (other.size, other.tobytes()))
PYTHON
}
# Export of labels: in a label's own view its mask is the answer, pixel for pixel. No click has the
# union of all things as its answer.
for n in 0 1; do
  expect 0 pepeseg label table thing-$n --view 00$n.png --mask "$scene/labels/00$n.png" --text things.$((n + 1))
done
expect 0 pepeseg labels table thing-0 --out "$work/accepted"
expect 0 pepeseg segment table --label thing-0 --views 000.png 002.png --out "$work/segmented"
for format in masks coco yolo labelme; do
  expect 0 pepeseg export table "$work/export/$format" --format $format --views 000.png 001.png
done
for mask in segmented/000_mask.png export/masks/thing-0/000.png; do
  same_pixels "$work/accepted/thing-0_mask.png" "$work/$mask" || fail "$mask is not the accepted mask"
done
expect 0 pepeseg --json labels table thing-0
cp "$work/output" "$work/label.json"
python3 - "$work" <<'PYTHON' || fail 'the exports do not agree'
import json, sys
work = sys.argv[1]
coco = json.load(open(f"{work}/export/coco"))
label = json.load(open(f"{work}/label.json"))
images = {image["id"]: image["file_name"] for image in coco["images"]}
assert sorted(images.values()) == ["000.png", "001.png"], images
assert [category["name"] for category in coco["categories"]] == ["things"]
found = [a for a in coco["annotations"] if (images[a["image_id"]], a["label"]) == ("000.png", "thing-0")]
assert found[0]["segmentation"]["counts"] == label["mask"]["rle"]["counts"]
assert {a["track_id"] for a in coco["annotations"] if a["label"] == "thing-1"} == {2}
shapes = json.load(open(f"{work}/export/labelme/001.json"))["shapes"]
assert ("things", 2) in {(shape["label"], shape["group_id"]) for shape in shapes}
lines = open(f"{work}/export/yolo/labels/001.txt").read().splitlines()
tracks = open(f"{work}/export/yolo/tracks.csv").read().splitlines()
assert len(lines) == sum(line.startswith("labels/001.txt,") for line in tracks) > 0
assert 'things"' in open(f"{work}/export/yolo/data.yaml").read()
PYTHON
expect 4 pepeseg export table "$work/export/other" --format coco --views 00.png
grep -q 'did you mean .*000.png' "$work/errors" || fail 'no nearest name of a view'

# The nearest names of scenes and views.
expect 3 pepeseg scenes tabel
grep -q 'did you mean table?' "$work/errors" || fail 'no nearest name of a scene'
expect 4 pepeseg segment table --view 0000.png --point 20,20
grep -q 'did you mean .*000.png' "$work/errors" || fail 'no nearest name of the view of a click'
expect 3 pepeseg --json photograph table 0001.png "$work/photograph.png"
grep -q 'did you mean .*001.png' "$work/output" || fail 'no nearest name of a photograph'
echo 'every step as expected'
