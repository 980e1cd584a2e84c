#!/bin/sh
# simd_objects_test.sh NM OBJECT...: fails when an object holds a weak function outside the
# namespaces of its instruction set (N_AVX3, N_AVX2).
nm=$1
shift
[ $# -gt 0 ] || { echo "no objects given"; exit 1; }
leaks=$("$nm" -C --defined-only "$@" | grep ' W ' | grep -v -e 'N_AVX3::' -e 'N_AVX2::')
[ -z "$leaks" ] || { echo "$leaks"; exit 1; }
