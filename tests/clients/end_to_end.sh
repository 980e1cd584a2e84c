#!/usr/bin/env bash
# Runs pepesegd, pepeseg-worker and pepeseg as a user does: upload, train (a few steps at a quarter of
# the size), segment, render, export; and checks the exit codes of what fails.
#   end_to_end.sh FOLDER_OF_PROGRAMS DATASET
set -euo pipefail
programs=$1 dataset=$2
# shellcheck source=tests/clients/with_server.sh
source "$(dirname "$0")/with_server.sh"

expect 3 pepeseg scenes nothing
expect 3 pepeseg watch jobs/j999
expect 4 pepeseg watch nothing
expect 4 pepeseg upload 'No Label' "$dataset"
expect 0 pepeseg upload shelf "$dataset"
expect 0 pepeseg upload shelf "$dataset"
grep -q 'has every file' "$work/errors" || fail 'a second upload sends the same bytes'
expect 0 pepeseg datasets shelf
grep -Eq '^DATASET +AGE +FILES +SIZE +ADVICE$' "$work/output" || fail 'datasets prints no header'
expect 0 pepeseg datasets shelf 2
grep -Eq '^scenes/shelf/datasets/2: [0-9]+ files, ' "$work/output" || fail 'datasets describes none'
expect 3 pepeseg datasets shelf 3
expect 6 pepeseg datasets shelf --delete-upload 2
expect 6 pepeseg segment shelf --view frame-000000.jpg --point 400,240
expect 4 pepeseg train shelf --steps 0
grep -q 'reconstruct.num_steps is "0", must be in \[1, 10000000\]' "$work/errors" || fail 'no range'
expect 4 pepeseg train shelf -o features.smoth_until=0
grep -q 'did you mean features.smooth_until?' "$work/errors" || fail 'no option like it is proposed'
expect 0 pepeseg train --list-options --preset best
grep -Eq '^features.smooth_until +0.65 +\[0, 1\]$' "$work/output" || fail 'an option is not listed'
grep -q '^    Share of num_steps in which features are smoothed' "$work/output" || fail 'no description'
expect 0 pepeseg train shelf --steps 60 --feature-steps 30 --image-scale 0.25 \
  -o features.num_pixels=200 --previews "$work/previews"
[[ -s "$work/previews/reconstruct-000060.jpg" && $(ls "$work/previews" | wc -l) -ge 2 ]] ||
  fail 'train writes no previews'
grep -Eq '^frame-000008.jpg +[0-9.]+ +[0-9.]+$' "$work/output" || fail 'train prints no scores of the views'
grep -q '^trained on: poses given, masks given, depth given$' "$work/output" ||
  fail 'train does not print the sources'
grep -Eq '^Next: .*pepeseg segment shelf --view frame-[0-9]+.jpg --point [0-9]+,[0-9]+ ' \
  "$work/output" || fail 'train does not print the next command'
grep -Eq 'stage [2-5] of 5 ' "$work/errors" || fail 'train does not number the stages'
expect 0 pepeseg watch "$(pepeseg jobs shelf | awk 'NR == 2 { print $1 }')" --previews "$work/late"
diff -r "$work/previews" "$work/late" || fail 'a late watch has other previews'
expect 0 pepeseg jobs
grep -Eq '^JOB +STATE +SCENE +AGE +TOOK +SIZE +RESULT$' "$work/output" || fail 'jobs prints no header'
grep -Eq '^jobs/j1 +succeeded +shelf +[0-9]+ (s|min) .* [kM]B +scenes/shelf/models/1$' \
  "$work/output" || fail 'jobs does not list the job'
expect 0 pepeseg scenes
grep -Eq '^shelf +[0-9]+ (s|min) +1 +[0-9.]+ [kM]B +scenes/shelf/models/1 +trained$' \
  "$work/output" || fail 'scenes does not list the scene'
