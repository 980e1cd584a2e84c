#!/usr/bin/env bash
# Runs `pepeseg-benchmark curves` on a server that it starts, then makes the table and the plots.
#   bench.sh BUILD_FOLDER OUT_FOLDER DATASET_FOLDER [OPTIONS OF pepeseg-benchmark curves...]
# PEPESEGD_FLAGS: flags of the server, such as --devices=cuda. The plots need python3-matplotlib
# (deploy/packages/bench.txt).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
build=${1:?usage: bench.sh BUILD_FOLDER OUT_FOLDER DATASET_FOLDER [OPTIONS...]}
out=${2:?usage: bench.sh BUILD_FOLDER OUT_FOLDER DATASET_FOLDER [OPTIONS...]}
shift 2
python=${PYTHON:-python3}
fact() { (cd "$here" && "$python" -c "import measured; print(measured.$1())"); }
"$here/../../deploy/with_server.sh" "$build" "$out" \
  "$build/bin/pepeseg-benchmark" curves --out "$out" --fact "machine=$(fact machine)" \
  --fact "commit=$(fact commit)" --fact "settings=${*:2}" "$@"
"$python" "$here/report.py" --out "$out" "$out/record.json"
"$python" "$here/plots.py" curves --out "$out" "$out/record.json"
