#!/usr/bin/env python3
"""Writes the fuzzers' seeds: corpus/TARGET/NAME, small and valid files of each format.

Needs protoc. Inputs that a fuzzer has found are added by hand; this script does not overwrite them.
"""

import hashlib
import json
import pathlib
import struct
import subprocess
import zlib

HERE = pathlib.Path(__file__).resolve().parent
PROTO = HERE.parent.parent.parent / "proto"
METHODS = HERE / "corpus" / "rpc_calls"


def put(target, name, content):
    folder = HERE / "corpus" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)


def ply(properties, rows, text=False):
    head = "ply\nformat %s 1.0\nelement vertex %d\n" % (
        "ascii" if text else "binary_little_endian", len(rows))
    head += "".join("property %s %s\n" % p for p in properties) + "end_header\n"
    if text:
        return (head + "".join(" ".join(map(str, row)) + "\n" for row in rows)).encode()
    codes = "".join({"float": "f", "double": "d", "uchar": "B"}[kind] for kind, _ in properties)
    return head.encode() + b"".join(struct.pack("<" + codes, *row) for row in rows)


def png(width, height, depth=8, color=0, rows=None):
    def chunk(kind, body):
        return (struct.pack(">I", len(body)) + kind + body +
                struct.pack(">I", zlib.crc32(kind + body)))
    channels = {0: 1, 2: 3, 6: 4}[color]
    row = 1 + (width * channels * depth + 7) // 8
    pixels = rows or bytes(i * 7 % 256 if i % row else 0 for i in range(row * height))
    return (b"\x89PNG\r\n\x1a\n" +
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(pixels, 9)) + chunk(b"IEND", b""))


def exif():
    strings = {0x010F: b"Maker\0", 0x0110: b"Model X\0"}
    entries, extra, at = [], b"", 8 + 2 + 3 * 12 + 4
    for tag, text in strings.items():
        entries.append(struct.pack("<HHII", tag, 2, len(text), at + len(extra)))
        extra += text
    sub = at + len(extra)
    entries.append(struct.pack("<HHII", 0x8769, 4, 1, sub))
    extra += struct.pack("<H", 2)
    extra += struct.pack("<HHII", 0x920A, 5, 1, sub + 2 + 2 * 12 + 4)
    extra += struct.pack("<HHIHH", 0xA405, 3, 1, 28, 0) + struct.pack("<I", 0)
    extra += struct.pack("<II", 430, 100)
    body = struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<H", 3) + b"".join(entries)
    return b"Exif\0\0" + body + struct.pack("<I", 0) + extra


def jpeg(width, height, with_exif=False):
    """Returns a grey JPEG with empty blocks: one code of each Huffman table."""
    def segment(marker, body):
        return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body
    table = bytes([1] + [0] * 15 + [0])
    blocks = ((width + 7) // 8) * ((height + 7) // 8)
    bits = "0" * (2 * blocks)
    bits += "1" * (-len(bits) % 8)
    data = bytes(int(bits[i:i + 8], 2) for i in range(0, len(bits), 8))
    return (b"\xff\xd8" + (segment(0xE1, exif()) if with_exif else b"") +
            segment(0xDB, b"\0" + bytes([1] * 64)) +
            segment(0xC0, struct.pack(">BHHBBBB", 8, height, width, 1, 1, 0x11, 0)) +
            segment(0xC4, b"\0" + table) + segment(0xC4, b"\x10" + table) +
            segment(0xDA, b"\1\1\0\0\x3f\0") + data + b"\xff\xd9")


def webp(kind, body):
    chunk = kind + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)
    return b"RIFF" + struct.pack("<I", len(chunk) + 4) + b"WEBP" + chunk


