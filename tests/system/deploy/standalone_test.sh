#!/usr/bin/env bash
# Tests the systemd unit: systemd verifies it, its exposure is low, and it allows the system calls of
# the workers' sandbox.
#   standalone_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT
# Exits with 77 if systemd's programs are not installed.
set -euo pipefail
programs=$1 root=$2
command -v systemd-analyze >/dev/null || { echo 'skipped: no systemd-analyze'; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

build=$(realpath "$programs/..")
DESTDIR=$work/root "$root/deploy/standalone/install.sh" "$build" --gpu >/dev/null
for file in usr/bin/pepesegd usr/lib/pepeseg/video.so usr/lib/sysusers.d/pepeseg.conf etc/pepeseg/pepesegd.conf \
  usr/lib/systemd/system/pepesegd.service.d/gpu.conf; do
  [[ -s $work/root/$file ]] || fail "install.sh leaves no $file"
done
echo 'PEPESEGD_OPTIONS=--mine' >"$work/root/etc/pepeseg/pepesegd.conf"
DESTDIR=$work/root "$root/deploy/standalone/install.sh" "$build" >/dev/null
grep -q -- --mine "$work/root/etc/pepeseg/pepesegd.conf" || fail 'install.sh overwrites the settings'

# With the program's present path, so that its existence is checked, too.
install -D -m 755 "$root/deploy/standalone/pepeseg-web" "$work/root/usr/bin/pepeseg-web"
for name in pepesegd pepeseg-web; do
  unit=$work/$name.service
  sed "s|^ExecStart=/usr/bin/|ExecStart=$work/root/usr/bin/|" "$root/deploy/standalone/$name.service" >"$unit"
  said=$(systemd-analyze verify --man=no "$unit" 2>&1 | grep -F "$name" || true)
  [[ -z $said ]] || fail "systemd says: $said"
  exposure=$(systemd-analyze security --offline=true --no-pager "$unit" |
    sed -n 's/.*exposure level.*: \([0-9.]*\) .*/\1/p')
  awk -v e="$exposure" 'BEGIN {exit !(e != "" && e <= 1.5)}' || fail "the exposure of $name is $exposure"
  echo "$name: exposure $exposure"
done
unit=$work/pepesegd.service
for call in seccomp landlock_create_ruleset landlock_add_rule landlock_restrict_self; do
  grep -q "^SystemCallFilter=.*\b$call\b" "$unit" || fail "the unit does not let $call through"
done
# The program accepts the settings that come with the unit.
options=$(sed -n 's/^PEPESEGD_OPTIONS=//p' "$root/deploy/standalone/pepesegd.conf")
"$programs/pepesegd" --data "$work/data" $options --help >/dev/null || fail "no such options: $options"