expect 0 pepeseg models shelf
grep -Eq '^1 +[0-9]+ (s|min) .* jobs/j1 +2 +poses given, ' "$work/output" || fail 'models does not list the model'
expect 0 pepeseg --json jobs
grep -q '"state":"JOB_STATE_SUCCEEDED"' "$work/output" || fail 'the job did not succeed'
expect 0 pepeseg scenes shelf
grep -q 'psnr' "$work/output" || fail 'the model has no PSNR'
grep -q '  trained on: poses given' "$work/output" || fail 'scenes does not print the sources'
expect 0 pepeseg segment shelf --model jobs/j1 --view frame-000000.jpg --point 280,280 --threshold 0
grep -q '^scenes/shelf/models/1 ' "$work/output" || fail 'a job does not stand for its model'
expect 3 pepeseg segment shelf --model jobs/j999 --view frame-000000.jpg --point 280,280
expect 0 pepeseg segment shelf --view frame-000000.jpg --point 280,280 --threshold 0 \
  --views held-out --out "$work/masks"
for stem in frame-000000 frame-000008; do
  [[ -s $work/masks/${stem}_mask.png && -s $work/masks/${stem}_overlay.png ]] ||
    fail "no mask of $stem"
done
head -c 24 "$work/masks/frame-000000_mask.png" | tail -c 8 | od -An -tx1 | tr -d ' \n' |
  grep -q '00000280000001e0' || fail 'the mask does not have the size of the photograph, 640x480'
# The last point alone corrects a mask that was there before.
expect 0 pepeseg segment shelf --view frame-000000.jpg --point 280,280 \
  --previous-mask "$work/masks/frame-000000_mask.png" --out "$work/corrected"
cmp -s "$work/masks/frame-000000_mask.png" "$work/corrected/frame-000000_mask.png" ||
  fail 'a point that the mask answers changes it'
expect 2 pepeseg segment shelf --view frame-000000.jpg --box 1,1,50,50 \
  --previous-mask "$work/masks/frame-000000_mask.png"
expect 4 pepeseg segment shelf --view frame-000000.jpg --point 700,60
grep -q 'point 700,60 is outside photograph "frame-000000.jpg" (640x480)' "$work/errors" ||
  fail 'a refused point is not reported with the size of the photograph'
expect 0 pepeseg segment shelf --view frame-000000.jpg --point 70,70 --threshold 0 --frame view
expect 0 pepeseg segment shelf --view frame-000000.jpg --point 70,70 --scale 0.2 --threshold 0.7 --frame view
cp "$work/output" "$work/refined"
expect 0 pepeseg segment shelf --view frame-000000.jpg --point 70,70 --scale 0.2 --threshold 0.7 --frame view \
  --no-refine-borders
if cmp -s "$work/output" "$work/refined"; then fail 'segment moves no border'; fi
expect 4 pepeseg segment shelf --view frame-000000.jpg --point 280,280 --frame view
grep -q 'outside view "frame-000000.jpg" (160x120)' "$work/errors" ||
  fail 'a refused point is not reported with the size of the view'

expect 0 pepeseg label shelf cup --view frame-000000.jpg --point 280,280 --threshold 0 --text 'A cup'
expect 0 pepeseg label shelf mug --view frame-000000.jpg --mask "$work/masks/frame-000000_mask.png"
expect 6 pepeseg label shelf mug --view frame-000000.jpg --mask "$work/masks/frame-000000_mask.png"
expect 4 pepeseg label shelf plate --view frame-000000.jpg --frame view \
  --mask "$dataset/labels/frame-000000.png"
grep -q "'640x480'.*160x120" "$work/errors" || fail 'a mask of another size is not refused'
expect 0 pepeseg labels shelf
areas=$(awk '{print $3}' "$work/output" | uniq | wc -l)
[[ $(wc -l <"$work/output") == 2 && $areas == 1 ]] || fail 'the labels by a click and by its mask differ'
expect 0 pepeseg labels shelf mug --out "$work"
grep -q '^scenes/shelf/labels/mug ' "$work/output" || fail 'labels does not describe a label'
head -c 24 "$work/mug_mask.png" | tail -c 8 | od -An -tx1 | tr -d ' \n' |
  grep -q '00000280000001e0' || fail 'the mask of a label does not have the size of the photograph'