def npy(shape, kind="<f4", values=None, version=1):
    head = "{'descr': '%s', 'fortran_order': False, 'shape': %s, }" % (kind, shape)
    size = struct.pack("<H" if version == 1 else "<I", len(head) + 1)
    count = 1
    for side in shape:
        count *= side
    code = {"<f4": "f", "<f8": "d", "<u2": "H", "|u1": "B"}[kind]
    values = values or [i % 7 + 1 for i in range(count)]
    return (b"\x93NUMPY" + bytes([version, 0]) + size + head.encode() + b"\n" +
            struct.pack("<%d%s" % (count, code), *values))


def message(kind, text):
    files = sorted(str(path.relative_to(PROTO)) for path in PROTO.glob("pepeseg/v1/*.proto"))
    return subprocess.run(["protoc", "-I", str(PROTO), "--encode=pepeseg.v1." + kind] + files,
                          input=text.encode(), stdout=subprocess.PIPE, check=True).stdout


def make_points():
    xyz = [("float", c) for c in "xyz"]
    rgb = [("uchar", c) for c in ("red", "green", "blue")]
    rows = [(0.5, -1, 3, 255, 0, 9), (1, 2, 3, 4, 5, 6)]
    put("ply_points", "binary", ply(xyz + rgb, rows))
    put("ply_points", "text", ply(xyz + rgb, rows, text=True))
    put("ply_points", "grey", ply([("double", c) for c in "xyz"], [(0, 0, 1)]))
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    for degree, rest in ((0, 0), (1, 9)):
        all_names = names + ["f_rest_%d" % i for i in range(rest)] + ["opacity"]
        all_names += ["scale_%d" % i for i in range(3)] + ["rot_%d" % i for i in range(4)]
        row = [0.25] * (len(all_names) - 4) + [1, 0, 0, 0]
        put("gaussian_ply", "degree%d" % degree, ply([("float", n) for n in all_names], [row] * 2))


def make_colmap():
    put("colmap_text", "cameras", "# CAMERAS\n1 PINHOLE 40 30 50 50 20 15\n"
        "2 SIMPLE_RADIAL 40 30 50 20 15 0.01\n")
    put("colmap_text", "images", "# IMAGES\n1 1 0 0 0 0 0 1 1 a.jpg\n3 4 -1 5 6 7\n"
        "2 1 0 0 0 0.5 0 1 2 sub/b.jpg\n\n")
    put("colmap_text", "points", "1 0.5 1 2 255 0 3 0.1 1 0 2 1\n2 0 0 1 1 2 3 0.2\n")
    camera = struct.pack("<IiQQ4d", 1, 1, 40, 30, 50, 50, 20, 15)
    radial = struct.pack("<IiQQ4d", 2, 2, 40, 30, 50, 20, 15, 0.01)
    put("colmap_binary", "cameras", struct.pack("<Q", 2) + camera + radial)
    image = struct.pack("<I7dI", 1, 1, 0, 0, 0, 0, 0, 1, 1) + b"a.jpg\0"
    image += struct.pack("<Q", 1) + struct.pack("<ddq", 3, 4, -1)
    put("colmap_binary", "images", struct.pack("<Q", 1) + image)
    point = struct.pack("<Q3d3BdQ", 7, 0.5, 1, 2, 255, 0, 3, 0.1, 1) + struct.pack("<II", 1, 0)
    put("colmap_binary", "points", struct.pack("<Q", 1) + point)


def make_poses():
    def pose(x):
        return [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]
    frames = [{"file_path": "./images/" + name, "transform_matrix": pose(i)}
              for i, name in enumerate(("a.jpg", "b", "sub/c.png"))]
    put("transforms_json", "shared", json.dumps(
        {"fl_x": 50, "fl_y": 50, "cx": 20, "cy": 15, "w": 40, "h": 30, "k1": 0.01,
         "camera_model": "OPENCV", "frames": frames}))
    put("transforms_json", "angle", json.dumps({"camera_angle_x": 0.8, "frames": frames[:2]}))
    put("transforms_json", "fisheye", json.dumps(
        {"is_fisheye": True, "frames": [dict(frame, fl_x=50, w=40, h=30, k4=0) for frame in frames]}))
    row = [0, 1, 0, 0, 30, 1, 0, 0, 0, 40, 0, 0, -1, 0, 50, 1, 9]
    put("poses_bounds", "doubles", npy((3, 17), "<f8", row * 3))
    put("poses_bounds", "floats", npy((3, 17), "<f4", row * 3))


