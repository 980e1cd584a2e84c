#!/usr/bin/env bash
# Installs what `make build` has built, for systemd: programs, modules, unit, user, folders. Run it again to
# update the programs; it does not change an existing /etc/pepeseg.
#   install.sh BUILD_FOLDER [--gpu]
# With DESTDIR=FOLDER it only copies below FOLDER, for a package. The libraries are those of
# deploy/packages/build.txt.
set -euo pipefail
usage() {
  sed -n '4,6s/^# \{0,1\}//p' "$0" >&2
  exit 2
}
[[ $# -ge 1 && $# -le 2 && $1 != -* && ${2:---gpu} == --gpu ]] || usage
build=$(realpath "$1")
gpu=${2:-}
to=${DESTDIR:-}
cd "$(dirname "$0")"
for program in pepesegd pepeseg-worker pepeseg; do
  [[ -x $build/bin/$program ]] || { echo "$build/bin/$program: not built" >&2; exit 1; }
done
for module in video postgresql; do
  [[ -e $build/lib/pepeseg/$module.so ]] || { echo "$build/lib/pepeseg/$module.so: not built" >&2; exit 1; }
done
[[ -n $to || $EUID == 0 ]] || { echo 'install.sh: as root, or with DESTDIR' >&2; exit 1; }

install -d "$to"/usr/{bin,lib/pepeseg,lib/systemd/system,lib/sysusers.d,lib/tmpfiles.d} "$to/etc/pepeseg"
# Copies next to the old programs, which may be running, then replaces them.
for program in pepesegd pepeseg-worker pepeseg; do
  install -m 755 --strip "$build/bin/$program" "$to/usr/bin/.$program.new"
  mv "$to/usr/bin/.$program.new" "$to/usr/bin/$program"
done
for module in video postgresql; do
  install -m 644 --strip "$build/lib/pepeseg/$module.so" "$to/usr/lib/pepeseg/.$module.new"
  mv "$to/usr/lib/pepeseg/.$module.new" "$to/usr/lib/pepeseg/$module.so"
done
install -m 644 pepesegd.service "$to/usr/lib/systemd/system/"
if [[ -n $gpu ]]; then
  install -D -m 644 gpu.conf "$to/usr/lib/systemd/system/pepesegd.service.d/gpu.conf"
fi
install -m 644 sysusers.conf "$to/usr/lib/sysusers.d/pepeseg.conf"
install -m 644 tmpfiles.conf "$to/usr/lib/tmpfiles.d/pepeseg.conf"
[[ -e $to/etc/pepeseg/pepesegd.conf ]] || install -m 644 pepesegd.conf "$to/etc/pepeseg/"
if [[ -n $to ]]; then
  echo "copied to $to"
  exit
fi
systemd-sysusers /usr/lib/sysusers.d/pepeseg.conf
systemd-tmpfiles --create /usr/lib/tmpfiles.d/pepeseg.conf
systemctl daemon-reload
echo 'Installed. Look at /etc/pepeseg/pepesegd.conf, then: systemctl enable --now pepesegd'