expect 3 pepeseg labels shelf plate --out "$work"
expect 0 pepeseg find shelf mugs
grep -q 'by labels' "$work/output" || fail 'find does not say where the things are from'
expect 0 pepeseg find shelf mug --format csv
grep -q '^1,1.00,' "$work/output" || fail 'find prints no comma-separated values'
expect 3 pepeseg find shelf mugg
grep -q 'no such thing; did you mean mug?' "$work/errors" || fail 'find suggests no word'
expect 6 pepeseg find shelf --view frame-000000.jpg --point 280,280
grep -q 'deploy/sam.sh' "$work/errors" || fail 'find does not say what to install'
expect 0 pepeseg segment shelf --text mug --out "$work/text"
[[ -s $work/text/frame-000000_mask.png ]] || fail 'segment --text writes no mask'
expect 3 pepeseg segment shelf --text zebra
expect 0 pepeseg labels shelf --delete mug
expect 3 pepeseg labels shelf --delete mug

expect 0 pepeseg select shelf --view frame-000000.jpg --point 280,280 --threshold 0
grep -Eq '^scenes/shelf/selections/1  scenes/shelf/models/1  [1-9][0-9]* Gaussians' "$work/output" ||
  fail 'select finds no Gaussians'
expect 0 pepeseg select shelf --view frame-000003.jpg --point 280,280 --threshold 0 --add-to 1 \
  --views 4 --keep-disconnected --out "$work"
grep -q 'from scenes/shelf/selections/1' "$work/output" || fail 'select does not print the base'
expect 0 pepeseg combine shelf 2 subtract 1
expect 0 pepeseg selections shelf 3 --undo
grep -q '^scenes/shelf/selections/2 ' "$work/output" || fail 'undo does not return the base'
expect 6 pepeseg selections shelf 1 --undo
expect 0 pepeseg selections shelf 1 --delete
expect 3 pepeseg selections shelf 1
printf '0\n7\n' >"$work/picked.txt"
expect 0 pepeseg select shelf --indices "$work/picked.txt" --name 'two of them'
grep -q ' 2 Gaussians .*"two of them"$' "$work/output" || fail 'given Gaussians are not selected'
expect 0 pepeseg select shelf --indices - --subtract-from 4 < <(echo 7)
grep -q ' 1 Gaussians ' "$work/output" || fail 'indices are not read from standard input'
expect 0 pepeseg selections shelf
grep -q '"two of them"$' "$work/output" || fail 'selections shows no names'
echo 99999999 >"$work/picked.txt"
expect 4 pepeseg select shelf --indices "$work/picked.txt"
expect 0 pepeseg --json selections shelf
grep -q '"num_gaussians":' "$work/output" || fail 'selections prints no JSON'
expect 0 pepeseg find shelf cup --export "$work/found"
[[ $(head -c 3 "$work/found/found_1.ply") == ply ]] || fail 'find writes no PLY'

expect 0 pepeseg correct shelf --mask "frame-000000.jpg=$work/masks/frame-000000_mask.png"
grep -q '^scenes/shelf/models/2  corrected from scenes/shelf/models/1' "$work/output" ||
  fail 'correct makes no model'
grep -q 'undo: pepeseg models shelf 1 --live' "$work/errors" || fail 'correct does not say how to undo'
expect 0 pepeseg models shelf 2
grep -q 'corrected from scenes/shelf/models/1' "$work/output" || fail 'a model hides its origin'
expect 0 pepeseg models shelf 1 --live
grep -q 'scenes/shelf/models/1$' "$work/output" || fail 'the former model is not live again'
expect 0 pepeseg models shelf 2 --delete
expect 0 pepeseg edit shelf move --selection 2 --by 0.1,0,0 --rotate y,30
grep -Eq '^scenes/shelf/models/3  edited from scenes/shelf/models/1: moved [1-9][0-9]* Gaussians$' \
  "$work/output" || fail 'edit makes no model'
