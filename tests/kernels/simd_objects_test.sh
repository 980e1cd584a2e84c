#!/bin/sh
# simd_objects_test.sh NM OBJECT...
# Exits with 1 if an object defines a weak function outside the namespaces of the instruction sets
# (N_AVX3, N_AVX2), and lists those functions.
nm=$1
shift
[ $# -gt 0 ] || { echo "no objects given"; exit 1; }
leaks=$("$nm" -C --defined-only "$@" | grep ' W ' | grep -v -e 'N_AVX3::' -e 'N_AVX2::')
[ -z "$leaks" ] || { echo "$leaks"; exit 1; }
