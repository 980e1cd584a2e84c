#!/usr/bin/env bash
# Measures each term of both stages on a capture pack (the paper's ablations), and runs with a quarter
# of the views or 30 % fewer masks. Prints one table of means over the seeds of stage two.
#   ablation.sh BENCH PACK [FLAG]...       FLAGs go to every run, such as --device cuda --seeds 3
set -euo pipefail
bench=$1 pack=$2
shift 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Prints the means over the rows of each level.
means() {
  awk -F'|' -v name="$1" '
    $5 + 0 > 0 {
      if (!($4 in runs)) order[++levels] = $4
      ++runs[$4]
      for (k = 6; k <= 9; ++k) sum[$4, k] += 100 * $k
      for (k = 6; k <= NF; ++k) last[k] = $k
      seconds[$4] += $(NF - 10); gaussians = $(NF - 8); psnr = $(NF - 7)
    }
    END {
      for (i = 1; i <= levels; ++i) {
        level = order[i]
        printf "| %s |%s| %.1f / %.1f | %.1f / %.1f | %.2f |%s|%s|\n", name, level,
          sum[level, 6] / runs[level], sum[level, 7] / runs[level], sum[level, 8] / runs[level],
          sum[level, 9] / runs[level], seconds[level] / runs[level], gaussians, psnr
      }
    }'
}

# row NAME GEOMETRY FLAG...: the first row that names a geometry trains it.
row() {
  local name=$1 geometry=$2
  shift 2
  "$bench" "$pack" --rows-only --gaussians "$folder/$geometry.ply" "${common[@]}" "$@" |
    means "$name"
}

common=("$@")
stage_one=(-o reconstruct.depth_weight=-1 -o reconstruct.refine_keep=shrink)
centroids=(-o features.centroid_weight_upper=0 -o features.centroid_weight_lower=0)
perception=(-o features.perception_weight=0)
masks=("${perception[@]}" "${centroids[@]}" -o features.num_background_pixels=0)

echo '| | level | mIoU / mBIoU | oracle | stage two s | Gaussians | PSNR |'
echo '|---|---|---|---|---|---|---|'
row 'masks only' plain "${masks[@]}"
row '+ background' plain "${centroids[@]}" "${perception[@]}"
row '+ perception' plain "${centroids[@]}"
row '+ centroids: all by default' plain
row 'all, depth and refinement in stage one' pepe "${stage_one[@]}"
row 'all, perception without other views' plain -o features.perception_cross_view=false
row 'all, masks not completed' plain -o features.complete_masks=false
row 'all, each mask its own scale' plain -o features.share_scales=false
row '1/4 of the views, masks only' plain4 --keep-views 0.25 "${masks[@]}"
row '1/4 of the views, all' plain4 --keep-views 0.25
row '1/4 of the views, all, depth and refinement' pepe4 --keep-views 0.25 "${stage_one[@]}"
row '30 % fewer masks, masks only' plain --keep-masks 0.7 "${masks[@]}"
row '30 % fewer masks, all' plain --keep-masks 0.7
row '30 % fewer masks, not completed' plain --keep-masks 0.7 -o features.complete_masks=false
