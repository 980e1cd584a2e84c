#!/usr/bin/env bash
# clang-format, headers that compile alone, clang-tidy.   lint.sh BUILD_FOLDER JOBS
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$1 jobs=$2

mapfile -t files < <(find clients core kernels server tests -name '*.h' -o -name '*.cc' | sort)
clang-format --dry-run -Werror "${files[@]}"
cmake --build "$build" -j "$jobs" --target lone_headers
printf '%s\n' "${files[@]}" | grep '\.cc$' |
  xargs -P "$jobs" -n 4 clang-tidy --quiet --extra-arg=-Wno-unknown-warning-option -p "$build" 2> >(grep -v ' warnings generated' >&2)
echo 'lint: clean'
