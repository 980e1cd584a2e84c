#!/usr/bin/env bash
# splat-transform takes the scales of a SOG for natural logarithms, where the format's description says scene units.
#
# @playcanvas/splat-transform 3.7.0 (npm), SOG version 2. The description is the page on SOG in the user manual of
# github.com/playcanvas/developer-site, read as of commit 54a314b; a later text was not at hand.
#
#   subject    what the description leads one to expect         what was seen
#   scales     the codebook is in scene units: an entry of      the entry is ln(scale) already: scale_0 is 0.25, which
#              0.25 becomes scale_0 = ln(0.25) in a PLY         is a scale of 1.28. A PLY's -2 is written as -2.
#   rotations  the component that alpha 252 leaves out is x,    252 leaves out w, 253 x, 254 y, 255 z: the components
#              that of 255 is w: the order is x, y, z, w        are in the order w, x, y, z, as in a PLY
#   axes       y is up and z points back, as in glTF, so that   (1, 2, 3) becomes (-1, -2, 3), half a turn about z, as
#              (1, 2, 3) is at (1, 2, 3) in a GLB               it does from a PLY. In a PLY it stays (1, 2, 3).
#
# A reader that follows the description gets negative sizes, wrong rotations and a scene upside down from this tool's
# files. Take exp() of the codebook, read w first, and treat the axes as those of a PLY.
#
# Needs npm, node (20.9 or newer) and python3. Fails if the behaviour changes. sharp 0.35.5 (npm) writes the WebP.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --ignore-scripts --no-audit --no-fund @playcanvas/splat-transform@3.7.0 sharp@0.35.5
convert() { node node_modules/@playcanvas/splat-transform/bin/cli.mjs -w "$@" >log 2>&1 || { cat log; exit 1; }; }

# Four Gaussians, 2 x 2 pixels: all at (1, 2, 3), with the scales 0, 1 and 2 of the codebook. The stored rotation is
# the same for all; alpha says which component is left out.
cat > images.mjs <<'SOURCE'
import sharp from 'sharp';

const images = {
    means_l: () => [0, 0, 0, 255],
    means_u: () => [0, 0, 0, 255],
    scales: () => [0, 1, 2, 255],
    quats: (index) => [100, 150, 200, 252 + index],
    sh0: () => [0, 0, 0, 200]
};
for (const [name, pixel] of Object.entries(images)) {
    const data = Buffer.from([0, 1, 2, 3].flatMap(pixel));
    await sharp(data, { raw: { width: 2, height: 2, channels: 4 } }).webp({ lossless: true }).toFile(`${name}.webp`);
}
SOURCE
cat > files.py <<'SOURCE'
import json, math, struct, sys, zipfile

NAMES = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
PLACE = (1, 2, 3)
SCALES = (0.25, 0.5, 1.5)  # in the codebook; valid both as lengths and as logarithms


def write():
    means = [math.log(1 + value) for value in PLACE]
    meta = {
        "version": 2,
        "count": 4,
        "antialias": False,
        "means": {
            "mins": means,
            "maxs": [value + 1 for value in means],
            "files": ["means_l.webp", "means_u.webp"],
        },
        "scales": {"codebook": [*SCALES, *[0.0] * 253], "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": [0.0] * 256, "files": ["sh0.webp"]},
    }
    with zipfile.ZipFile("in.sog", "w") as file:
        file.writestr("meta.json", json.dumps(meta))
        for name in ("means_l", "means_u", "scales", "quats", "sh0"):
            file.write(f"{name}.webp")
    header = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    header += [f"property float {name}" for name in NAMES] + ["end_header", ""]
    with open("in.ply", "wb") as file:
        file.write("\n".join(header).encode() + struct.pack("<14f", *PLACE, 0, 0, 0, 2, -2, -2, -2, 1, 0, 0, 0))


def ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names = [line.split()[2] for line in data[:end].decode().split("\n") if line.startswith("property float")]
    return [dict(zip(names, row)) for row in struct.iter_unpack(f"<{len(names)}f", data[end:])]


def glb(path):
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    scene = json.loads(data[20 : 20 + length])
    accessor = scene["accessors"][scene["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = scene["bufferViews"][accessor["bufferView"]]
    at = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    assert not {"rotation", "matrix", "scale"} & set(scene["nodes"][0])
    return tuple(round(value, 2) for value in struct.unpack_from("<3f", data, at))


def read():
    rows = ply("sog.ply")
    kept = [(byte / 255 * 2 - 1) / math.sqrt(2) for byte in (100, 150, 200)]
    omitted = math.sqrt(1 - sum(value * value for value in kept))
    good = len(rows) == 4
    for index, row in enumerate(rows):
        scales = tuple(round(row[f"scale_{axis}"], 4) for axis in range(3))
        rotation = tuple(round(row[f"rot_{part}"], 3) for part in range(4))
        place = tuple(round(row[axis], 3) for axis in "xyz")
        print(f"SOG to PLY, alpha {252 + index}: scales {scales}, rotation (w first) {rotation}, position {place}")
        expected = kept[:index] + [omitted] + kept[index:]
        good &= scales == SCALES and place == PLACE
        good &= all(abs(a - b) < 0.001 for a, b in zip(rotation, expected))
    places = glb("sog.glb"), glb("ply.glb")
    print(f"SOG to GLB: position {places[0]}; PLY to GLB: position {places[1]}")
    good &= places == ((-1, -2, 3), (-1, -2, 3))
    with zipfile.ZipFile("made.sog") as file:
        codebook = json.loads(file.read("meta.json"))["scales"]["codebook"]
    print(f"PLY with scales of -2 to SOG: the codebook has values from {min(codebook)} to {max(codebook)}")
    good &= -2.0 in codebook
    return good


if sys.argv[1] == "write":
    write()
else:
    sys.exit(not read())
SOURCE
node images.mjs
python3 files.py write
convert in.sog sog.ply
convert in.sog sog.glb
convert in.ply ply.glb
convert -g cpu in.ply made.sog
python3 files.py read
