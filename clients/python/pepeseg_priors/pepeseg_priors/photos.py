"""The photographs of a folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp")


@dataclass(frozen=True)
class Photo:
    path: Path
    stem: str  # below the folder, with "/", without suffix: what its masks and depth are named by


def list_photos(folder: Path) -> list[Photo]:
    """By name. ValueError: none, or two that differ in nothing but the suffix."""
    photos: dict[str, Photo] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in SUFFIXES or not path.is_file():
            continue
        stem = path.relative_to(folder).with_suffix("").as_posix()
        if stem in photos:
            raise ValueError(
                f"{path} and {photos[stem].path} have one name but for the suffix: "
                "masks could not be told apart"
            )
        photos[stem] = Photo(path, stem)
    if not photos:
        raise ValueError(f"no photographs ({', '.join(SUFFIXES)}) in {folder}")
    return list(photos.values())


def read_photo(photo: Photo) -> np.ndarray:
    """[height, width, 3], RGB of 8 bits, as the file stores its rows: no turning by EXIF, as in
    pepeseg's own import."""
    import numpy as np
    from PIL import Image

    with Image.open(photo.path) as image:
        return np.asarray(image.convert("RGB"))
