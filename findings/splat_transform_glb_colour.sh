#!/usr/bin/env bash
# splat-transform's glTF has the points' fallback colours in sRGB, where glTF and the extension say linear.
#
# @playcanvas/splat-transform 3.7.0 (npm), KHR_gaussian_splatting with the colour space "srgb_rec709_display". For
# programs that show points only, COLOR_0 may hold the base colour. The extension's note on it says that the value of
# degree 0, which is sRGB, has to be decoded, because glTF's COLOR_0 is linear. One would expect 55 of 255 for a
# Gaussian of medium grey (f_dc 0, 0.5 in sRGB, 0.214 linear). Seen: 128, so that points are too bright and pale in
# programs that follow glTF: they encode the colour a second time, which gives 188 on the screen.
# So a reader cannot separate files of this tool from right ones, and must use the SH coefficients.
#
# Needs npm, node (20 or newer) and python3. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund @playcanvas/splat-transform@3.7.0

cat > write.py <<'SOURCE'
import struct

NAMES = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
header = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
header += [f"property float {name}" for name in NAMES] + ["end_header", ""]
with open("grey.ply", "wb") as file:
    file.write("\n".join(header).encode() + struct.pack("<14f", 0, 0, 0, 0, 0, 0, 9, -3, -3, -3, 1, 0, 0, 0))
SOURCE
cat > read.py <<'SOURCE'
import json, struct, sys

data = open("grey.glb", "rb").read()
length = struct.unpack_from("<I", data, 12)[0]
scene = json.loads(data[20 : 20 + length])
primitive = scene["meshes"][0]["primitives"][0]
accessor = scene["accessors"][primitive["attributes"]["COLOR_0"]]
view = scene["bufferViews"][accessor["bufferView"]]
assert accessor["componentType"] == 5121 and accessor["normalized"]
colour = tuple(data[28 + length + view.get("byteOffset", 0) :][:3])
space = primitive["extensions"]["KHR_gaussian_splatting"]["colorSpace"]
linear = round(255 * ((0.5 + 0.055) / 1.055) ** 2.4)
print(f"colour space {space}: COLOR_0 of a medium grey is {colour}; linear would be {linear}")
sys.exit(not (space == "srgb_rec709_display" and all(abs(value - 128) <= 1 for value in colour)))
SOURCE
python3 write.py
node node_modules/@playcanvas/splat-transform/bin/cli.mjs -w grey.ply grey.glb >log 2>&1 || { cat log; exit 1; }
python3 read.py
