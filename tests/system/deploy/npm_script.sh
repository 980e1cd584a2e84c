# To be sourced by the tests of scripts that install files of npm packages, as $root/deploy/$script.
# A script replaces npm, so that they need no network. Sets $work, which is removed at the end.
# shellcheck shell=bash
: "${root:?the source root}" "${script:?the script}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; cat "$work/output" >&2; exit 1; }
# expect EXIT_CODE WORDS ARGUMENTS...: runs the script with programs from $work/bin only
expect() {
  local code=0 words=$2
  PATH=$work/bin "$work/bin/bash" "$root/deploy/$script" "${@:3}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:3}: exit code $code, not $1"
  grep -qF -- "$words" "$work/output" || fail "${*:3}: does not say: $words"
}
# npm COMMAND: makes npm a script of one command
npm() { printf '#!/bin/bash\n%s\n' "$1" >"$work/bin/npm"; chmod 755 "$work/bin/npm"; }
# package_of FILE...: makes $work/package.tgz of files with these names and wrong bytes, all that npm
# gets. More files join those of before.
package_of() {
  local file
  for file in "$@"; do
    mkdir -p "$work/package/$(dirname "$file")"
    echo "another $file" >"$work/package/$file"
  done
  tar -czf "$work/package.tgz" -C "$work" package
  npm "[[ \$* == *--ignore-scripts* ]] && exec $(command -v cp) $work/package.tgz ."
}

mkdir "$work/bin"
for program in bash uname sed sha256sum mkdir mktemp rm mv tar gzip chmod cat cp dirname readlink; do
  ln -s "$(command -v "$program")" "$work/bin/$program"
done
export HOME=$work/home
