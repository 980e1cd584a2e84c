#!/usr/bin/env bash
# splat-transform reads SPZ without turning its axes, so that a y-up SPZ lies on its head in the glTF made of it.
#
# @playcanvas/splat-transform 3.7.0 (npm). SPZ's description says that its axes are right, up, back (those of OpenGL
# and glTF), and that a PLY's are typically right, down, forward. glTF's are fixed, too: y up. One would expect that a
# Gaussian at (1, 2, 3) of an SPZ is at (1, 2, 3) in the GLB made of it, or at least above the origin. Seen:
#   - SPZ (version 3) to GLB: (-1, -2, 3). PLY to GLB: (-1, -2, 3) too, which is half a turn about z.
#   - SPZ to PLY: (1, 2, 3), as it stands. The tool takes the axes of every input for those of a PLY.
#   - PLY to SPZ: the file has version 4, which is not gzip as versions 1 to 3 are. Read back it is (1, 2, 3).
# So an SPZ that follows the description and one that this tool made of a PLY differ by half a turn, and nothing in
# the files says which it is: let users turn what they load.
#
# Needs npm, node (20 or newer) and python3. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund @playcanvas/splat-transform@3.7.0
convert() { node node_modules/@playcanvas/splat-transform/bin/cli.mjs -w "$1" "$2" >log 2>&1 || { cat log; exit 1; }; }

cat > files.py <<'SOURCE'
import gzip, json, struct, sys

NAMES = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
PLACE = (1.0, 2.0, 3.0)


def write():
    header = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    header += [f"property float {name}" for name in NAMES] + ["end_header", ""]
    values = [*PLACE, 0, 0, 0, 2, -3, -3, -3, 1, 0, 0, 0]
    with open("in.ply", "wb") as file:
        file.write("\n".join(header).encode() + struct.pack("<14f", *values))
    bits = 12
    body = b"NGSP" + struct.pack("<IIBBBB", 3, 1, 0, bits, 0, 0)
    for value in PLACE:
        body += struct.pack("<i", round(value * (1 << bits)))[:3]
    body += bytes([225]) + bytes([128] * 3) + bytes([112] * 3)  # opacity, colour, scales
    body += struct.pack("<I", 3 << 30)  # no turn: w is the largest, x, y and z are 0
    with open("in.spz", "wb") as file:
        file.write(gzip.compress(body))


def ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names = [line.split()[2] for line in data[:end].decode().split("\n") if line.startswith("property float")]
    values = struct.unpack_from(f"<{len(names)}f", data, end)
    return tuple(round(values[names.index(axis)], 2) for axis in "xyz")


def glb(path):
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    scene = json.loads(data[20 : 20 + length])
    accessor = scene["accessors"][scene["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = scene["bufferViews"][accessor["bufferView"]]
    at = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    assert not {"rotation", "matrix", "scale"} & set(scene["nodes"][0])
    return tuple(round(value, 2) for value in struct.unpack_from("<3f", data, at))


if sys.argv[1] == "write":
    write()
else:
    made = open("made.spz", "rb").read()
    seen = {
        "SPZ to GLB": glb("spz.glb"),
        "PLY to GLB": glb("ply.glb"),
        "SPZ to PLY": ply("spz.ply"),
        "PLY to SPZ to PLY": ply("made.ply"),
        "version of the SPZ": struct.unpack_from("<I", made, 4)[0] if made[:4] == b"NGSP" else "gzip",
    }
    for name, value in seen.items():
        print(f"{name}: {value}")
    turned = (-1, -2, 3)
    sys.exit(list(seen.values()) != [turned, turned, PLACE, PLACE, 4])
SOURCE
python3 files.py write
convert in.spz spz.glb
convert in.ply ply.glb
convert in.spz spz.ply
convert in.ply made.spz
convert made.spz made.ply
python3 files.py read
