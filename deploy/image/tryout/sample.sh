#!/bin/bash
# Trains the sample and names its products, within the server's image.
#   sample.sh DATA SCENE
# DATA gets the data folder of a server that has the sample; SCENE: the folder with its photographs.
set -euo pipefail
data=$1 scene=$2
export PEPESEG_SERVER=127.0.0.1:50051
unset PEPESEG_CA
pepesegd --listen="$PEPESEG_SERVER" --data="$data" &
server=$!
trap 'kill "$server" 2>/dev/null || true' EXIT
for _ in {1..300}; do
  ! pepeseg health >/dev/null 2>&1 || break
  kill -0 "$server"
  sleep 0.1
done
pepeseg upload demo "$scene"
pepeseg train demo --preset preview
# Names and pixels of the photograph that show them, as in `make demo`.
name() { pepeseg label demo "$1" --text "$2" --view frame-000008.jpg --point "$3"; }
name creativity_chenille_stems 'Creativity chenille stems' 426,400
name i_am_a_bunny_book '"I Am a Bunny" book' 181,194
name kleenex_tissue_box 'Kleenex tissue box' 352,265
name laugh_out_loud_joke_book '"Laugh-Out-Loud" joke book' 536,195
kill -TERM "$server"
wait "$server"
trap - EXIT
