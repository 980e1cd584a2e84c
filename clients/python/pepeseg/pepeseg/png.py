"""PNG to NumPy and back, for the kinds that the service sends: grey of 8 or 16 bits, RGB of 8."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, PngImagePlugin

from pepeseg.errors import damaged

_MAX_PIXELS = 1 << 28


def decode(data: bytes) -> npt.NDArray[Any]:
    """Returns uint8 or uint16 [height, width], or uint8 [height, width, 3].

    Raises:
        DataLossError: the bytes are not a PNG, are cut short, or are a PNG of another kind.
    """
    try:
        # Not by Image.open, which refuses pictures of more than 179 megapixels.
        file = PngImagePlugin.PngImageFile(io.BytesIO(data))
        kind, size = file.mode, file.width * file.height
        pixels = np.asarray(file) if size <= _MAX_PIXELS else None
    except (OSError, SyntaxError, ValueError, IndexError, struct.error) as error:
        raise damaged(f"PNG: {error}") from error
    if pixels is None:
        raise damaged(f"PNG of {file.width}x{file.height} pixels")
    if kind not in ("L", "RGB", "I", "I;16"):
        raise damaged(f"PNG of mode {kind}: grey or RGB is wanted")
    return pixels.astype(np.uint16) if kind.startswith("I") else pixels


def encode(pixels: npt.NDArray[Any]) -> bytes:
    """Returns a PNG of bool (as 0 and 255), uint8 or uint16 [height, width], or of uint8
    [height, width, 3]."""
    if pixels.dtype == np.bool_:
        pixels = pixels.astype(np.uint8) * 255
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, "PNG", compress_level=1)
    return file.getvalue()


class Picture:
    """Pixels that a notebook can show, of a type and shape that `encode` takes."""

    def __init__(self, pixels: npt.NDArray[Any]) -> None:
        self._pixels = pixels

    def _repr_png_(self) -> bytes:
        return encode(self._pixels)