grep -q 'the moved ones are in scenes/shelf/selections/' "$work/output" || fail 'edit names no selection'
grep -q 'undo: pepeseg models shelf 1 --live' "$work/errors" || fail 'edit does not say how to undo'
expect 0 pepeseg models shelf
grep -Eq '^3 .* edited 1: moved [1-9][0-9]* Gaussians$' "$work/output" || fail 'models does not say what an edit did'
expect 0 pepeseg models shelf 3
grep -q '  edited from scenes/shelf/models/1: moved ' "$work/output" || fail 'a model hides its edit'
expect 6 pepeseg edit shelf recolor --selection 2 --color '#cc2200'
expect 0 pepeseg models shelf 1 --live
expect 0 pepeseg models shelf 3 --delete
expect 0 pepeseg edit shelf remove --view frame-000000.jpg --mask "$work/masks/frame-000000_mask.png" --fill
grep -q '^selected: scenes/shelf/selections/' "$work/errors" || fail 'edit selects nothing first'
grep -Eq ': [0-9]+ of [1-9][0-9]*$' "$work/errors" || fail 'edit shows no progress'
grep -Eq ': removed [1-9][0-9]*, added [1-9][0-9]* Gaussians$' "$work/output" || fail 'the hole is not filled'
expect 0 pepeseg models shelf 1 --live
expect 0 pepeseg models shelf 4 --delete
expect 3 pepeseg edit shelf remove --selection 999
expect 4 pepeseg correct shelf --mask "frame-000000.jpg"
expect 4 pepeseg correct shelf --mask "nothing.jpg=$work/masks/frame-000000_mask.png"

expect 0 pepeseg render shelf --views frame-000003.jpg --out "$work"
[[ -s $work/frame-000003.png ]] || fail 'render writes no picture'
expect 0 pepeseg render shelf --views frame-000003.jpg --content depth --out "$work/depth"
grep -q 'scene units a step' "$work/output" || fail 'render prints no unit of depth'
expect 0 pepeseg decompose shelf --scales 0.1,0.9 --level 1 --out "$work/pieces"
grep -q '^level 1  scale 0.9' "$work/output" || fail 'decompose prints no levels'
grep -Eq '^  1:1 +[0-9]+ Gaussians' "$work/output" || fail 'decompose prints no segments'
[[ $(head -c 3 "$work/pieces/level_1/segment_1.ply") == ply ]] || fail 'decompose writes no PLY of a segment'
# The header of a PNG has bit depth (16) and colour type (0: grey) after the size.
[[ $(od -An -tu1 -j24 -N2 "$work/pieces/frame-000003_ids.png" | tr -s ' ') == ' 16 0' ]] ||
  fail 'decompose writes no ids'
[[ -s $work/pieces/frame-000003_colors.png ]] || fail 'decompose writes no coloured segments'
expect 0 pepeseg decompose shelf --table "$work/table.csv"
[[ $(head -n 1 "$work/table.csv") == level,id,parent,name,gaussians,views,pixels,* ]] ||
  fail 'the table of segments has other columns'
awk -F, 'NR > 1 && $5 > 0 && $6 > 0 && $7 > 0 {++seen} END {exit seen < 3}' "$work/table.csv" ||
  fail 'the table counts no pixels'
expect 0 pepeseg render shelf --views frame-000003.jpg --segment 0:1 --without --out "$work/rest"
expect 0 pepeseg export shelf "$work/piece.ply" --segment 0:1
expect 0 pepeseg export shelf "$work/piece.glb" --segment 0:1
[[ $(head -c 4 "$work/piece.glb") == glTF ]] || fail 'a file named .glb is no glTF'
expect 0 pepeseg export shelf "$work/piece.SPZ" --segment 0:1
[[ $(gzip -dc "$work/piece.SPZ" | head -c 4) == NGSP ]] || fail 'a file named .SPZ is no SPZ'
expect 0 pepeseg export shelf "$work/piece.sog" --segment 0:1
[[ $(head -c 2 "$work/piece.sog") == PK ]] || fail 'a file named .sog is no SOG'
expect 0 pepeseg export shelf "$work/piece.html" --segment 0:1
grep -q '<title>shelf</title>' "$work/piece.html" || fail 'a page has another title'
expect 0 pepeseg export shelf "$work/ids.ply" --segment-ids
head -c 2000 "$work/ids.ply" | grep -aq '^property int segment_2$' || fail 'a PLY has no ids of segments'
grep -q '"parent":1' "$work/ids.ply.segments.json" || fail 'the segments of an export have no parents'
expect 4 pepeseg export shelf "$work/ids.json" --segment-ids --format coco
expect 0 pepeseg label shelf book --view frame-000000.jpg --point 280,280 --threshold 0 --text book.3
expect 0 pepeseg export shelf "$work/things.json" --format coco --table "$work/things.csv"
grep -q '"name": "book"' "$work/things.json" || fail 'annotations have no category'
[[ $(head -n 1 "$work/things.csv") == id,parent,name,* ]] || fail 'the table of labels has other columns'
grep -q '^book,[a-z]*,book.3,book,3,' "$work/things.csv" || fail 'the table of labels has no label'
expect 0 pepeseg-benchmark evaluate shelf "$work/things.json"
for file in yolo/labels/frame-000008.txt labelme/frame-000008.json masks/book/frame-000008.png \
  cvat/annotations.xml ids/frame-000008.png; do
  expect 0 pepeseg export shelf "$work/of/${file%%/*}" --format "${file%%/*}" --views held-out
  [[ -s $work/of/$file ]] || fail "export writes no $file"
