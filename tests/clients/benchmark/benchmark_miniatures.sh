#!/usr/bin/env bash
# Runs `pepeseg-benchmark suite` as a researcher does, on a miniature of each benchmark's folder: upload,
# tiny trainings, scores, tables, and a second run that repeats nothing.
#   benchmark_miniatures.sh FOLDER_OF_PROGRAMS WRITE_MINIATURES
set -euo pipefail
programs=$1 write=$2
here=$(cd "$(dirname "$0")" && pwd)
# shellcheck disable=SC2034  # of with_server.sh
server_flags=(--text-command "$here/find_colour.py" --sandbox-read "$here")
# shellcheck source=tests/clients/with_server.sh
source "$(dirname "$0")/../with_server.sh"

"$write" "$work/folders"

benchmark() {  # benchmark NAME FOLDER OPTION...
  "$programs/pepeseg-benchmark" suite "$1" "$work/folders/$2" --out "$work/out/$1" \
    -o reconstruct.num_steps=300 -o reconstruct.sh_degree=0 -o features.num_steps=300 \
    -o features.num_pixels=200 -o features.steps_per_chunk=50 "${@:3}" \
    >"$work/output" 2>"$work/errors" || fail "benchmark $1"
}
score() {  # score NAME CHOICE: the mean IoU of the first run, in percent, rounded down
  python3 -c 'import json, sys
level = json.load(open(sys.argv[1]))[0]["levels"][0][sys.argv[2]]
print(int(100 * level["iou"]) if level["known"] else -1)' "$work/out/$1/table.json" "$2"
}

plot() {  # plot NAME: checks that the plotter finds the IoU that the table has
  PYTHONPATH=$(dirname "$0")/../../bench python3 - "$work/out/$1/record.jsonl" "$work/out/$1/table.json" <<'PYTHON'
import json, report, sys
_, series, panels = report.entity_panels(report.read_runs(sys.argv[1]))
plotted = sorted(iou for _, rows in panels for _, values in rows for seeds in values for iou in seeds)
known = []
for level in json.load(open(sys.argv[2]))[0]["levels"]:
    known += [entity["automatic"] for entity in level["entities"]] + [level["automatic"]["iou"]]
wanted = sorted(100 * iou for iou in known)
assert len(series) == 1 and len(plotted) == len(wanted) > 1, (plotted, wanted)
assert all(abs(a - b) < 1e-9 for a, b in zip(plotted, wanted)), (plotted, wanted)
PYTHON
}

benchmark nvos nvos
benchmark spin-nerf spin-nerf
benchmark lerf-mask lerf-mask
benchmark lerf-mask-fine lerf-mask
benchmark scene scene
for name in nvos spin-nerf lerf-mask lerf-mask-fine scene; do
  paper=$(score $name paper)
  # A miniature is trained for a second: most of an object must be found, not all of it.
  ((paper >= 50)) || fail "$name: mean IoU $paper"
  ((paper >= $(score $name automatic) && paper >= $(score $name reference))) ||
    fail "$name: a choice without the scored truth is better than the one by it"
  plot $name || fail "$name: the plot"
  grep -q '^| scene | mIoU ' "$work/out/$name/table.md" || fail "$name: no table"
done
grep -q '| PePESeg3D | the scored views\* | 92.2 |' "$work/out/nvos/table.md" ||
  fail 'no published rows'
grep -q 'true mask of the first test view' "$work/out/lerf-mask/table.md" ||
  fail 'the report does not say that the prompt is easier than the published one'
grep -q 'clicks to 90' "$work/out/scene/table.csv" || fail 'no clicks'
grep -q 'SAM best IoU' "$work/out/scene/table.csv" || fail 'no agreement with SAM'
compgen -G "$work/out/spin-nerf/pictures/table-1-table-*.png" >/dev/null || fail 'no pictures'

# Outlines of the same things score the same as label images, whose entities are named by their ids.
cp -r "$work/folders/scene" "$work/folders/outlined"
rm -r "$work/folders/outlined/labels"
python3 "$(dirname "$0")/../write_coco.py" "$work/folders/outlined/masks" \
  "$work/folders/outlined/annotations.json" 000 008
mv "$work/out/scene" "$work/out/labelled"
benchmark scene outlined
python3 - "$work/out/labelled/table.json" "$work/out/scene/table.json" <<'PYTHON' ||
import json, sys
levels = [json.load(open(path))[0]["levels"] for path in sys.argv[1:]]
assert levels[0] == levels[1] and len(levels[0][0]["entities"]) > 1, levels
PYTHON
  fail 'outlines and label images of the same things have other scores'

benchmark nvos nvos
grep -q 'in the record: table' "$work/errors" || fail 'a finished run is repeated'
benchmark nvos nvos --no-refine-borders
[[ $(wc -l <"$work/out/nvos/record.jsonl") == 2 ]] || fail 'plain borders are not another run'
grep -q 'features.steps_per_chunk=50, no refine_borders' "$work/out/nvos/table.md" ||
  fail 'the table does not say that borders were not refined'
python3 - "$work/out/nvos/record.jsonl" <<'PYTHON' || fail 'plain borders have the same scores'
import json, sys
refined, plain = [json.loads(line)["levels"] for line in open(sys.argv[1])]
assert plain != refined
PYTHON
# By text: the fake text command finds the red box, and nothing green.
benchmark lerf-mask lerf-mask --protocol text
python3 - "$work/out/lerf-mask/table.json" <<'PYTHON' || fail 'scores by text'
import json, sys
level = json.load(open(sys.argv[1]))[0]["levels"][0]
ious = {entity["name"]: entity["automatic"] for entity in level["entities"]}
assert ious["green ball"] == 0 and ious["red box"] > 0.4, ious
assert abs(level["automatic"]["iou"] - ious["red box"] / 2) < 1e-9, level
assert not level["paper"]["known"] and not level["reference"]["known"], level
PYTHON
grep -q '^Protocol text; ' "$work/out/lerf-mask/table.md" || fail 'no table of the text protocol'
grep -q 'that they do not find counts as 0' "$work/out/lerf-mask/table.md" || fail 'no caveat'
expect 4 pepeseg-benchmark suite nvos "$work/folders/nvos" --protocol text

mv "$work/out/lerf-mask/record.jsonl" "$work/by_text.jsonl"
benchmark lerf-mask lerf-mask
benchmark lerf-mask lerf-mask --seeds 2
[[ $(wc -l <"$work/out/lerf-mask/record.jsonl") == 2 ]] || fail 'the second seed is not recorded'
grep -q ' +- ' "$work/out/lerf-mask/table.md" || fail 'no spread'
if python3 -c 'import matplotlib' 2>/dev/null; then
  "$(dirname "$0")/../../bench/plots.py" entities "$work/out/lerf-mask/record.jsonl" --out "$work/entities.svg" &&
    grep -q 'mean' "$work/entities.svg" || fail 'no plot'
fi
