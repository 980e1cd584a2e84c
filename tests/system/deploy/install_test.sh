#!/usr/bin/env bash
# Tests `cmake --install`: what is installed is complete, runs from a folder to which it was moved, finds
# its worker and its modules there, and has manual pages that name every option.
#   install_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
set -euo pipefail
build=$(realpath "$1/..") root=$2
tree=$(mktemp -d)
clean() { rm -rf "$tree"; }
trap clean EXIT
for component in server client; do
  cmake --install "$build" --prefix "$tree/first" --component "$component" >"$tree/log" ||
    { cat "$tree/log" >&2; exit 1; }
done
mv "$tree/first" "$tree/moved"
installed=$tree/moved
for file in etc/pepeseg/pepesegd.conf lib/systemd/system/pepesegd.service lib/sysusers.d/pepeseg.conf \
  lib/tmpfiles.d/pepeseg.conf share/pepeseg/proto/pepeseg/v1/scene_service.proto \
  share/pepeseg/deploy/sam.sh share/bash-completion/completions/pepeseg \
  share/zsh/site-functions/_pepeseg share/man/man1/{pepesegd,pepeseg,pepeseg-worker}.1; do
  [[ -s $installed/$file ]] || { echo "FAILED: no $file" >&2; exit 1; }
done

programs=$installed/bin
# The worker and the modules of the build are out of the reach of these programs: nothing but the
# folder of the program leads to them.
# shellcheck source=tests/clients/with_server.sh
source "$root/tests/clients/with_server.sh"
trap 'stop; clean' EXIT
version=$(sed -n 's/^project(pepeseg VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
[[ $("$programs/pepesegd" --version) == "pepesegd $version" ]] || fail 'the version of pepesegd'
[[ $("$programs/pepeseg" --version) == "pepeseg $version" ]] || fail 'the version of pepeseg'
"$programs/pepeseg-worker" --help | grep -q -- --job=FOLDER || fail 'the help of pepeseg-worker'
! readelf -d "$programs"/* "$installed"/lib/pepeseg/*.so | grep -E 'R(UN)?PATH' ||
  fail 'a program looks for libraries in a folder of the build'

# A video that is none: with the module it is the file that is refused, without it the module is missing.
mkdir "$work/scene"
{ printf '\0\0\0\030ftypisom'; head -c 4096 /dev/zero; } >"$work/scene/walk.mp4"
expect 0 pepeseg upload walk "$work/scene/walk.mp4"
expect 7 pepeseg train walk --preset preview
! grep -F 'the module video' "$work/errors" || fail 'the module video is not found'
mv "$installed/lib/pepeseg/video.so" "$work/"
expect 7 pepeseg train walk --preset preview
grep -qF 'the module video cannot be loaded' "$work/errors" || fail 'the module video is not needed'
# A folder in which no PostgreSQL listens.
without() {
  ! "$programs/pepesegd" --listen 127.0.0.1:0 --data "$work/other" \
    --database "postgresql:host=$work dbname=none" >"$work/output" 2>&1 || fail 'a database that is not there'
}
without
! grep -F 'the module postgresql' "$work/output" || fail 'the module postgresql is not found'
mv "$installed/lib/pepeseg/postgresql.so" "$work/"
without
grep -qF 'the module postgresql cannot be loaded' "$work/output" || fail 'the module postgresql is not needed'

# Paths of the unit are those of the prefix; settings that are there stay.
unit=$installed/lib/systemd/system/pepesegd.service
grep -qxF "EnvironmentFile=$tree/first/etc/pepeseg/pepesegd.conf" "$unit" || fail 'the settings of the unit'
grep -q "^ExecStart=$tree/first/bin/pepesegd " "$unit" || fail 'the program of the unit'
echo 'PEPESEGD_OPTIONS=--mine' >"$installed/etc/pepeseg/pepesegd.conf"
cmake --install "$build" --prefix "$installed" --component server >"$tree/log"
grep -q -- --mine "$installed/etc/pepeseg/pepesegd.conf" || fail 'an installation overwrites the settings'

# Manual pages: the sections, every option and verb, and no warning of man.
for page in pepesegd pepeseg pepeseg-worker pepeseg-web; do
  file=$build/share/man/man1/$page.1
  for section in NAME SYNOPSIS DESCRIPTION OPTIONS 'EXIT STATUS' FILES; do
    grep -qx ".SH $section" "$file" || fail "$page.1 has no section $section"
  done
  ! grep -nE '@[A-Z_]+@|'"$build" "$file" || fail "$page.1 has what belongs to the build"
  if command -v man >/dev/null; then
    said=$(MANWIDTH=100 LC_ALL=C.UTF-8 man --warnings -E UTF-8 -l "$file" 2>&1 >/dev/null)
    [[ -z $said ]] || fail "man says of $page.1: $said"
  fi
done
sed 's/\\-/-/g; s/\\f[BR]//g' "$build"/share/man/man1/*.1 >"$work/pages"
for option in $({ "$programs/pepesegd" --help; "$programs/pepeseg" --help; "$programs/pepeseg" segment --help; } |
  sed -nE 's/^ +(-[a-z],)?(--[a-z-]+).*/\2/p' | sort -u); do
  grep -qE -- "^(-[a-z], )?$option( |,|$)" "$work/pages" || fail "no manual page has $option"
done
for verb in $("$programs/pepeseg" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]\+\) .*/\1/p'); do
  grep -qE -- "^.SS \"pepeseg $verb[ \"]" "$work/pages" || fail "pepeseg.1 does not have $verb"
done

# Completions, as a shell loads them.
bash -c 'source "$1" && complete -p pepeseg' bash "$installed/share/bash-completion/completions/pepeseg" |
  grep -q ' -F _pepeseg' || fail 'the completion of bash'
head -n 1 "$installed/share/zsh/site-functions/_pepeseg" | grep -qx '#compdef pepeseg' ||
  fail 'the completion of zsh'
echo 'installed, moved and run'
