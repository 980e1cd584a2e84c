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
    stem: str  # path below the folder, with "/" and without suffix: names its masks and depth


def list_photos(folder: Path) -> list[Photo]:
    """Lists the photographs, by name. Raises ValueError if there are none, or if two differ in
    their suffix only."""
    photos: dict[str, Photo] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in SUFFIXES or not path.is_file():
            continue
        stem = path.relative_to(folder).with_suffix("").as_posix()
        if stem in photos:
            raise ValueError(
                f"{path} and {photos[stem].path} differ in their suffix only, so that their masks "
                "would have the same name; rename one of them"
            )
        photos[stem] = Photo(path, stem)
    if not photos:
        raise ValueError(f"no photographs ({', '.join(SUFFIXES)}) in {folder}")
    return list(photos.values())


def read_photo(photo: Photo) -> np.ndarray:
    """Returns [height, width, 3], RGB of 8 bits, as the file stores it, without turning it by EXIF,
    as pepeseg's own import does."""
    import numpy as np
    from PIL import Image

    with Image.open(photo.path) as image:
        return np.asarray(image.convert("RGB"))