def make_images():
    put("depth_npy", "floats", npy((3, 4)))
    put("depth_npy", "version2", npy((3, 4), "<u2", version=2))
    put("depth_npy", "bytes", npy((6, 8), "|u1"))
    for scale in ("-1.0", "1"):
        head = ("Pf\n4 3\n%s\n" % scale).encode()
        put("depth_pfm", "scale" + scale, head + struct.pack("<12f", *range(1, 13)))
    for target in ("image_header", "decode_image"):
        put(target, "jpeg", jpeg(40, 30))
        put(target, "jpeg_exif", jpeg(8, 8, with_exif=True))
        for name, depth, color in (("grey", 8, 0), ("grey16", 16, 0), ("rgb", 8, 2), ("rgba", 8, 6)):
            put(target, "png_" + name, png(8, 6, depth, color))
        for name in ("lossy", "lossless"):
            whole = HERE.parent.parent / "data" / "images" / (name + ".webp")
            put(target, "webp_" + name, whole.read_bytes())
    for name in ("gradient", "gradient_turned"):
        whole = HERE.parent.parent / "data" / "images" / (name + ".heic")
        put("image_header", "heic_" + name, whole.read_bytes())
    extended = struct.pack("<I", 0x10) + b"\x27\0\0\x1d\0\0"
    put("image_header", "webp_extended", webp(b"VP8X", extended))
    put("image_header", "png_bomb", png(65535, 65535, 1, rows=b"\0"))


def make_masks():
    masks = [{"segmentation": {"size": [6, 8], "counts": [4, 8, 36]}, "area": 8,
              "bbox": [0, 4, 2, 2], "predicted_iou": 0.9},
             {"segmentation": {"size": [6, 8], "counts": "48T1"}}]
    put("sam_json", "runs", json.dumps(masks[:1]))
    put("sam_json", "compressed", json.dumps(masks))
    put("coco_rle", "runs", b"\x08\x06" + b"48T1")
    put("coco_rle", "one", b"\x02\x02" + b"04")


def make_artifacts():
    files = [{"name": "gaussians.ply", "size": 3, "sha256": hashlib.sha256(b"abc").hexdigest()}]
    put("manifest", "one", json.dumps({"version": 1, "files": files}))

    def checkpoint(stage, sections):
        listed = [{"name": n, "version": v, "size": len(b)} for n, v, b in sections]
        head = json.dumps({"stage": stage, "identity": "00", "step": 3, "sections": listed}).encode()
        return (b"PEPECKPT" + struct.pack("<II", 1, len(head)) + head +
                b"".join(b for _, _, b in sections))
    # One Gaussian of SH degree 0: 14 planes.
    floats = struct.pack("<14f", *([0.5] * 14))
    put("checkpoint", "reconstruct", checkpoint("reconstruct", [
        ("counters", 3, bytes(56)), ("random", 1, b"1 2 3"), ("views_left", 1, bytes(8)),
        ("gaussians", 1, struct.pack("<qq", 1, 0)), ("parameters", 1, floats),
        ("moment1", 1, floats), ("moment2", 1, floats), ("num_steps", 1, bytes(4)),
        ("grad_sum", 1, bytes(4)), ("square_sum", 1, bytes(4)),
        ("num_visible", 1, bytes(4)), ("refinable", 1, b"")]))
    put("checkpoint", "empty", checkpoint("features", []))
    put("selection_file", "nine",
        b"PPSGSELE" + struct.pack("<IIQ", 1, 0, 9) + b"\x0f\x01")
    put("feature_file", "one", b"PPSGFEAT" + struct.pack("<IIQII", 1, 32, 1, 2, 0) +
        struct.pack("<66f", *([0.0] * 64 + [1, 2])) + bytes(64))
    view = {"name": "a.jpg", "width": 40, "height": 30, "focal": [50, 50],
            "principal_point": [20, 15], "rotation": [1, 0, 0, 0], "translation": [0, 0, 1],
            "held_out": True, "scores": {"psnr": 24.1, "ssim": 0.81}}
    put("model_facts", "one", json.dumps(
        {"version": 1, "scene_radius": 1.5, "metrics": {"psnr": 24}, "facts": {"job": "j1"},
         "views": [view]}))


