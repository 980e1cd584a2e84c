#!/usr/bin/env bash
# Tests the packages of `make deb` in a bare Debian 12 that it makes in a temporary folder: apt installs them
# from their files; server, client and web app run in a chroot (deb_in_chroot.sh) and under systemd, in
# systemd-nspawn (deb_under_systemd.sh); apt purges them.
#   deb_test.sh FOLDER_OF_PACKAGES
# Run it as root. PEPESEG_DEBIAN_MIRROR: http://deb.debian.org by default.
set -euo pipefail
packages=$(realpath "${1:?the folder of the packages}")
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../../..
mirror=${PEPESEG_DEBIAN_MIRROR:-http://deb.debian.org}
[[ $EUID == 0 ]] || { echo 'deb_test.sh: as root' >&2; exit 1; }
work=$(mktemp -d)
tree=$work/tree
trap 'rm -rf --one-file-system "$work"' EXIT
trap 'exit 143' TERM
trap 'exit 130' INT
step() { printf '%(%T)T  %s\n' -1 "$*"; }
fail() { echo "FAILED: $*" >&2; exit 1; }

# inside [--offline] COMMAND...: runs a command in the tree, with namespaces of its own, which end with it.
# --offline: with a network that has only a loopback device, so that ports are free.
inside() {
  local net=()
  [[ $1 != --offline ]] || { net=(--net); shift; }
  # shellcheck disable=SC2016  # expanded inside
  unshare --mount --pid --fork --kill-child "${net[@]}" bash -c '
    set -euo pipefail
    tree=$1; shift
    ip link set lo up
    mount -t proc proc "$tree/proc"
    mount -t sysfs -o ro sysfs "$tree/sys"
    mount --rbind /dev "$tree/dev"
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
      chroot "$tree" "$@"' inside "$tree" "$@"
}
apt() { inside apt-get -qq -y --no-install-recommends "$@" >"$work/apt" 2>&1 || { cat "$work/apt" >&2; fail "apt $1"; }; }

step 'a bare Debian 12'
check=$(apt-config dump Acquire::Check-Valid-Until)
mmdebstrap --quiet --variant=minbase ${check:+--aptopt="$check"} bookworm "$tree" \
  "deb $mirror/debian bookworm main" "deb $mirror/debian bookworm-updates main" \
  "deb $mirror/debian-security bookworm-security main"
cp /etc/resolv.conf "$tree/etc/resolv.conf"
mkdir "$tree/test"
cp "$packages"/*.deb "$here"/deb_in_chroot.sh "$here"/deb_under_systemd.sh "$here"/deb_test_steps.sh "$tree/test/"
cp -r "$root/tests/data/apc_shelf" "$tree/test/shelf"

step 'apt installs the packages from files'
before=$(du -smx "$tree" | cut -f1)
debs=("$tree"/test/*.deb)
((${#debs[@]} == 3)) || fail "not three packages: ${debs[*]}"
apt update
apt install "${debs[@]#"$tree"}"
inside apt-get clean
step "$(inside dpkg-query -W -f '${db:Status-Abbrev}\n' | wc -l) packages," \
  "$(($(du -smx "$tree" | cut -f1) - before)) MiB more than before"
missing=$(inside sh -c 'ldd /usr/bin/pepesegd /usr/bin/pepeseg-worker /usr/bin/pepeseg /usr/lib/pepeseg/*.so' |
  grep 'not found' || true)
[[ -z $missing ]] || fail "the packages do not depend on $missing"

step 'server, client and web app in the chroot'
inside --offline bash /test/deb_in_chroot.sh || fail 'in the chroot'

step 'manual pages and completions, for which apt installs man-db, bash-completion and zsh'
apt install man-db bash-completion zsh
for page in pepesegd pepeseg-worker pepeseg pepeseg-web; do
  inside man --warnings "$page" >"$work/page" 2>"$work/said" || fail "man $page"
  [[ ! -s $work/said ]] || fail "man $page says: $(cat "$work/said")"
  grep -q '^EXIT STATUS' "$work/page" || fail "man $page has no exit status"
done
# shellcheck disable=SC2016
inside bash -ic 'source /usr/share/bash-completion/bash_completion; _completion_loader pepeseg
  COMP_WORDS=(pepeseg tr) COMP_CWORD=1; _pepeseg; echo "${COMPREPLY[*]}"' 2>/dev/null | grep -qw train ||
  fail 'bash does not complete'
# shellcheck disable=SC2016
inside zsh -fc 'autoload -U compinit && compinit -u && echo $_comps[pepeseg]' | grep -qx _pepeseg ||
  fail 'zsh does not complete'

step 'apt purges the packages'
purge() {
  apt purge pepeseg-server pepeseg pepeseg-web
  grep -q 'scenes and keys stay in /var/lib/pepeseg' "$work/apt" || fail 'purge does not say what stays'
  for file in /usr/bin/pepesegd /usr/lib/pepeseg /usr/share/pepeseg /etc/pepeseg /usr/bin/pepeseg-web \
    /usr/share/man/man1/pepeseg.1.gz /lib/systemd/system/pepesegd.service; do
    [[ ! -e $tree$file ]] || fail "purge leaves $file"
  done
  left=$(find "$tree/etc" "$tree/lib/systemd" "$tree/usr/lib/systemd" "$tree/var/lib/dpkg" -name '*pepeseg*' || true)
  [[ -z $left ]] || fail "purge leaves $left"
  [[ -s $tree/var/lib/pepeseg/pepeseg.db ]] || fail 'purge deletes the scenes'
}
purge

step 'under systemd: apt installs the packages again, the scene of before is there'
apt install systemd-sysv dbus procps iproute2
apt install "${debs[@]#"$tree"}"
cat >"$tree/etc/systemd/system/deb-test.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
Type=oneshot
StandardOutput=file:/test/output
StandardError=file:/test/output
ExecStart=/bin/bash -c 'bash /test/deb_under_systemd.sh && touch /test/passed'
ExecStopPost=/bin/systemctl poweroff --no-block
UNIT
ln -s ../deb-test.service "$tree/etc/systemd/system/multi-user.target.wants/deb-test.service"
timeout 900 systemd-nspawn --quiet --boot --register=no --keep-unit --private-network --console=pipe \
  --link-journal=no --resolv-conf=off --timezone=off --directory "$tree" </dev/null >"$work/boot" 2>&1 || true
cat "$tree/test/output" || cat "$work/boot"
[[ -e $tree/test/passed ]] || fail 'under systemd'
purge
step 'done'
