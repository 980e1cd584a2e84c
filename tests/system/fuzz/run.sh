#!/usr/bin/env bash
# run.sh BUILD SECONDS [TARGET...]: runs each fuzz target for SECONDS from its corpus. New inputs go to
# BUILD/fuzz/TARGET, from which the next run starts; inputs that failed go to BUILD/fuzz/found. Prints a
# table.
set -uo pipefail
build=$(realpath "$1")
seconds=$2
shift 2
here=$(dirname "$(realpath "$0")")
export TMPDIR=${TMPDIR:-/tmp}
# Debian's gRPC, Protobuf and Abseil are not instrumented: instrumented code would report an overflow in
# a container that they have grown.
export ASAN_OPTIONS=detect_container_overflow=0:allocator_may_return_null=1
export UBSAN_OPTIONS=print_stacktrace=1
found=$build/fuzz/found
mkdir -p "$found"
(($#)) || set -- $(cd "$build/bin" && ls -- *_fuzz | sed 's/_fuzz$//')
failed=()
printf '%-20s %12s %8s %8s %8s\n' target executions seconds edges peak_MiB
for target; do
  mkdir -p "$build/fuzz/$target"
  log=$build/fuzz/$target.log
  start=$(date +%s)
  "$build/bin/${target}_fuzz" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 \
    -print_final_stats=1 -artifact_prefix="$found/$target-" \
    "$build/fuzz/$target" "$here/corpus/$target" >"$log" 2>&1 || failed+=("$target")
  printf '%-20s %12s %8s %8s %8s\n' "$target" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")" $(($(date +%s) - start)) \
    "$(grep -o 'cov: [0-9]*' "$log" | tail -n 1 | cut -d' ' -f2)" \
    "$(sed -n 's/^stat::peak_rss_mb: *//p' "$log")"
done
((${#failed[@]})) || exit 0
for target in "${failed[@]}"; do
  echo "FAILED: $target" >&2
  grep -m 1 -A 12 -E 'ERROR:|runtime error:|fuzz target: expected' "$build/fuzz/$target.log" >&2
done
echo "The inputs are in $found: mend what they show, and keep each in tests/system/fuzz/corpus/TARGET" >&2
exit 1