def make_jobs():
    spec = {"job": "j1", "fence": 1, "device": "cpu", "num_threads": 2, "checkpoint_seconds": 60,
            "checkpoint_steps": 1000, "memory_limit": 0, "lease_seconds": 30,
            "options": {"reconstruct": {"numSteps": 60}},
            "files": [{"name": "a.jpg", "kind": 1, "path": "/x", "sha256": "00"}]}
    put("job_files", "spec", json.dumps(spec))
    put("job_files", "result", json.dumps(
        {"code": 0, "message": "", "metrics": {"psnr": 20.5}, "num_gaussians": 3, "num_bytes": 4,
         "sources": {"poses": "given"}}))
    put("event_log", "started", message("JobEvent", 'sequence: 1 stage_started { stage: JOB_STAGE_SFM }'))
    put("event_log", "first", message("JobEvent", "sequence: 7"))
    names = ["images/a.jpg", "scenes/shelf", "scenes/shelf/models/live", "scenes/shelf/datasets/12",
             "scenes/shelf/labels/red", "jobs/j12", "read,train", "../../etc/passwd",
             "pk_" + "A" * 43]
    for i, name in enumerate(names):
        put("names", "%d" % i, name)
    put("names", "token", "c2NlbmVzOnNoZWxm")


MODEL = 'model: "scenes/shelf/models/live" '
POINT = 'prompt { view { view: "middle.jpg" } points { points { x: 12 y: 16 } } } '
STROKES = ("scribbles { strokes { path { x: 12 y: 16 } path { x: 20 y: 9 } width: 3 } "
           "strokes { path { x: 2 y: 3 } negative: true } } ")
FREE = ("free { camera { width: 32 height: 32 fx: 40 fy: 40 cx: 16 cy: 16 } cam_from_world { "
        "rotation { w: 1 } translation { z: 0.5 } } } ")


