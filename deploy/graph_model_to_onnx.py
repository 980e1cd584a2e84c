#!/usr/bin/env python3
"""Converts the detector's network, a graph model of TensorFlow.js, to ONNX.

  graph_model_to_onnx.py MODEL.json OUT.onnx NAME=TENSOR...

Each NAME=TENSOR names an input or an output of the ONNX model and the tensor of the graph model that
it is. What the outputs do not need is dropped. Inputs and outputs keep their layout (NHWC), with a
transposition at either end; between them is ONNX's (NCHW). The weights are copied as they are:
float16 stays float16, and ONNX Runtime widens and transposes them once, when it loads the model.
Needs Python 3 alone.

Only the operators of the detector's network are known. Any other operator, layout or padding, and
a file of weights of another size, is an error: nothing is converted in part.
"""
import base64
import json
import math
import pathlib
import struct
import sys

OPSET = 18  # the first whose Resize can leave axes out
IR_VERSION = 8
FLOAT, INT64, FLOAT16 = 1, 7, 10  # TensorProto.DataType
TO_NCHW, TO_NHWC = (0, 3, 1, 2), (0, 2, 3, 1)  # permutations of axes
NCHW_AXIS = {0: 0, 1: 2, 2: 3, 3: 1}  # of an axis in NHWC


class ConversionError(Exception):
    """The graph has something that this converter does not know."""


# Messages of protobuf, written by hand: field numbers are those of onnx.proto.


def varint(value):
    value &= (1 << 64) - 1  # negative numbers: two's complement, ten bytes
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def number(field, value):
    return varint(field << 3) + varint(value)


def text(field, value):
    value = value.encode() if isinstance(value, str) else value
    return varint(field << 3 | 2) + varint(len(value)) + value


def attribute(name, value):
    if isinstance(value, int):
        return text(5, text(1, name) + number(3, value) + number(20, 2))
    if isinstance(value, str):
        return text(5, text(1, name) + text(4, value) + number(20, 3))
    return text(5, text(1, name) + b"".join(number(8, item) for item in value) + number(20, 7))


def node(operator, inputs, output, **attributes):
    return text(1, b"".join(text(1, name) for name in inputs) + text(2, output) + text(3, output)
                + text(4, operator)
                + b"".join(attribute(name, value) for name, value in attributes.items()))


def tensor(name, data_type, shape, raw):
    return text(5, b"".join(number(1, size) for size in shape) + number(2, data_type)
                + text(8, name) + text(9, raw))


def value_info(field, name, shape):
    sizes = b"".join(text(1, number(1, size)) for size in shape)
    return text(field, text(1, name) + text(2, text(1, number(1, FLOAT) + text(2, sizes))))


# Attributes of a node of the graph model.


def strings(entry, name):
    listed = entry.get("attr", {}).get(name, {}).get("list", {}).get("s", [])
    return [base64.b64decode(item).decode() for item in listed]


def string(entry, name):
    return base64.b64decode(entry["attr"][name]["s"]).decode()


def numbers(entry, name):
    return [int(item) for item in entry["attr"][name]["list"]["i"]]


def sizes_of(shape):
    return [int(dim["size"]) for dim in shape.get("dim", [])]


def is_set(entry, name):
    return entry.get("attr", {}).get(name, {}).get("b", False)


def read_weights(model, folder):
    """Returns {name: (data type, shape, bytes)}; the data type is that of the file."""
    weights = {}
    for group in model["weightsManifest"]:
        data = b"".join((folder / path).read_bytes() for path in group["paths"])
        at = 0
        for entry in group["weights"]:
            stored = entry.get("quantization", {}).get("dtype", entry["dtype"])
            if stored not in ("float16", "float32", "int32"):
                raise ConversionError(f"{entry['name']}: weights are {stored}")
            size = math.prod(entry["shape"]) * (2 if stored == "float16" else 4)
            if at + size > len(data):
                raise ConversionError(f"{entry['name']}: the file of weights is too short")
            weights[entry["name"]] = (stored, entry["shape"], data[at:at + size])
            at += size
        if at != len(data):
            raise ConversionError(f"the file of weights has {len(data) - at} bytes too many")
    return weights


