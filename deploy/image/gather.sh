#!/usr/bin/env bash
# Gathers programs and the libraries that they load, so that an image has these and not whole packages
# with their data and drivers (COLMAP's bring Mesa and LLVM, GDAL's bring maps of the world).
#   gather.sh BASE_PACKAGES ROOT PROGRAM_OR_MODULE...
# Programs go to usr/bin, modules (*.so, which programs load when they need them) to usr/lib/pepeseg.
# BASE_PACKAGES: the base image's packages, one "name:architecture version" a line, which are left out.
# Below ROOT it also writes which packages the files are from: usr/share/pepeseg/packages.txt, dpkg's
# entries (var/lib/dpkg/status.d, read by vulnerability scanners) and the packages' copyright files.
set -euo pipefail
base=$1 root=$2
shift 2
mkdir -p "$root/usr/bin" "$root/usr/share/pepeseg" "$root/var/lib/dpkg/status.d"

# The package of each file, as "name:architecture". Read once, because dpkg-query -S reads everything
# each time. dpkg lists files below /lib under that path or under /usr/lib.
declare -A owner in_base
while IFS=$'\t' read -r path package; do owner[$path]=$package; done < <(
  cd /var/lib/dpkg/info && grep -H -E '^(/usr)?/(lib|bin)' -- *.list | sed 's/\.list:/\t/' |
    awk -F'\t' '{print $2 "\t" $1}')
while read -r name version; do in_base["$name $version"]=1; done <"$base"
declare -A full
while read -r name binary version; do
  full[$name]="$name $version"
  full[$binary]="$name $version"  # the list of a package for one architecture is named without it
done < <(dpkg-query -W -f='${Package}:${Architecture} ${Package} ${Version}\n')

declare -A packages
# copy FILE AS: AS is the path that the loader looks for, FILE the file that it leads to.
copy() {
  local package=${owner[$1]-${owner[${1#/usr}]-}}
  [[ -n $package ]] || { echo "$1 is not from a package" >&2; exit 1; }
  [[ ! -v in_base["${full[$package]}"] ]] || return 0
  packages[$package]=1
  install -D -m "$(stat -Lc %a "$1")" "$1" "$root$2"
}

libraries=$(ldd "$@" | awk '/=> not found/ {print "not found:", $1 > "/dev/stderr"; exit 1}
                            /=> \// {print $3}' | sort -u)
for library in $libraries; do
  # /lib is a link to /usr/lib.
  copy "$(readlink -f "$library")" "$(readlink -f "$(dirname "$library")")/$(basename "$library")"
done
for program in "$@"; do
  [[ $program != *.so ]] || { install -D -m 644 -t "$root/usr/lib/pepeseg" "$program"; continue; }
  install -m 755 "$program" "$root/usr/bin/"
  [[ $program != /usr/bin/* ]] || packages[${owner[$program]}]=1
done

# Our programs contain parts of the archives of these.
for package in libabsl-dev libgrpc-dev libgrpc++-dev; do
  packages[$package:$(dpkg --print-architecture)]=1
done

for package in "${!packages[@]}"; do
  dpkg-query -W -f='${Package} ${Version}\n' "$package" >>"$root/usr/share/pepeseg/packages.txt"
  dpkg-query -s "$package" >"$root/var/lib/dpkg/status.d/${package%%:*}"
  copyright=/usr/share/doc/${package%%:*}/copyright
  [[ ! -e $copyright ]] || install -D -m 644 "$(readlink -f "$copyright")" "$root$copyright"
done
sort -o "$root/usr/share/pepeseg/packages.txt" "$root/usr/share/pepeseg/packages.txt"
