#!/usr/bin/env bash
# Layers, folders, citations and words, clang-format, headers that compile alone, clang-tidy, mypy.
#   lint.sh BUILD_FOLDER JOBS
# A file that clang-tidy passed is looked at again when its preprocessed text, its compiler flags or
# the checks have changed: BUILD_FOLDER/lint has what it passed with.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$1 jobs=$2

tidy() {
  local build=$1 file=$2 stamp command key
  stamp=$build/lint/${file//\//.}
  command=$(jq -r --arg file "$PWD/$file" 'map(select(.file == $file))[0].command' \
    "$build/compile_commands.json")
  command=$(sed -E 's/ -MD -MT [^ ]+ -MF [^ ]+//; s/ -o [^ ]+//; s/^[^ ]*ccache //' <<<"$command")
  key=$( (cat .clang-tidy; clang-tidy --version; echo "$command"; cd "$build"; eval "$command -E") |
    sha256sum)
  [[ -f $stamp && $(<"$stamp") == "$key" ]] && return
  echo "$file"
  clang-tidy --quiet --extra-arg=-Wno-unknown-warning-option -p "$build" "$file" \
    2> >(grep -v ' warnings generated' >&2)
  echo "$key" >"$stamp"
}
export -f tidy

tests/layering/check_layers.sh .
tests/layering/check_folders.py .
tests/layering/check_citations.py .
tests/layering/check_words.py .
mapfile -t files < <(find clients core kernels server tests -name '*.h' -o -name '*.cc' | sort)
clang-format --dry-run -Werror "${files[@]}"
cmake --build "$build" -j "$jobs" --target lone_headers
mkdir -p "$build/lint"
printf '%s\n' "${files[@]}" | grep '\.cc$' |
  xargs -P "$jobs" -I{} bash -euo pipefail -c 'tidy "$@"' tidy "$build" {}
cache=$(realpath -m "$build/lint/mypy")
(cd clients/python/pepeseg && mypy --cache-dir "$cache")
echo 'lint: clean'
