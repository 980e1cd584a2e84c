"""COCO's compressed run lengths, in which masks are sent and received."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pepeseg.errors import damaged, refused
from pepeseg.v1 import prompt_pb2

BoolMask = npt.NDArray[np.bool_]

_MAX_PIXELS = 1 << 30
# Maximum number of characters of a run length: five bits each, and a run has at most 2^30 pixels.
_MAX_DIGITS = 7


def _parse_counts(text: str) -> npt.NDArray[np.int64]:
    """Returns the numbers of the string. A number has five bits a character, lowest first; bit 5
    says that more follow, bit 4 of the last character that the number is negative."""
    digits = np.frombuffer(text.encode("latin-1", errors="replace"), np.uint8).astype(np.int64) - 48
    if digits.size == 0:
        return np.zeros(0, np.int64)
    if digits.min() < 0 or digits.max() > 63 or digits[-1] & 32:
        raise damaged("mask: the run lengths are cut short, or are not run lengths")
    ends = np.flatnonzero((digits & 32) == 0)
    starts = np.append(0, ends[:-1] + 1)
    lengths = ends - starts + 1
    if lengths.max() > _MAX_DIGITS:
        raise damaged("mask: a run length is too large")
    places = np.arange(digits.size) - np.repeat(starts, lengths)
    values: npt.NDArray[np.int64] = np.add.reduceat((digits & 31) << (5 * places), starts)
    negative = (digits[ends] & 16) != 0
    values[negative] -= 1 << (5 * lengths[negative])
    return values


def decode(rle: prompt_pb2.CocoRle) -> BoolMask:
    """Returns the mask, bool [height, width].

    Raises:
        DataLossError: the run lengths do not fill a mask of that size.
    """
    height, width = rle.height, rle.width
    if height < 0 or width < 0 or height * width > _MAX_PIXELS:
        raise damaged(f"mask of {width}x{height} pixels")
    counts = _parse_counts(rle.counts)
    # From the fourth on, each number is the difference to the one two before it.
    np.cumsum(counts[1::2], out=counts[1::2])
    np.cumsum(counts[2::2], out=counts[2::2])
    if counts.size and counts.min() < 0 or counts.sum() != height * width:
        raise damaged(f"mask: the runs do not fill {width}x{height} pixels")
    return _fill(np.cumsum(counts)[:-1], height, width)


def _fill(borders: npt.NDArray[np.int64], height: int, width: int) -> BoolMask:
    """Returns the mask whose runs, down the columns, end at `borders`; the first run is of zeros.

    A pixel differs from the one above it where a border is. So scanlines follow from the first one
    by exclusive or, eight pixels at once, and no array has to be filled by columns and transposed.
    """
    if height * width == 0:
        return np.zeros((height, width), np.bool_)
    if (np.diff(borders) == 0).any():  # runs of length 0: two equal borders cancel out
        places, times = np.unique(borders, return_counts=True)
        borders = places[times % 2 == 1]
    borders = borders[borders < height * width]
    changes = np.zeros((height, -(-width // 8) * 8), np.uint8)
    changes[0, :width] = np.searchsorted(borders, np.arange(0, height * width, height)) & 1
    columns, rows = np.divmod(borders, height)
    changes[rows, columns] ^= 1
    words = changes.view(np.uint64)
    np.bitwise_xor.accumulate(words, axis=0, out=words)
    return np.ascontiguousarray(changes[:, :width]).view(np.bool_)


def _write_count(value: int) -> str:
    text = ""
    while True:
        digit = value & 31
        value >>= 5
        more = value != (-1 if digit & 16 else 0)
        text += chr(48 + digit + (32 if more else 0))
        if not more:
            return text


def encode(mask: npt.ArrayLike) -> prompt_pb2.CocoRle:
    """Returns the run lengths of a mask [height, width], of which pixels that are not 0 are inside.

    Raises:
        InvalidArgumentError: it has another number of dimensions, or no pixels.
    """
    pixels = np.asarray(mask)
    if pixels.ndim != 2 or pixels.size == 0:
        raise refused(f"mask: [height, width] is wanted, this is {list(pixels.shape)}")
    columns = (pixels != 0).ravel(order="F")
    edges = np.flatnonzero(columns[1:] != columns[:-1]) + 1
    runs = np.diff(edges, prepend=0, append=columns.size)
    counts: list[int] = [0] * int(columns[0]) + runs.tolist()
    text = "".join(
        _write_count(count - counts[i - 2] if i > 2 else count) for i, count in enumerate(counts)
    )
    return prompt_pb2.CocoRle(height=pixels.shape[0], width=pixels.shape[1], counts=text)
