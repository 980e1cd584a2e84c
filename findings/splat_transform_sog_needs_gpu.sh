#!/usr/bin/env bash
# Without a GPU, splat-transform fails to write a SOG with a TypeError that names neither the GPU nor the remedy.
#
# @playcanvas/splat-transform 3.7.0 (npm). The README says that SOG compression chooses a GPU by itself and that
# `-g cpu` uses the CPU. One would expect that a machine without a GPU uses the CPU, or an error that says that no GPU
# was found and that `-g cpu` helps. Seen for a PLY of 4 Gaussians:
#   - SH degree 0: the SOG is written. It needs no GPU.
#   - SH degree 1: exit code 1, no file, and "TypeError: Cannot read properties of null (reading 'features')" with a
#     stack trace. Warnings of the Vulkan loader come before it. `-g cpu` is not mentioned.
#   - SH degree 1 with `-g cpu`: the SOG is written.
# So pass `-g cpu` wherever there may be no GPU. It is slow: 4000 Gaussians of degree 3 took 15 seconds on 2 cores.
#
# Needs Linux, npm, node (20 or newer) and python3. Hides the machine's GPUs from Vulkan, so that the result is the
# same on a machine that has one. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund @playcanvas/splat-transform@3.7.0
export VK_DRIVER_FILES=/dev/null VK_ICD_FILENAMES=/dev/null  # the second is the name in older Vulkan loaders

cat > write.py <<'SOURCE'
import struct

for degree in (0, 1):
    names = "x y z f_dc_0 f_dc_1 f_dc_2".split() + [f"f_rest_{index}" for index in range(9 * degree)]
    names += "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
    header = ["ply", "format binary_little_endian 1.0", "element vertex 4"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    with open(f"degree{degree}.ply", "wb") as file:
        file.write("\n".join(header).encode())
        for index in range(4):
            rest = [0.1 * (index + coefficient) for coefficient in range(9 * degree)]
            file.write(struct.pack(f"<{len(names)}f", index, 2, 3, 0, 0, 0, *rest, 2, -3, -3, -3, 1, 0, 0, 0))
SOURCE
python3 write.py

# Converts $1 to $2 with the other arguments as options, and prints the exit code, the error and whether a file came.
convert() {
  local code=0 file=none
  node node_modules/@playcanvas/splat-transform/bin/cli.mjs -w "${@:3}" "$1" "$2" >"$2.log" 2>&1 || code=$?
  [ ! -s "$2" ] || file=written
  echo "exit code $code, file $file$(sed -n 's/^.*\(TypeError: .*\)/, \1/p' "$2.log")"
}
declare -A seen
seen[plain]=$(convert degree0.ply plain.sog)
seen[harmonics]=$(convert degree1.ply harmonics.sog)
seen[cpu]=$(convert degree1.ply cpu.sog -g cpu)
remedy=$(grep -c -e '-g cpu' -e '--gpu' harmonics.sog.log || true)
echo "SH degree 0:             ${seen[plain]}"
echo "SH degree 1:             ${seen[harmonics]}; lines that name the option: $remedy"
echo "SH degree 1 and -g cpu:  ${seen[cpu]}"
[ "${seen[plain]}" = "exit code 0, file written" ]
[ "${seen[harmonics]}" = \
  "exit code 1, file none, TypeError: Cannot read properties of null (reading 'features')" ]
[ "$remedy" = 0 ]
[ "${seen[cpu]}" = "exit code 0, file written" ]
