#!/usr/bin/env bash
# Runs the CUDA tests of the programs below on this machine's GPU, then those of the kernels under
# compute-sanitizer, and writes a summary, which is committed with the tested code.
#   cuda_test.sh BUILD SUMMARY [COMMIT]
# BUILD has the programs in bin/; logs are written to BUILD/cuda-test. COMMIT defaults to that of
# the checkout. Exits with 1 if a test failed or was skipped, or if a sanitizer found anything.
# Takes about 6 minutes.
set -euo pipefail
if (($# < 2)); then
  echo "usage: $0 BUILD SUMMARY [COMMIT]" >&2
  exit 2
fi
build=$1 summary=$2
commit=${3:-$(git rev-parse --short HEAD)$(git diff --quiet HEAD || echo ' with changes')}
logs=$build/cuda-test
kernels=(kernels_render_test kernels_image_loss_test kernels_depth_loss_test kernels_refine_test
  kernels_features_test kernels_cluster_test kernels_network_test kernels_match_test
  kernels_sift_test kernels_prompt_network_test kernels_cell_masks_test)
others=(core_features_test core_sam_encoder_test stress_numerics_test)
# Tests left out under each sanitizer. Whole trainings and images of a megapixel take minutes under
# both, trees of 16,384 points take minutes under racecheck, and none of them runs a kernel that no
# other test runs.
declare -A long=([memcheck]='*Train*:*Megapixel*:*LongRuns*')
long[racecheck]=${long[memcheck]}:CudaSpanningTreeTest.MatchesTheCpu

mkdir -p "$logs" "$(dirname "$summary")"
failed=0

# measure NAME LOG COMMAND...: runs a command with its output in LOG.log and adds a line to the
# summary: name, result, tests passed, seconds.
# shellcheck disable=SC2317
measure() {
  local name=$1 log=$logs/$2.log start=$SECONDS status=passed
  shift 2
  PEPESEG_REQUIRE_CUDA=1 "$@" >"$log" 2>&1 || status=FAILED
  local passed skipped found
  passed=$(sed -n 's/^\[  PASSED  \] \([0-9]*\) test.*/\1/p' "$log")
  skipped=$(sed -n 's/^\[  SKIPPED \] \([0-9]*\) test.*/\1/p' "$log")
  found=$(sed -n 's/^========= \(.* SUMMARY: .*\)/, \1/p' "$log")
  [[ ${passed:-0} -gt 0 && -z $skipped ]] || status=FAILED
  [[ $status == passed ]] || failed=1
  echo "| $name | $status | ${passed:-0}${skipped:+, $skipped skipped}$found | $((SECONDS - start)) |" |
    tee -a "$summary"
}

{
  echo '# Tests of CUDA'
  echo
  echo "Commit $commit, $(date -u +%F), $(nvidia-smi --query-gpu=name,driver_version --format=csv,noheader),"
  echo "$(nvcc --version | sed -n 's/.*release \([^,]*\),.*/CUDA \1/p'). Written by \`make cuda-test\`."
  echo
  echo '| program | | tests passed | seconds |'
  echo '|---|---|---|---|'
} >"$summary"
for program in "${kernels[@]}" "${others[@]}"; do
  measure "$program" "$program" "$build/bin/$program" --gtest_filter='*Cuda*'
done
for tool in memcheck racecheck; do
  for program in "${kernels[@]}"; do
    measure "$tool $program" "$tool-$program" compute-sanitizer --tool "$tool" --error-exitcode 1 \
      "$build/bin/$program" --gtest_filter="*Cuda*:-${long[$tool]}"
  done
done
exit "$failed"