done
expect 0 pepeseg export shelf "$work/of/cvat.zip" --format cvat --labels book --no-sam-borders
[[ $(head -c 2 "$work/of/cvat.zip") == PK ]] || fail 'a file named .zip is no zip'
[[ $(ls "$work/of") == "$(printf '%s\n' cvat cvat.zip ids labelme masks yolo)" ]] || fail 'an export leaves more'
expect 0 pepeseg export shelf "$work/all.json" --format coco --segments 1 --scales 0.2,0.6 --table "$work/all.csv"
grep -q '^1-1,,' "$work/all.csv" || fail 'the table of segments of a level has none'
grep -q '"label": "1-1"' "$work/all.json" || fail 'segments are no annotations'
expect 3 pepeseg export shelf "$work/none" --format yolo --labels nothing
expect 4 pepeseg export shelf "$work/none" --format yolo --segments 3
expect 4 pepeseg export shelf "$work/none" --format yolo --views nothing.jpg
expect 4 pepeseg export shelf "$work/none.ply" --labels book
expect 0 pepeseg export shelf "$work/odd.glb" --segment 0:1 --format ply
[[ $(head -c 3 "$work/odd.glb") == ply ]] || fail '--format does not decide'
expect 0 pepeseg mesh shelf "$work/mesh.ply" --voxels 64
grep -aq '^element face [1-9]' "$work/mesh.ply" || fail 'a mesh has no faces'
expect 0 pepeseg mesh shelf "$work/mesh.glb" --segment 0:1 --voxels 32 --watertight --triangles 500
[[ $(head -c 4 "$work/mesh.glb") == glTF ]] || fail 'the mesh is not a GLB'
expect 4 pepeseg mesh shelf "$work/none.ply" --segment 0:9999
expect 4 pepeseg export shelf "$work/none.ply" --segment 0:9999
[[ ! -e $work/none.ply && ! -e $work/none.ply.part ]] || fail 'a refused export leaves a file'
expect 0 pepeseg-benchmark evaluate shelf "$dataset/labels" --ignore "$dataset/ignore_mask.png"
grep -Eq '^mean of 4 +[01]\.[0-9]{3} ' "$work/output" || fail 'evaluate prints no scores at a quarter of the size'
cp "$work/output" "$work/refined"
expect 0 pepeseg-benchmark evaluate shelf "$dataset/labels" --ignore "$dataset/ignore_mask.png" --no-refine-borders
if cmp -s "$work/output" "$work/refined"; then fail 'plain borders have the same scores'; fi
expect 4 pepeseg-benchmark evaluate shelf "$dataset/labels" --frame view
grep -q '640x480.*has 160x120' "$work/errors" || fail 'labels of another size are not refused'
expect 3 pepeseg-benchmark evaluate shelf "$dataset/images"
mkdir "$work/folder"
expect 4 pepeseg export shelf "$work/folder"
grep -q "$work/folder: Is a directory" "$work/errors" || fail 'the error of the system is not reported'
expect 3 pepeseg export shelf "$work/server.log/below/x.ply"
expect 0 pepeseg export shelf "$work/made/for/it.ply"
expect 0 pepeseg export shelf "$work/shelf.ply"
[[ $(head -c 3 "$work/shelf.ply") == ply ]] || fail 'the export is not a PLY'

