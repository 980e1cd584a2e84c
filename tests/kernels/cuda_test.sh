#!/usr/bin/env bash
# Runs every test of CUDA on this machine's GPU, then the kernels' tests under compute-sanitizer, and
# writes a summary that is committed with the code it was run on.
#   cuda_test.sh BUILD SUMMARY [COMMIT]
# BUILD has the programs in bin/; logs go to BUILD/cuda-test. COMMIT: by default that of the checkout.
# Exits with 1 if a test failed or was skipped, or if a sanitizer found anything. About 6 minutes.
set -euo pipefail
if (($# < 2)); then
  echo "usage: $0 BUILD SUMMARY [COMMIT]" >&2
  exit 2
fi
build=$1 summary=$2
commit=${3:-$(git rev-parse --short HEAD)$(git diff --quiet HEAD || echo ' with changes')}
logs=$build/cuda-test
kernels=(kernels_render_test kernels_image_loss_test kernels_depth_loss_test kernels_refine_test
  kernels_features_test kernels_cluster_test)
others=(core_features_test stress_numerics_test)
# Whole trainings and images of a megapixel take minutes under a sanitizer, trees of 16,384 points
# take minutes under racecheck, and none of them runs another kernel.
declare -A long=([memcheck]='*Train*:*Megapixel*:*LongRuns*')
long[racecheck]=${long[memcheck]}:CudaSpanningTreeTest.IsTheCpus

mkdir -p "$logs" "$(dirname "$summary")"
failed=0

# Runs a command into a log and adds a line to the summary: its name, tests passed, seconds.
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
