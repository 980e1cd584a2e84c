#!/usr/bin/env bash
# Installs the Debian packages of the lists that are given as arguments, if they are missing.
set -euo pipefail

mapfile -t wanted < <(grep -hEv '^[[:space:]]*(#|$)' "$@")
missing=()
for package in "${wanted[@]}"; do
  state=$(dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2>/dev/null || true)
  [[ $state == ii* ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi

echo "pepeseg needs these Debian packages, which are not installed:"
printf '  %s\n' "${missing[@]}"
echo "This takes a few minutes, once."
as_root=()
if ((EUID != 0)); then
  if ! command -v sudo >/dev/null; then
    echo "Install them as root, then run this again:" >&2
    echo "  apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
  fi
  echo "Installing them with sudo, which may ask for your password."
  as_root=(sudo)
fi
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