def make_requests():
    digest = "ab" * 32
    put("upload_request", "two", message("CreateUploadRequest", (
        'parent: "scenes/shelf" files { path: "images/a.jpg" kind: FILE_KIND_IMAGE size: 3 '
        'sha256: "%s" } files { path: "points.ply" kind: FILE_KIND_POINTS size: 9 sha256: "%s" }')
        % (digest, digest)))
    put("train_request", "options", message("TrainSceneRequest", (
        'scene: "scenes/shelf" dataset: "scenes/shelf/datasets/1" options { import { image_scale: '
        "0.5 } reconstruct { num_steps: 100 max_gaussians: 5000 } features { num_steps: 5 } "
        "sfm { max_features: 128 } priors { masks: PRIOR_MAKER_NONE } "
        'advanced { key: "reconstruct.sh_degree" value: "1" } '
        'advanced { key: "features.scale_mapping" value: "even" } }')))
    put("train_request", "defaults", message("TrainSceneRequest", 'scene: "scenes/shelf"'))
    png_text = "".join("\\%03o" % b for b in png(32, 32))
    prompts = {
        "points": POINT,
        "box": 'prompt { view { view: "front" } box { x: 2 y: 3 width: 9 height: 9 } } ',
        "label": 'prompt { label: "red" } ',
        "strokes": 'prompt { view { view: "front" } ' + STROKES + "} ",
        "rle": 'prompt { view { view: "front" } mask { rle { height: 32 width: 32 counts: "00P1" } } } ',
        "png": 'prompt { view { view: "front" } mask { png: "%s" } } ' % png_text,
    }
    for name, prompt in prompts.items():
        put("segment_request", name, message("SegmentViewsRequest", MODEL + prompt +
            "granularity { scale_quantile: 0.3 threshold: 0.5 }"))
    put("segment_request", "all_views", message("SegmentViewsRequest", MODEL + POINT +
        "granularity { scale_units: 1.5 } targets { group: GROUP_HELD_OUT } want_similarity: true"))
    put("segment_request", "free", message("SegmentViewsRequest", MODEL +
        "prompt { view { " + FREE + "} points { points { x: 12 y: 16 } } }"))
    put("propose_request", "points", message("ProposeScalesRequest", MODEL + POINT +
                                             "max_proposals: 3"))
    rle = 'mask { rle { height: 32 width: 32 counts: "00P1" } } '
    labels = 'views { view: "%s" labels_png: "%s" } '
    evaluate = (MODEL + labels % ("middle.jpg", png_text) + labels % ("left/0.jpg", png_text) +
                "options { scales: 0.1 scales: 0.5 thresholds: 0.5 accept_trained_views: true }")
    masks = ('views { view: "middle.jpg" masks { entity: "mug.1" ' + rle + '} ignore_png: "' + png_text +
             '" } views { view: "front" masks { entity: "mug.1" ' + rle + "} } ")
    prompt = 'prompts { key: "mug.1" value { view { view: "front" } %s } } '
    kinds = {
        "points": "points { points { x: 12 y: 16 } points { x: 2 y: 3 negative: true } }",
        "mean": "point_mean { points { x: 12 y: 16 } }",
        "scribbles": "scribbles { positive { " + rle[7:-2] + "} negative { " + rle[7:-2] + "} }",
        "box": "box { x: 2 y: 3 width: 9 height: 9 }", "mask": rle, "strokes": STROKES,
    }
    prompts = {name: prompt % kind for name, kind in kinds.items()}
    prompts["label"] = 'prompts { key: "mug.1" value { label: "red" } } '
    prompts["own"] = 'own_masks { key: "mug.1" value: "front" } '
    for name, text in prompts.items():
        put("evaluate_request", name, message("EvaluateModelRequest", MODEL + masks + text +
            "options { protocol: EVALUATION_PROTOCOL_PROMPTABLE accept_trained_views: true }"))
    put("evaluate_request", "sam", message("EvaluateModelRequest", MODEL + 'sam_views { view: "middle.jpg" '
        "masks { " + rle + "predicted_iou: 0.9 stability: 0.95 } masks { " + rle + "} } "
        "options { protocol: EVALUATION_PROTOCOL_SAM_AGREEMENT sam_agreement { min_pixels: 1 } }"))
    put("evaluate_request", "two", message("EvaluateModelRequest", evaluate))
    return evaluate


def services():
    """Returns the methods that rpc_calls_fuzz.cc numbers, in its order."""
    left_out = {"DeleteScene", "DeleteModel"}
    names = ("dataset", "evaluation", "job", "label", "render", "scene", "segmentation", "selection",
             "edit")
    methods = []
    for service in names:
        for line in (PROTO / "pepeseg/v1" / (service + "_service.proto")).read_text().splitlines():
            words = line.replace("(", " ").replace(")", " ").replace("stream ", "").split()
            if words[:1] == ["rpc"] and words[1] not in left_out:
                methods.append((words[1], words[2]))
    return methods