class Converter:
    """Converts the nodes that the outputs need, in the order of the graph model."""

    def __init__(self, model, folder, renamed):
        self.renamed = renamed  # input: its name in ONNX
        self.weights = read_weights(model, folder)
        self.entries = {entry["name"]: entry for entry in model["modelTopology"]["node"]}
        self.nodes, self.initializers, self.inputs = [], [], []
        self.names = {}  # tensor of the graph model: its name in ONNX, in NCHW if it has four axes

    # Constants.

    def integers(self, name):
        stored, _, raw = self.weights[name]
        if stored != "int32":
            raise ConversionError(f"{name}: {stored} in place of int32")
        return list(struct.unpack(f"<{len(raw) // 4}i", raw))

    def add_integers(self, name, values):
        self.initializers.append(tensor(name, INT64, [len(values)],
                                        struct.pack(f"<{len(values)}q", *values)))
        return name

    def weight(self, name, perm=None):
        """Returns the name of a constant as floats, with its axes in this order."""
        made = name if perm is None else f"{name}/{''.join(map(str, perm))}"
        if made in self.names:
            return self.names[made]
        stored, shape, raw = self.weights[name]
        if stored == "int32":
            raise ConversionError(f"{name}: int32 in place of floats")
        if perm is None and len(shape) > 1:
            raise ConversionError(f"{name}: a constant of {len(shape)} axes")
        self.initializers.append(
            tensor(f"{made}/stored", FLOAT16 if stored == "float16" else FLOAT, shape, raw))
        self.nodes.append(node("Cast", [f"{made}/stored"], f"{made}/floats", to=FLOAT))
        self.names[made] = f"{made}/floats"
        if perm is not None:
            self.nodes.append(node("Transpose", [f"{made}/floats"], made, perm=perm))
            self.names[made] = made
        return self.names[made]

    # Operators.

    def convert(self, name):
        """Converts a tensor and what it needs, and returns its name in ONNX."""
        waiting = [name]
        while waiting:
            entry = self.entry(waiting[-1])
            needed = [item for item in entry.get("input", [])
                      if self.entry(item)["op"] != "Const" and item not in self.names]
            if needed:
                waiting += needed
            elif waiting.pop() not in self.names:
                self.names[entry["name"]] = self.convert_node(entry)
        return self.names[name]

    def entry(self, name):
        if name not in self.entries:
            raise ConversionError(f"the graph has no tensor {name}")
        return self.entries[name]

    def read(self, name):
        return self.names[name] if name in self.names else self.weight(name)

    def convert_node(self, entry):
        plain = {"Add": "Add", "Mul": "Mul", "Relu": "Relu", "Sigmoid": "Sigmoid",
                 "Identity": "Identity"}
        operator, name = entry["op"], entry["name"]
        inputs = entry.get("input", [])
        if operator in plain:
            self.nodes.append(node(plain[operator], [self.read(item) for item in inputs], name))
        elif operator == "Relu6":
            self.nodes.append(node("Clip", [self.read(inputs[0]), *self.limits()], name))
        elif operator in ("Conv2D", "_FusedConv2D", "DepthwiseConv2dNative",
                          "FusedDepthwiseConv2dNative"):
            self.convolution(entry)
        elif operator == "ConcatV2":
            axis = self.axis(inputs[-1])
            self.nodes.append(node("Concat", [self.read(item) for item in inputs[:-1]], name,
                                   axis=axis))
        elif operator == "Mean":
            self.mean(entry)
        elif operator == "ResizeBilinear":
            self.resize(entry)
        elif operator == "Placeholder":
            self.placeholder(entry)
        else:
            raise ConversionError(f"{name}: unknown operator {operator}")
        return name

    def limits(self):
        if "clip/0" not in self.names:
            for value in (0, 6):
                self.initializers.append(tensor(f"clip/{value}", FLOAT, [],
                                                struct.pack("<f", value)))
                self.names[f"clip/{value}"] = f"clip/{value}"
        return ["clip/0", "clip/6"]

    def axis(self, name):
        (axis,) = self.integers(name)
        if axis not in NCHW_AXIS:
            raise ConversionError(f"{name}: axis {axis}")
        return NCHW_AXIS[axis]

    def placeholder(self, entry):
        shape = sizes_of(entry["attr"]["shape"]["shape"])
        if len(shape) != 4 or min(shape) < 1:
            raise ConversionError(f"{entry['name']}: an input of shape {shape}")
        if entry["name"] not in self.renamed:
            raise ConversionError(f"{entry['name']}: an input without a NAME")
        name = self.renamed[entry["name"]]
        self.inputs.append(value_info(11, name, shape))
        self.nodes.append(node("Transpose", [name], entry["name"], perm=TO_NCHW))

    def convolution(self, entry):
        name, inputs = entry["name"], entry["input"]
        if string(entry, "data_format") != "NHWC":
            raise ConversionError(f"{name}: layout {string(entry, 'data_format')}")
        padding = {"SAME": "SAME_UPPER", "VALID": "VALID"}.get(string(entry, "padding"))
        fused = strings(entry, "fused_ops")
        if padding is None or fused not in ([], ["BiasAdd"], ["BiasAdd", "Relu"],
                                            ["BiasAdd", "Relu6"]):
            raise ConversionError(f"{name}: padding {string(entry, 'padding')}, fused {fused}")
        depthwise = "Depthwise" in entry["op"]
        shape = self.weights[inputs[1]][1]  # height, width, inputs, outputs (of an input)
        if depthwise and shape[3] != 1:
            raise ConversionError(f"{name}: {shape[3]} outputs for an input")
        out = name if len(fused) < 2 else f"{name}/sum"
        operands = [self.read(inputs[0]), self.weight(inputs[1], (2, 3, 0, 1) if depthwise
                                                      else (3, 2, 0, 1))]
        if fused:
            operands.append(self.weight(inputs[2]))
        self.nodes.append(node("Conv", operands, out, auto_pad=padding, kernel_shape=shape[:2],
                               strides=numbers(entry, "strides")[1:3],
                               dilations=numbers(entry, "dilations")[1:3],
                               group=shape[2] if depthwise else 1))
        if fused[1:] == ["Relu"]:
            self.nodes.append(node("Relu", [out], name))
        elif fused[1:] == ["Relu6"]:
            self.nodes.append(node("Clip", [out, *self.limits()], name))

    def mean(self, entry):
        name, (values, axes) = entry["name"], entry["input"]
        if not is_set(entry, "keep_dims"):
            raise ConversionError(f"{name}: a mean that drops axes")
        listed = self.add_integers(f"{name}/axes", [NCHW_AXIS[i] for i in self.integers(axes)])
        self.nodes.append(node("ReduceMean", [self.read(values), listed], name))

    def resize(self, entry):
        name, (values, sizes) = entry["name"], entry["input"]
        if is_set(entry, "align_corners"):
            raise ConversionError(f"{name}: align_corners")
        mode = "half_pixel" if is_set(entry, "half_pixel_centers") else "asymmetric"
        listed = self.add_integers(f"{name}/sizes", self.integers(sizes))
        self.nodes.append(node("Resize", [self.read(values), "", "", listed], name, axes=(2, 3),
                               mode="linear", coordinate_transformation_mode=mode))


