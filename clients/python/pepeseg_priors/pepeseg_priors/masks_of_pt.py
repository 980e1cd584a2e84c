"""Converts masks that PyTorch saved to the format of a pepeseg upload.

SA3D, SAGA and others keep the masks of a photograph as a tensor [masks, height, width] in STEM.pt.

    python -m pepeseg_priors.masks_of_pt sam_masks/ --photos garden/images --out garden
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Optional, Sequence

from pepeseg_priors import files
from pepeseg_priors.cli import FAILED, MISSING_MODULE, missing_modules
from pepeseg_priors.photos import Photo, list_photos

if TYPE_CHECKING:
    import numpy as np


def resize_mask(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """Returns the mask with the size of its photograph, by nearest neighbour."""
    import numpy as np

    rows = ((np.arange(height) + 0.5) * mask.shape[0] / height).astype(int)
    columns = ((np.arange(width) + 0.5) * mask.shape[1] / width).astype(int)
    return np.asarray(mask[rows][:, columns])


def convert(masks: np.ndarray, size: tuple[int, int], name: str) -> list[files.Mask]:
    """Returns the masks of a photograph of `size` (width, height). Raises ValueError, naming the
    file, if the array is not [masks, height, width] or has another aspect ratio."""
    import numpy as np

    if masks.ndim != 3:
        raise ValueError(f"{name}: the shape is {masks.shape}, not (masks, height, width)")
    width, height = size
    if abs(masks.shape[2] * height / masks.shape[1] - width) > 1 + 0.01 * width:
        raise ValueError(
            f"{name}: masks of {masks.shape[2]}x{masks.shape[1]} pixels, the photograph has "
            f"{width}x{height}: not of one shape"
        )
    return [files.Mask(resize_mask(np.asarray(mask) > 0, width, height), None) for mask in masks]


def _size_of(photo: Photo) -> tuple[int, int]:
    from PIL import Image

    with Image.open(photo.path) as image:
        return image.size


def _load(path: Path) -> np.ndarray:
    """Reads a tensor. weights_only: a file from elsewhere must not run code."""
    import torch

    tensor: Any = torch.load(path, map_location="cpu", weights_only=True)
    if not hasattr(tensor, "numpy"):
        raise ValueError(f"{path}: a tensor is expected, the file has a {type(tensor).__name__}")
    array: np.ndarray = tensor.numpy()
    return array


def run(folder: Path, photos: Path, out: Path, load: Callable[[Path], np.ndarray] = _load) -> int:
    """Converts FOLDER/STEM.pt of each photograph and returns the number of files. Raises ValueError
    if none of the photographs has a file, or a file does not fit its photograph."""
    listed = list_photos(photos)
    done = 0
    for photo in listed:
        path = folder / f"{photo.stem}.pt"
        if not path.is_file():
            continue
        files.write_masks(out, photo.stem, convert(load(path), _size_of(photo), str(path)))
        done += 1
    if done == 0:
        raise ValueError(f"{folder} has no masks of a photograph: expected {listed[0].stem}.pt")
    return done


def main(arguments: Optional[Sequence[str]] = None) -> int:
    parser = argparse.ArgumentParser(prog="pepeseg_priors.masks_of_pt", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of STEM.pt")
    parser.add_argument("--photos", type=Path, required=True, help="folder of photographs")
    parser.add_argument("--out", type=Path, required=True, help="folder for masks/")
    options = parser.parse_args(arguments)
    missing = missing_modules(["numpy", "PIL", "torch"])
    if missing:
        print(f"{', '.join(missing)} cannot be imported", file=sys.stderr)
        return MISSING_MODULE
    try:
        print(f"{run(options.folder, options.photos, options.out)} files of masks")
    except (ValueError, OSError, RuntimeError) as error:
        print(f"pepeseg_priors.masks_of_pt: {error}", file=sys.stderr)
        return FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main())
