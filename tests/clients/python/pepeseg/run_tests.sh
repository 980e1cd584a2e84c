#!/bin/sh
# run_tests.sh FOLDER_OF_PROGRAMS: the tests of the Python package against pepesegd of the build, by
# the first python3 that has what they need (Debian's, where another one stands ahead of it).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
export PEPESEG_PROGRAMS="$1" PYTHONDONTWRITEBYTECODE=1
export PYTHONPATH="$here/../../../../clients/python/pepeseg"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in python3 /usr/bin/python3; do
  "$python" -c 'import grpc, google.protobuf, numpy, PIL, pytest, wheel' 2>/dev/null || continue
  code=0
  "$python" -m pytest -q -p no:cacheprovider --basetemp "$work/tests" -o python_files='*_test.py' \
    --durations=5 "$here" || code=$?
  exit $code
done
echo 'no python3 with grpcio, protobuf, NumPy, Pillow, pytest and wheel: see deploy/packages/build.txt' >&2
exit 1