mkdir "$work/given"
cp -r "$dataset"/{images,sparse,masks,ignore_mask.png} "$work/given"
cp "$work/shelf.ply" "$work/given/gaussians.ply"
expect 0 pepeseg upload given "$work/given"
expect 0 pepeseg train given --feature-steps 30 -o features.num_pixels=200
grep -q 'reconstruct skipped: given' "$work/errors" || fail 'given Gaussians are not used'
echo '{"48": "chenille stems"}' >"$work/names.json"
expect 0 pepeseg-benchmark evaluate given "$dataset/labels" --ignore "$dataset/ignore_mask.png" \
  --names "$work/names.json"
grep -Eq '^chenille stems +1 +[01]\.[0-9]{3} ' "$work/output" || fail 'evaluate prints no scores of an entity'
grep -Eq '^mean of 4 +[01]\.[0-9]{3} ' "$work/output" || fail 'evaluate prints no mean score'
expect 0 pepeseg-benchmark --json evaluate given "$dataset/labels"
grep -q '"boundary_iou":' "$work/output" || fail 'evaluate prints no JSON'
expect 0 pepeseg-benchmark evaluate given given/1 "$dataset/labels" --ignore "$dataset/ignore_mask.png"
grep -Eq '^standard deviation +0\.000 ' "$work/output" || fail 'one model twice has a deviation'
expect 0 pepeseg-benchmark evaluate given "$dataset/labels" --protocol clicks --max-clicks 3
grep -Eq '^mean of 4 +[1-3]\.[0-9]{2} ' "$work/output" || fail 'evaluate counts no clicks'
expect 0 pepeseg-benchmark evaluate given "$dataset/labels" --names "$work/names.json" --ignore-label 48
grep -Eq '^[0-9]+ void pixels of the label images were left out' "$work/output" ||
  fail 'evaluate does not say how many void pixels were left out'
! grep -q '^chenille stems' "$work/output" || fail 'an ignored label is scored'
for protocol in label-propagation label-propagation-pixels promptable; do
  expect 0 pepeseg-benchmark evaluate given "$dataset/labels" --protocol $protocol --reference frame-000000.jpg
  grep -Eq '^mean of 4 +[01]\.[0-9]{3} ' "$work/output" || fail "evaluate scores nothing by $protocol"
done
mkdir -p "$work/masks/frame-000008"
cp "$dataset/ignore_mask.png" "$work/masks/frame-000008/border.png"
expect 0 pepeseg-benchmark evaluate given "$work/masks" --prompt border@frame-000000.jpg:points:440,280
grep -Eq '^border +1 +- ' "$work/output" || fail 'a choice is made on a reference without truth'
expect 0 pepeseg-benchmark evaluate given "$work/masks" --protocol sam-agreement
grep -Eq '^all masks +1 ' "$work/output" || fail 'evaluate does not compare with masks of SAM'

expect 0 pepeseg-benchmark curves "$dataset" --out "$work/bench" --presets none --steps 40 --seeds 1 \
  --image-scale 0.25 -o features.num_pixels=200
for wanted in '"psnr": [0-9]' '"miou": [0-9]' '"core_seconds": ' '"name": "40 steps"'; do
  grep -q "$wanted" "$work/bench/record.json" || fail "the record of bench has no $wanted"
done

expect 0 pepeseg models given 1 --delete
expect 3 pepeseg models given 1

job=$(pepeseg train shelf --steps 30000 --detach)
expect 6 pepeseg train shelf --detach
expect 0 pepeseg cancel "$job"
expect 8 pepeseg watch "$job"
grep -Eq "$job was cancelled( in stage [a-z]+)?$" "$work/errors" || fail 'watch does not report the cancelled job'

kill -TERM "$server"
code=0
wait "$server" || code=$?
server=
((code == 0)) || fail "the server ended with exit code $code"
expect 5 pepeseg scenes
echo 'every step as expected'
