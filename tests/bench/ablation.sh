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
plain=(--depth-weight 0 --refine-keep 1)
masks=(--perception-weight 0 --centroid-upper 0 --centroid-lower 0 --background-pixels 0)
centroids=(--centroid-upper 0 --centroid-lower 0)

echo '| | level | mIoU / mBIoU | oracle | stage two s | Gaussians | PSNR |'
echo '|---|---|---|---|---|---|---|'
row 'masks only' plain "${plain[@]}" "${masks[@]}"
row '+ depth and refinement in stage one' pepe "${masks[@]}"
row '+ background' pepe "${centroids[@]}" --perception-weight 0
row '+ perception' pepe "${centroids[@]}"
row '+ centroids: all' pepe
row 'all, perception without other views' pepe --no-cross-view
row 'all, masks not completed' pepe --complete-masks 0
row '1/4 of the views, masks only' plain4 --keep-views 0.25 "${plain[@]}" "${masks[@]}"
row '1/4 of the views, all' pepe4 --keep-views 0.25
row '30 % fewer masks, masks only' plain --keep-masks 0.7 "${plain[@]}" "${masks[@]}"
row '30 % fewer masks, all' pepe_fewer --keep-masks 0.7
row '30 % fewer masks, not completed' pepe_fewer --keep-masks 0.7 --complete-masks 0
