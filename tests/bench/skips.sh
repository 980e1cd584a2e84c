#!/usr/bin/env bash
# What is left out where a scene does not need it (SceneNeeds, FeatureStage): both stages with all of
# it on, each alone off, and all off; means over the seeds, by level of the ground truth.
#   skips.sh BENCH PACK [FLAG]...    BENCH: pepeseg_segment_bench; FLAGs go to every run: --device
#                                    cuda, --seeds 3
# of a pack without ground truth, stage one alone:
#   skips.sh pepeseg_curve_bench PACK [FLAG]...
set -euo pipefail
bench=$1 pack=$2
shift 2
common=("$@")

# A row for each level: mean and spread of its scores, times and PSNR; below it what was skipped.
segment_row() {
  "$bench" "$pack" --rows-only "${common[@]}" "${@:2}" | awk -F'|' -v name="$1" '
    function spread(key) { return sprintf("%.2f (%.2f to %.2f)", sum[key] / runs[key], least[key], most[key]) }
    function add(key, value) {
      if (!(key in runs) || value < least[key]) least[key] = value
      if (!(key in runs) || value > most[key]) most[key] = value
      ++runs[key]; sum[key] += value
    }
    /^# / { print > "/dev/stderr"; next }
    $5 + 0 > 0 {
      if (!(("iou", $4) in runs)) order[++levels] = $4
      add("iou" SUBSEP $4, 100 * $6)
      add("one" SUBSEP $4, $(NF - 5)); add("two" SUBSEP $4, $(NF - 4)); add("psnr" SUBSEP $4, $(NF - 1))
    }
    END {
      for (i = 1; i <= levels; ++i) {
        level = order[i]
        printf "| %s |%s| %s | %s | %s | %s |\n", name, level, spread("psnr" SUBSEP level),
          spread("iou" SUBSEP level), spread("one" SUBSEP level), spread("two" SUBSEP level)
      }
    }'
}

# The last row of each seed is the end of its run.
curve_row() {
  "$bench" "$pack" --scores 1 "${common[@]}" "${@:2}" | awk -F'|' -v name="$1" '
    function add(key, value) {
      if (!(key in runs) || value < least[key]) least[key] = value
      if (!(key in runs) || value > most[key]) most[key] = value
      ++runs[key]; sum[key] += value
    }
    function spread(key) { return sprintf("%.2f (%.2f to %.2f)", sum[key] / runs[key], least[key], most[key]) }
    /^# / { print > "/dev/stderr"; next }
    $4 + 0 > 0 { add("psnr", $7); add("one", $5) }
    END { printf "| %s | - | %s | - | %s | - |\n", name, spread("psnr"), spread("one") }'
}

row() {
  case $(basename "$bench") in
    pepeseg_curve_bench) curve_row "$@" ;;
    *) segment_row "$@" "${two[@]}" ;;
  esac
}

echo '| | level | PSNR | mIoU | stage one s | stage two s |'
echo '|---|---|---|---|---|---|'
two=()
row 'all on'
row 'steps of stage one' --min-loss-fall 0
row 'bands' --min-band-gain 0
row 'depth' --min-depth-agreement 0
two=(--feature-loss-fall 0)
[[ $(basename "$bench") == pepeseg_curve_bench ]] || row 'steps of stage two'
row 'all off' --min-loss-fall 0 --min-band-gain 0 --min-depth-agreement 0
