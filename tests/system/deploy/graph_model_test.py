#!/usr/bin/env python3
"""Tests deploy/graph_model_to_onnx.py on a tiny graph: reads back the ONNX model that it writes.

  graph_model_test.py FOLDER_OF_DEPLOY

That a converted network computes what TensorFlow.js does: tests/bench/detector_check.sh.
"""
import base64
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

DEPLOY = pathlib.Path(sys.argv.pop(1))


def fields(data):
    """Yields (field, value) of a protobuf message: an int, or bytes."""
    def varint(at):
        value = shift = 0
        while True:
            byte = data[at]
            value |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                return value, at

    at = 0
    while at < len(data):
        key, at = varint(at)
        value, at = varint(at)
        if key & 7 == 2:
            value, at = data[at:at + value], at + value
        yield key >> 3, value


def all_of(data, field):
    return [value for number, value in fields(data) if number == field]


def one_of(data, field):
    (value,) = all_of(data, field)
    return value


def words(data, field):
    return [value.decode() for value in all_of(data, field)]


def attributes(node):
    made = {}
    for data in all_of(node, 5):
        kind = one_of(data, 20)
        name = one_of(data, 1).decode()
        made[name] = {2: lambda: one_of(data, 3), 3: lambda: one_of(data, 4).decode(),
                      7: lambda: all_of(data, 8)}[kind]()
    return made


def coded(*names):
    return {"list": {"s": [base64.b64encode(name.encode()).decode() for name in names]}}


def shape_of(*sizes):
    return {"dim": [{"size": str(size)} for size in sizes]}


def convolution(name, operator, inputs, fused, stride=1):
    return {"name": name, "op": operator, "input": inputs, "attr": {
        "data_format": {"s": base64.b64encode(b"NHWC").decode()},
        "padding": {"s": base64.b64encode(b"SAME").decode()},
        "strides": {"list": {"i": ["1", str(stride), str(stride), "1"]}},
        "dilations": {"list": {"i": ["1", "1", "1", "1"]}}, "fused_ops": coded(*fused)}}


def tiny_graph():
    """Returns a graph model of most operators, and the bytes of its weights."""
    constants = {"kernel": ("float16", [3, 3, 2, 4]), "bias": ("float16", [4]),
                 "depthwise": ("float32", [3, 3, 4, 1]), "axes": ("int32", [2]),
                 "sizes": ("int32", [2]), "axis": ("int32", []), "six": ("float16", [])}
    values = {"axes": struct.pack("<2i", 1, 2), "sizes": struct.pack("<2i", 4, 6),
              "axis": struct.pack("<i", 3), "six": struct.pack("<e", 6)}
    entries, weights = [], b""
    for name, (kind, shape) in constants.items():
        count = 1
        for size in shape:
            count *= size
        code = {"float16": "e", "float32": "f", "int32": "i"}[kind]
        weights += values.get(name) or struct.pack(f"<{count}{code}", *range(count))
        entry = {"name": name, "shape": shape, "dtype": "float32"}
        if kind == "float16":
            entry["quantization"] = {"dtype": "float16"}
        elif kind == "int32":
            entry["dtype"] = "int32"
        entries.append(entry)
    nodes = [{"name": name, "op": "Const"} for name in constants]
    nodes += [
        {"name": "photo", "op": "Placeholder", "attr": {"shape": {"shape": shape_of(1, 4, 6, 2)}}},
        convolution("conv", "_FusedConv2D", ["photo", "kernel", "bias"], ["BiasAdd", "Relu"], 2),
        convolution("deep", "DepthwiseConv2dNative", ["conv", "depthwise"], []),
        {"name": "mean", "op": "Mean", "input": ["deep", "axes"], "attr": {"keep_dims": {"b": True}}},
        {"name": "scaled", "op": "Mul", "input": ["deep", "mean"]},
        {"name": "clipped", "op": "Relu6", "input": ["scaled"]},
        {"name": "added", "op": "Add", "input": ["clipped", "six"]},
        {"name": "joined", "op": "ConcatV2", "input": ["added", "deep", "axis"]},
        {"name": "larger", "op": "ResizeBilinear", "input": ["joined", "sizes"], "attr": {}},
        {"name": "out", "op": "Sigmoid", "input": ["larger"]},
        {"name": "unused", "op": "TopKV2", "input": ["out"]},
    ]
    signature = {"inputs": {"photo": {}},
                 "outputs": {"out": {"tensorShape": shape_of(1, 4, 6, 8)}, "unused": {"tensorShape": shape_of(1)}}}
    return {"modelTopology": {"node": nodes}, "signature": signature,
            "weightsManifest": [{"paths": ["tiny.bin"], "weights": entries}]}, weights


class GraphModelTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.model, self.weights = tiny_graph()

    def convert(self, *named):
        (self.folder / "tiny.json").write_text(json.dumps(self.model), encoding="utf-8")
        (self.folder / "tiny.bin").write_bytes(self.weights)
        return subprocess.run(
            [sys.executable, DEPLOY / "graph_model_to_onnx.py", self.folder / "tiny.json",
             self.folder / "tiny.onnx", *named],
            capture_output=True, text=True, check=False)

    def graph(self):
        result = self.convert("images=photo", "scores=out")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return one_of((self.folder / "tiny.onnx").read_bytes(), 7)

    def refused(self, what, *named):
        result = self.convert(*(named or ("images=photo", "scores=out")))
        self.assertEqual(result.returncode, 1)
        self.assertIn(what, result.stderr)
        self.assertFalse((self.folder / "tiny.onnx").exists())

    def node(self, name):
        return next(node for node in all_of(self.graph(), 1) if words(node, 3) == [name])

    def test_nodes_come_after_those_that_they_read(self):
        graph = self.graph()
        known = {words(data, 8)[0] for data in all_of(graph, 5)} | {"images", ""}
        for node in all_of(graph, 1):
            self.assertLessEqual(set(words(node, 1)), known)
            known |= set(words(node, 2))
        self.assertIn("scores", known)
        self.assertNotIn("unused", known)

    def test_inputs_and_outputs_keep_their_names_and_layout(self):
        graph = self.graph()
        self.assertEqual(words(one_of(graph, 11), 1), ["images"])
        self.assertEqual(words(one_of(graph, 12), 1), ["scores"])
        self.assertEqual(attributes(self.node("photo"))["perm"], [0, 3, 1, 2])
        self.assertEqual(attributes(self.node("scores"))["perm"], [0, 2, 3, 1])

    def test_operators_get_onnx_attributes(self):
        conv = self.node("conv/sum")
        self.assertEqual(words(conv, 4), ["Conv"])
        self.assertEqual(attributes(conv), {
            "auto_pad": "SAME_UPPER", "kernel_shape": [3, 3], "strides": [2, 2],
            "dilations": [1, 1], "group": 1})
        self.assertEqual(attributes(self.node("deep"))["group"], 4)
        self.assertEqual(attributes(self.node("kernel/3201"))["perm"], [3, 2, 0, 1])
        self.assertEqual(attributes(self.node("depthwise/2301"))["perm"], [2, 3, 0, 1])
        self.assertEqual(attributes(self.node("joined"))["axis"], 1)
        self.assertEqual(attributes(self.node("larger")), {
            "axes": [2, 3], "mode": "linear", "coordinate_transformation_mode": "asymmetric"})
        self.assertEqual(words(self.node("clipped"), 1), ["scaled", "clip/0", "clip/6"])

    def test_weights_are_copied_as_they_are(self):
        tensors = {words(data, 8)[0]: data for data in all_of(self.graph(), 5)}
        kernel = tensors["kernel/3201/stored"]
        self.assertEqual(all_of(kernel, 1), [3, 3, 2, 4])
        self.assertEqual(one_of(kernel, 2), 10)  # float16
        self.assertEqual(one_of(kernel, 9), self.weights[:144])
        self.assertEqual(one_of(tensors["mean/axes"], 9), struct.pack("<2q", 2, 3))
        self.assertEqual(one_of(tensors["larger/sizes"], 9), struct.pack("<2q", 4, 6))

    def test_what_is_unknown_is_refused(self):
        self.refused("unknown operator TopKV2", "images=photo", "scores=unused")
        self.refused("the model has no input or output none", "images=photo", "scores=none")
        self.refused("an input without a NAME", "scores=out")
        self.weights += b"\0"
        self.refused("1 bytes too many")
        self.weights = self.weights[:-2]
        self.refused("too short")

    def test_other_layouts_and_fusions_are_refused(self):
        nodes = {node["name"]: node for node in self.model["modelTopology"]["node"]}
        nodes["conv"]["attr"]["fused_ops"] = coded("BiasAdd", "Elu")
        self.refused("fused ['BiasAdd', 'Elu']")
        nodes["conv"]["attr"]["fused_ops"] = coded("BiasAdd")
        nodes["larger"]["attr"]["align_corners"] = {"b": True}
        self.refused("align_corners")


if __name__ == "__main__":
    unittest.main()
