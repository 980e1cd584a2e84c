#!/usr/bin/env bash
# Installs what `make build` has built, for systemd, in /usr: server, client, and the web app if `make web-app`
# has built it; with units, user and folders. Run it again to update the programs; it does not change
# settings in /etc/pepeseg.
#   install.sh BUILD_FOLDER [--gpu]
# With DESTDIR=FOLDER it only copies below FOLDER. The libraries are those of deploy/packages/build.txt.
set -euo pipefail
usage() {
  sed -n '5,6s/^# \{0,1\}//p' "$0" >&2
  exit 2
}
[[ $# -ge 1 && $# -le 2 && $1 != -* && ${2:---gpu} == --gpu ]] || usage
build=$(realpath "$1")
gpu=${2:-}
to=${DESTDIR:-}
cd "$(dirname "$0")"
[[ -n $to || $EUID == 0 ]] || { echo 'install.sh: as root, or with DESTDIR' >&2; exit 1; }
umask 022
components=(server client)
[[ ! -e ../../clients/web/dist/server/main.js ]] || components+=(web)
for component in "${components[@]}"; do
  cmake --install "$build" --prefix /usr --component "$component" --strip >/dev/null ||
    { echo "install.sh: $build: not all is built: make build" >&2; exit 1; }
done
if [[ -n $gpu ]]; then
  install -D -m 644 gpu.conf "$to/usr/lib/systemd/system/pepesegd.service.d/gpu.conf"
fi
if [[ -n $to ]]; then
  echo "copied to $to"
  exit
fi
systemd-sysusers /usr/lib/sysusers.d/pepeseg.conf
systemd-tmpfiles --create /usr/lib/tmpfiles.d/pepeseg.conf
systemctl daemon-reload
echo 'Installed. Look at /etc/pepeseg/pepesegd.conf, then: systemctl enable --now pepesegd'
