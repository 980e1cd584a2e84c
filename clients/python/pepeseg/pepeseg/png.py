"""PNG to NumPy and back, for the kinds that the service sends: grey of 8 or 16 bits, RGB of 8."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from pepeseg.errors import damaged

_MAGIC = b"\x89PNG\r\n\x1a\n"
_MAX_PIXELS = 1 << 28


def _chunks(data: bytes) -> dict[bytes, bytes]:
    """Returns the chunks' data by type; chunks of one type are concatenated."""
    chunks: dict[bytes, bytes] = {}
    at = len(_MAGIC)
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        kind = data[at + 4 : at + 8]
        chunks[kind] = chunks.get(kind, b"") + data[at + 8 : at + 8 + size]
        at += 12 + size
    return chunks


def _paeth(row: npt.NDArray[np.uint8], above: npt.NDArray[np.uint8], step: int) -> None:
    left, up = row.tolist(), above.tolist()
    for i in range(len(left)):
        a = left[i - step] if i >= step else 0
        c = up[i - step] if i >= step else 0
        b = up[i]
        near_a, near_b, near_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
        near = a if near_a <= near_b and near_a <= near_c else b if near_b <= near_c else c
        left[i] = (left[i] + near) & 255
    row[:] = left


def _average(row: npt.NDArray[np.uint8], above: npt.NDArray[np.uint8], step: int) -> None:
    left, up = row.tolist(), above.tolist()
    for i in range(len(left)):
        left[i] = (left[i] + ((left[i - step] if i >= step else 0) + up[i]) // 2) & 255
    row[:] = left


def _undo_filters(rows: npt.NDArray[np.uint8], step: int) -> npt.NDArray[np.uint8]:
    """Undoes the filters of [height, 1 + bytes a scanline]: returns [height, bytes a scanline].
    `step`: bytes a pixel."""
    kinds, pixels = rows[:, 0], np.ascontiguousarray(rows[:, 1:])
    above = np.zeros_like(pixels[0])
    for kind, row in zip(kinds.tolist(), pixels):
        if kind == 1:
            by_channel = row.reshape(-1, step)
            np.cumsum(by_channel, axis=0, dtype=np.uint8, out=by_channel)
        elif kind == 2:
            row += above
        elif kind == 3:
            _average(row, above, step)
        elif kind == 4:
            _paeth(row, above, step)
        elif kind != 0:
            raise damaged(f"PNG: filter {kind}")
        above = row
    return pixels


def decode(data: bytes) -> npt.NDArray[Any]:
    """Returns uint8 or uint16 [height, width], or uint8 [height, width, 3].

    Raises:
        DataLossError: the bytes are not a PNG, are cut short, or are a PNG of another kind.
    """
    chunks = _chunks(data) if data.startswith(_MAGIC) else {}
    header = chunks.get(b"IHDR", b"")
    if len(header) != 13:
        raise damaged("not a PNG")
    width, height, bits, color, _, _, interlaced = struct.unpack(">IIBBBBB", header)
    if (bits, color) not in ((8, 0), (16, 0), (8, 2)) or interlaced:
        raise damaged(f"PNG of {bits} bits and colour type {color}: grey or RGB is wanted")
    channels = 3 if color == 2 else 1
    row_bytes = width * channels * bits // 8
    wanted = height * (1 + row_bytes)
    if not 0 < width * height <= _MAX_PIXELS:
        raise damaged(f"PNG of {width}x{height} pixels")
    try:
        raw = zlib.decompressobj().decompress(chunks.get(b"IDAT", b""), wanted)
    except zlib.error as error:
        raise damaged(f"PNG: {error}") from error
    if len(raw) != wanted:
        raise damaged("PNG: it is cut short")
    rows = np.frombuffer(raw, np.uint8).reshape(height, 1 + row_bytes)
    pixels = _undo_filters(rows, channels * bits // 8)
    if bits == 16:
        return pixels.view(">u2").astype(np.uint16)
    return pixels.reshape(height, width, 3) if channels == 3 else pixels


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def encode(pixels: npt.NDArray[Any]) -> bytes:
    """Returns a PNG of bool (as 0 and 255), uint8 or uint16 [height, width], or of uint8
    [height, width, 3]."""
    if pixels.dtype == np.bool_:
        pixels = pixels.astype(np.uint8) * 255
    bits = 16 if pixels.dtype == np.uint16 else 8
    height, width = pixels.shape[:2]
    values = pixels.astype(">u2" if bits == 16 else np.uint8, copy=False)
    rows = np.ascontiguousarray(values).view(np.uint8).reshape(height, -1)
    filtered = np.hstack((np.zeros((height, 1), np.uint8), rows))
    header = struct.pack(">IIBBBBB", width, height, bits, 2 if pixels.ndim == 3 else 0, 0, 0, 0)
    body = _chunk(b"IDAT", zlib.compress(filtered.tobytes(), 1))
    return _MAGIC + _chunk(b"IHDR", header) + body + _chunk(b"IEND", b"")


class Picture:
    """Pixels that a notebook can show, of a type and shape that `encode` takes."""

    def __init__(self, pixels: npt.NDArray[Any]) -> None:
        self._pixels = pixels

    def _repr_png_(self) -> bytes:
        return encode(self._pixels)