def convert(model, folder, renamed):
    """Returns the bytes of the ONNX model. renamed: {tensor: name of the input or output}."""
    converter = Converter(model, folder, renamed)
    infos = b""
    signature = model.get("signature", {})
    for tensor_name, name in renamed.items():
        if tensor_name in signature.get("inputs", {}):
            continue
        if tensor_name not in signature.get("outputs", {}):
            raise ConversionError(f"the model has no input or output {tensor_name}")
        shape = sizes_of(signature["outputs"][tensor_name]["tensorShape"])
        inner = converter.convert(tensor_name)
        converter.nodes.append(node("Transpose", [inner], name, perm=TO_NHWC))
        infos += value_info(12, name, shape)
    graph = (b"".join(converter.nodes) + text(2, "detector") + b"".join(converter.initializers)
             + b"".join(converter.inputs) + infos)
    return (number(1, IR_VERSION) + text(2, "pepeseg") + text(7, graph)
            + text(8, text(1, "") + number(2, OPSET)))


def main():
    if len(sys.argv) < 4 or not all("=" in word for word in sys.argv[3:]):
        sys.exit(__doc__)
    source = pathlib.Path(sys.argv[1])
    renamed = {tensor_name: name for name, tensor_name in
               (word.split("=", 1) for word in sys.argv[3:])}
    try:
        made = convert(json.loads(source.read_text(encoding="utf-8")), source.parent, renamed)
    except (ConversionError, KeyError, OSError, TypeError, ValueError) as error:
        sys.exit(f"graph_model_to_onnx.py: {source}: {type(error).__name__}: {error}")
    pathlib.Path(sys.argv[2]).write_bytes(made)


if __name__ == "__main__":
    main()