def make_calls(evaluate):
    scene = 'parent: "scenes/shelf" '
    texts = {
        "CreateScene": 'scene_id: "other"', "GetScene": 'name: "scenes/shelf"',
        "CreateUpload": scene + 'files { path: "a.jpg" kind: FILE_KIND_IMAGE size: 3 sha256: "%s" }'
                        % ("ab" * 32),
        "TrainScene": 'scene: "scenes/shelf" dataset: "scenes/shelf/datasets/1" validate_only: true',
        "EstimateTraining": 'scene: "scenes/shelf" dataset: "scenes/shelf/datasets/1"',
        "GetDataset": 'name: "scenes/shelf/datasets/1"', "GetLabel": 'name: "scenes/shelf/labels/red"',
        "GetJob": 'name: "jobs/j1"', "CancelJob": 'name: "jobs/j1"', "WatchJob": 'name: "jobs/j1"',
        "SegmentViews": MODEL + POINT, "ProposeScales": MODEL + POINT, "EvaluateModel": evaluate,
        "StreamSegments": "sequence: 1 segment { " + MODEL + POINT + "}",
        "DecomposeModel": MODEL, "FindSegments": MODEL + 'text: "red"', "CreateSelection": MODEL + POINT,
        "CorrectSegment": MODEL + 'corrections { view { view: "middle.jpg" } mask { rle { '
                          'height: 64 width: 96 counts: "00P6" } } }',
        "SetLiveModel": 'name: "scenes/shelf/models/1"',
        "CreateLabel": scene + 'label_id: "red" label { text: "red" view: "middle.jpg" mask { rle { '
                       'height: 64 width: 96 counts: "00P6" } } }',
        "CombineSelections": 'first: "scenes/shelf/selections/1" second: '
                             '"scenes/shelf/selections/2" operation: SET_OPERATION_UNION',
        "RenderView": MODEL + 'viewpoint { view: "middle.jpg" } content: CONTENT_DEPTH',
        "ExportGaussians": MODEL + "subset { segment { level: 1 id: 1 } }",
        "ExportMesh": MODEL + "subset { segment { level: 1 id: 1 } } voxels: 32 watertight: true",
        "ExportAnnotations": MODEL + 'format: ANNOTATION_FORMAT_CVAT labels: "red" targets { group: '
                             "GROUP_HELD_OUT } table: true",
        "ListJobs": "page_size: 3", "GetModel": 'name: "scenes/shelf/models/live"', "ListScenes": "page_size: 3",
        "ListTrainingOptions": "preset: TRAINING_PRESET_BEST",
        "ListViews": 'parent: "scenes/shelf/models/live"',
        "EditModel": MODEL + "subset { segment { level: 1 id: 1 } } move { translation { x: 0.5 } "
                     "rotation { w: 1 } scale: 2 pivot { z: 2 } copy: true }",
    }
    further = {  # other forms of a request
        "CreateSelection": {"gaussians": MODEL + 'gaussians { bits: "%s" } display_name: "some"' %
                                         ("\\252" * 2500)},
        "EditModel": {"remove": MODEL + "subset { segment { level: 1 id: 1 } } remove { fill: true }",
                      "recolor": MODEL + "subset { segment { level: 1 id: 2 } complement: true } "
                                 "recolor { red: 0.9 green: 0.2 strength: 0.5 }"},
    }
    for index, (method, kind) in enumerate(services()):
        text = texts.get(method, scene if method.startswith("List") else "")
        if method in ("GetUpload", "SealUpload", "DeleteUpload"):
            text = 'name: "scenes/shelf/uploads/1"'
        try:
            body = message(kind, text)
        except subprocess.CalledProcessError:
            raise SystemExit("%s: %s does not take: %s" % (method, kind, text))
        put("rpc_calls", method, bytes([index]) + body)
        for name, form in further.get(method, {}).items():
            put("rpc_calls", method + "_" + name, bytes([index]) + message(kind, form))


def main():
    make_points()
    make_colmap()
    make_poses()
    make_images()
    make_masks()
    make_artifacts()
    make_jobs()
    make_calls(make_requests())


if __name__ == "__main__":
    main()
