"""The output files: masks as SAM's automatic generator writes them, and depth maps as NPY.

A file gets its name when it is complete, so that an interrupted run can be resumed.
"""

from __future__ import annotations

import io
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

# Longest side of a depth map, pixels. Networks see about 518 pixels; more would only fill the disk.
MAX_DEPTH_SIDE = 1024


@dataclass(frozen=True)
class Mask:
    pixels: np.ndarray  # [height, width], bool
    score: float | None  # the model's own estimate of its IoU; None: not known


@dataclass(frozen=True)
class DepthMap:
    values: np.ndarray  # [height, width], float32, of any scale
    far_is_large: bool  # depth; else disparity, where near is large


def encode_rle(pixels: np.ndarray) -> dict[str, Any]:
    """Returns COCO's uncompressed run lengths: down the columns, beginning with a run of zeros."""
    import numpy as np

    height, width = pixels.shape
    flat = np.asarray(pixels, dtype=bool).ravel(order="F")
    edges = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    bounds = np.concatenate(([0], edges, [flat.size]))
    counts = np.diff(bounds).tolist()
    if flat.size and flat[0]:
        counts.insert(0, 0)
    return {"size": [int(height), int(width)], "counts": counts}


def describe_mask(mask: Mask) -> dict[str, Any]:
    """Returns an element of SAM's list. Its `bbox` is x, y, width, height."""
    import numpy as np

    rows = np.flatnonzero(mask.pixels.any(axis=1))
    columns = np.flatnonzero(mask.pixels.any(axis=0))
    height, width = mask.pixels.shape
    described = {
        "segmentation": encode_rle(mask.pixels),
        "area": int(mask.pixels.sum()),
        "bbox": [
            int(columns[0]),
            int(rows[0]),
            int(columns[-1] - columns[0] + 1),
            int(rows[-1] - rows[0] + 1),
        ],
        "crop_box": [0, 0, int(width), int(height)],
    }
    if mask.score is not None:
        described["predicted_iou"] = float(mask.score)
    return described


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file that gets its name when it is complete."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.write_bytes(content)
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def write_masks(out: Path, stem: str, masks: list[Mask]) -> None:
    """Writes the masks of a photograph. Masks without a pixel are left out."""
    listed = [describe_mask(mask) for mask in masks if mask.pixels.any()]
    text = json.dumps(listed, separators=(",", ":"), allow_nan=False)
    write_whole(out / "masks" / f"{stem}.json", text.encode())


def fit_depth(values: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resizes a map to the photograph's shape, with a longest side of at most MAX_DEPTH_SIDE."""
    import numpy as np
    from PIL import Image

    shrink = min(1.0, MAX_DEPTH_SIDE / max(width, height))
    size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
    image = Image.fromarray(np.ascontiguousarray(values, dtype=np.float32))  # mode F
    return np.asarray(image.resize(size, Image.BILINEAR), dtype="<f4")


def write_depth(out: Path, stem: str, depth: DepthMap, size: tuple[int, int]) -> None:
    """Writes the depth or disparity of a photograph. `size`: the photograph's width and height."""
    import numpy as np

    if not np.isfinite(depth.values).all():
        raise ValueError(f"the depth of {stem} is not finite")
    buffer = io.BytesIO()
    np.save(buffer, fit_depth(depth.values, *size), allow_pickle=False)
    folder = "depth" if depth.far_is_large else "disparity"
    write_whole(out / folder / f"{stem}.npy", buffer.getvalue())


def has_masks(out: Path, stem: str) -> bool:
    return any((out / "masks" / (stem + suffix)).is_file() for suffix in (".json", ".png", ".npy"))


def has_depth(out: Path, stem: str) -> bool:
    return any(
        (out / folder / (stem + suffix)).is_file()
        for folder in ("depth", "disparity")
        for suffix in (".npy", ".png", ".pfm")
    )
