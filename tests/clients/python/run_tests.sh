#!/bin/sh
# run_tests.sh SOURCE_FOLDER: runs the tests of pepeseg_priors with the first python3 that has NumPy
# and Pillow. Exits with 77, which CTest reports as skipped, if there is none.
set -eu
for python in python3 /usr/bin/python3; do
  "$python" -c 'import numpy, PIL' 2>/dev/null || continue
  PYTHONDONTWRITEBYTECODE=1 PYTHONPATH="$1/clients/python/pepeseg_priors" \
    exec "$python" -m unittest discover -v -s "$1/tests/clients/python" -p '*_test.py'
done
echo 'skipped: no python3 with NumPy and Pillow' >&2
exit 77
