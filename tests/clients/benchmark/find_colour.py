#!/usr/bin/env python3
"""A fake text command (server/worker_protocol/text_task.h): finds what is red.

    find_colour.py --photos FOLDER --text TEXT --out FOLDER

For a text with the word "red", the box of the pixels that are much more red than green and blue.
"""

import json
import os
import struct
import sys
import zlib

photos, text, out = sys.argv[2:7:2]


def read_png(path):
    """Returns the scanlines of an 8-bit RGB image, each a bytearray."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed, width, height = 8, b"", 0, 0
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height = struct.unpack(">II", body[:8])
        elif kind == b"IDAT":
            packed += body
        at += size + 12
    raw, stride = zlib.decompress(packed), 3 * width
    rows, above = [], bytearray(stride)
    for y in range(height):
        kind = raw[y * (stride + 1)]
        row = bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left = row[i - 3] if i >= 3 else 0
            corner = above[i - 3] if i >= 3 else 0
            up = above[i]
            if kind == 1:
                guess = left
            elif kind == 2:
                guess = up
            elif kind == 3:
                guess = (left + up) // 2
            elif kind == 4:
                distances = [abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)]
                guess = (left, up, corner)[distances.index(min(distances))]
            else:
                guess = 0
            row[i] = (row[i] + guess) % 256
        rows.append(row)
        above = row
    return rows


for name in os.listdir(photos) if "red" in text.split() else []:
    inside = [(x, y) for y, row in enumerate(read_png(os.path.join(photos, name)))
              for x in range(len(row) // 3)
              if row[3 * x] > 1.8 * max(row[3 * x + 1], row[3 * x + 2], 20)]
    if len(inside) < 20:
        continue
    xs, ys = zip(*inside)
    box = [min(xs), min(ys), max(xs) + 1, max(ys) + 1]
    with open(os.path.join(out, os.path.splitext(name)[0] + ".json"), "w") as file:
        json.dump([{"score": 0.9, "box": box}], file)
