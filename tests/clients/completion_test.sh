#!/usr/bin/env bash
# Checks the completions of `pepeseg completion bash` as an interactive bash requests them, and the
# syntax of the script for zsh if zsh is installed.
#   completion_test.sh PEPESEG
set -euo pipefail
pepeseg=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

"$pepeseg" completion bash >"$work/completion.bash"
# shellcheck source=/dev/null
source "$work/completion.bash"
cd "$work"
: >photo.jpg

complete_line() {  # complete_line WORD...: prints the completions of the last word, one a line
  COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
  _pepeseg
  printf '%s\n' "${COMPREPLY[@]}"
}
# Without -q, grep reads all lines: with it, it would end at the first match and break the pipe.
expect() {  # expect WANTED WORD...: checks that WANTED is a completion
  complete_line "${@:2}" | grep -xF -- "$1" >/dev/null || fail "no $1 after: ${*:2}"
}
refuse() {  # refuse UNWANTED WORD...: checks that UNWANTED is not a completion
  ! complete_line "${@:2}" | grep -xF -- "$1" >/dev/null || fail "$1 after: ${*:2}"
}

for verb in upload train segment models completion; do expect "$verb" pepeseg ''; done
expect train pepeseg tr
refuse upload pepeseg tr
expect --preset pepeseg train shelf --pre
expect preview pepeseg train shelf --preset ''
expect best pepeseg train shelf --preset b
refuse preview pepeseg train shelf --preset b
# The names of options are the server's.
mkdir bin
printf '#!/bin/sh\necho "$*" >>asked\necho "OPTION  DEFAULT"\necho "reconstruct.num_steps  10000"\necho "    Number of steps."\n' >bin/pepeseg
chmod +x bin/pepeseg
PATH=$work/bin:$PATH expect reconstruct.num_steps= pepeseg train shelf -o recon
grep -qx -- 'train --list-options' asked || fail 'the options were not asked for'
for line in 'pepeseg --server host:1 train shelf -o recon' 'pepeseg train shelf --server=host:1 -o recon'; do
  rm asked
  # Bash splits words at ":" and "=".
  read -ra parts <<<"$(sed 's/[:=]/ & /g' <<<"$line")"
  COMP_LINE=$line PATH=$work/bin:$PATH expect reconstruct.num_steps= "${parts[@]}"
  grep -qx -- '--server host:1 train --list-options' asked || fail "another server was asked: $line"
done
expect --point pepeseg segment shelf --po
expect --server pepeseg segment shelf --ser
expect depth pepeseg --server host:1 render shelf --content d
expect recolor pepeseg edit shelf ''
expect --rotate pepeseg edit shelf move --selection 1 --ro
expect zsh pepeseg completion ''
expect photograph pepeseg segment shelf --frame ph
expect yolo pepeseg export shelf out --format ''
# Only names are offered, never what a choice is stored as, and each is accepted.
if grep -E "values='[^']*->" "$work/completion.bash"; then fail 'a choice is completed with its number'; fi
while read -r verb option value; do
  "$pepeseg" "$verb" "$option" "$value" 2>&1 | grep -F "$value not in" && fail "$verb $option refuses $value"
done < <(sed -n "s/^    \([a-z-]*\):\(--[a-z-]*\)) values='\([^']*\)'.*/\1 \2 \3/p" "$work/completion.bash" |
  awk '{for (i = 3; i <= NF; ++i) print $1, $2, $i}')
expect photo.jpg pepeseg upload shelf ph
# Every verb of --help is completed.
for verb in $("$pepeseg" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]\+\) .*/\1/p'); do
  expect "$verb" pepeseg ''
done

"$pepeseg" completion zsh >"$work/_pepeseg"
head -1 "$work/_pepeseg" | grep -qx '#compdef pepeseg' || fail 'the zsh script has no #compdef'
if command -v zsh >/dev/null; then
  for case in 'tr train' 'train shelf --preset b best' 'segment shelf --po --point'; do
    read -ra parts <<<"pepeseg $case"
    # As zsh's bashcompinit calls the function.
    zsh -fc 'autoload -U compinit && compinit -u -d "$1/dump" && source "$1/_pepeseg" || exit 1
      shift
      as_zsh_does() {
        emulate -L sh
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMPREPLY=()
        _pepeseg
        printf "%s\n" "${COMPREPLY[@]}"
      }
      as_zsh_does "$@"' zsh "$work" "${parts[@]:0:${#parts[@]}-1}" | grep -xF -- "${parts[-1]}" >/dev/null ||
      fail "zsh: no ${parts[-1]} after: $case"
  done
fi
code=0
"$pepeseg" completion fish >/dev/null 2>&1 || code=$?
((code == 2)) || fail "an unknown shell is not refused: exit code $code"
echo 'every completion as expected'
