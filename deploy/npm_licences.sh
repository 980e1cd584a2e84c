#!/usr/bin/env bash
# Copies the licences of the npm packages that the web app has in it, one file a package.
#   npm_licences.sh CLIENTS_WEB FOLDER
set -euo pipefail
web=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
cd "$web"
# "FOLDER:NAME@VERSION:..." a line; the first one is the app itself.
while IFS=: read -r folder name _; do
  found=$(find "$folder" -maxdepth 1 -iname 'licen[cs]e*' | sort | head -n 1)
  file=${name//\//_}
  if [[ -n $found ]]; then
    install -m 644 "$found" "$out/$file"
  else
    # Without a file of its own: what its package.json says.
    sed -n 's/^ *"license": "\(.*\)",*$/\1/p' "$folder/package.json" | grep . >"$out/$file" ||
      { echo "$name has no licence" >&2; exit 1; }
  fi
done < <(npm ls --omit=dev --all --parseable --long | tail -n +2)
