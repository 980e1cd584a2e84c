"""Reads folders of other programs as datasets: nerfstudio's (and instant-ngp's), and COLMAP's.

    client.upload(importers.nerfstudio("garden"))

Photographs that the poses name and that do not exist are in `Dataset.missing`; `upload` warns of
them.
"""

from __future__ import annotations

import json
import os
from pathlib import Path, PurePosixPath
import struct
from typing import Any

from pepeseg.dataset import (
    Dataset,
    DatasetFile,
    FileKind,
    colmap_kind,
    is_photograph,
    is_system_file,
    kind_of,
    list_files,
    plain_path,
)
from pepeseg.errors import not_there, refused

_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".webp", ".PNG", ".JPG", ".JPEG")


def _find(root: Path, path: str) -> Path | None:
    """Returns the file that a frame names, relative to the folder, with or without its suffix."""
    for suffix in _SUFFIXES:
        found = root / (path.replace("\\", "/") + suffix)
        if found.is_file():
            return found
    return None


def _below(name: str, folder: str) -> str:
    return name.removeprefix(folder + "/")


def _read_frames(file: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Returns the document and its frames, each of which has a "file_path"."""
    try:
        document = json.loads(file.read_bytes())
    except ValueError as error:
        raise refused(f"{file}: is not JSON, or cut short: {error}") from error
    frames = document.get("frames") if isinstance(document, dict) else None
    if not isinstance(frames, list):
        raise refused(f'{file}: has no list of "frames"')
    for i, frame in enumerate(frames):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise refused(f'{file}: frame {i}: has no "file_path"')
    return document, frames


class _Frames:
    """Collects the files of a nerfstudio folder, frame by frame."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.files: dict[str, DatasetFile] = {}
        self.missing: list[str] = []
        self._used: set[Path] = set()

    def put(self, name: str, kind: FileKind, path: Path) -> None:
        self.files.setdefault(name, DatasetFile(name, kind, path))
        self._used.add(path.resolve())

    def put_named(self, path: Any, kind: FileKind) -> None:
        """Puts a file that transforms.json names by its path, under that name."""
        if isinstance(path, str) and (self.root / path.replace("\\", "/")).is_file():
            self.put(plain_path(path), kind, self.root / path.replace("\\", "/"))

    def take(self, frame: dict[str, Any]) -> None:
        photograph = _find(self.root, frame["file_path"])
        if photograph is None:
            self.missing.append(frame["file_path"])
            return
        # The name gets the file's suffix.
        plain = PurePosixPath(plain_path(frame["file_path"]))
        key = _below(plain.with_name(photograph.name).as_posix(), "images")
        self.put(f"images/{key}", FileKind.IMAGE, photograph)
        depth = frame.get("depth_file_path")
        if isinstance(depth, str) and (self.root / depth).is_file():
            path = self.root / depth
            name = PurePosixPath("depth", key).with_suffix(path.suffix.lower())
            self.put(name.as_posix(), FileKind.DEPTH, path)
        self.put_named(frame.get("mask_path"), FileKind.MASK)

    def take_rest(self) -> list[str]:
        """Puts the other files that belong to the layout. Returns the names of the rest."""
        left_out = []
        for name in list_files(self.root):
            path = self.root / name
            kind = kind_of(name)
            if path.resolve() in self._used or is_system_file(name):
                continue
            beside = kind in (FileKind.MASK, FileKind.IGNORE_MASK, FileKind.POINTS)
            if beside and not name.startswith("sparse/") and path.is_file():
                self.put(name, kind or FileKind.POINTS, path)
            else:
                left_out.append(name)
        return left_out


def nerfstudio(folder: str | os.PathLike[str]) -> Dataset:
    """Reads a folder with a transforms.json of nerfstudio or instant-ngp.

    Takes the photographs that its frames name (with or without a suffix), their depth maps
    ("depth_file_path", far is large), their masks ("mask_path": the server ignores the pixels of
    value 0, and makes no segments of them), the points ("ply_file_path"), and masks/,
    ignore_mask.png and ignore/ if they exist.

    Raises:
        NotFoundError: no such folder, no transforms.json in it, or none of its photographs.
        InvalidArgumentError: transforms.json is not such a file.
    """
    root = Path(folder)
    transforms = root / "transforms.json"
    if not transforms.is_file():
        raise not_there(f"{root}: no transforms.json in it")
    document, frames = _read_frames(transforms)
    found = _Frames(root)
    found.put("transforms.json", FileKind.POSES, transforms)
    for frame in frames:
        found.take(frame)
    if not any(file.kind == FileKind.IMAGE for file in found.files.values()):
        named = found.missing[0] if found.missing else "no frames"
        raise not_there(f"{transforms}: none of its photographs is there: {named}")
    found.put_named(document.get("mask_path"), FileKind.MASK)
    found.put_named(document.get("ply_file_path"), FileKind.POINTS)
    left_out = found.take_rest()
    files = sorted(found.files.values(), key=lambda file: file.name)
    return Dataset(files, left_out, found.missing)


def _names_in_binary(data: bytes) -> list[str]:
    """Returns the names in images.bin: a count, then records of id, pose, camera, name, points."""
    names = []
    (count,) = struct.unpack_from("<Q", data)
    at = 8
    for _ in range(count):
        start = at + struct.calcsize("<I7dI")
        end = data.index(b"\0", start)
        names.append(data[start:end].decode())
        (num_points,) = struct.unpack_from("<Q", data, end + 1)
        at = end + 9 + 24 * num_points
        if at > len(data):
            raise ValueError("it is cut short")
    return names


def _are_points(words: list[str]) -> bool:
    try:
        return len(words) % 3 == 0 and all(float(word) is not None for word in words)
    except ValueError:
        return False


def _names_in_text(data: bytes) -> list[str]:
    """Returns the names in images.txt. The line of 2D points after an image, numbers in threes, may
    be empty or missing."""
    names = []
    after_image = False
    for line in data.decode("utf-8-sig").splitlines():
        parts = line.split(maxsplit=9)
        is_points = after_image and (not parts or _are_points(line.split()))
        after_image = not is_points and bool(parts) and not line.startswith("#")
        if after_image:
            names.append(parts[9].strip())
    return names


def _read_names(images: Path) -> list[str]:
    try:
        data = images.read_bytes()
        return _names_in_binary(data) if images.suffix == ".bin" else _names_in_text(data)
    except (ValueError, IndexError, struct.error) as error:
        raise refused(f"{images}: is no such file of COLMAP's: {error}") from error


def _find_model(root: Path) -> Path:
    for folder in (root / "sparse" / "0", root / "sparse", root / "colmap" / "sparse" / "0", root):
        for suffix in (".bin", ".txt"):
            if all((folder / f"{stem}{suffix}").is_file() for stem in ("cameras", "images")):
                return folder
    raise not_there(f"{root}: no cameras and images, .bin or .txt, in it or its sparse/0 or sparse")


def _photographs(names: list[str], images: Path) -> tuple[dict[str, DatasetFile], list[str]]:
    files, missing = {}, []
    for name in names:
        key = plain_path(name)
        if (images / name).is_file() and is_photograph(name):
            files[f"images/{key}"] = DatasetFile(f"images/{key}", FileKind.IMAGE, images / name)
        else:
            missing.append(name)
    return files, missing


def colmap(folder: str | os.PathLike[str], images: str | os.PathLike[str] | None = None) -> Dataset:
    """Reads a COLMAP model (.bin or .txt, in the folder or its sparse/0, sparse or colmap/sparse/0)
    with its photographs.

    Takes the photographs that have a pose, points3D, and the folder's masks/, ignore_mask.png,
    ignore/, depth/ and disparity/ if they exist.

    Args:
        images: folder of the photographs; None: images/ in the folder, else the folder itself.

    Raises:
        NotFoundError: no such folder, no model in it, or none of its photographs.
        InvalidArgumentError: its images.bin or images.txt is damaged.
    """
    root = Path(folder)
    model = _find_model(root)
    suffix = (
        ".bin" if all((model / f"{s}.bin").is_file() for s in ("cameras", "images")) else ".txt"
    )
    names = _read_names(model / f"images{suffix}")
    below = root / "images"
    source = Path(images) if images is not None else below if below.is_dir() else root
    files, missing = _photographs(names, source)
    if not files:
        raise not_there(f"{source}: none of the model's photographs is there: {missing[:1]}")
    for stem in ("cameras", "images", "points3D"):
        path = model / f"{stem}{suffix}"
        kind = colmap_kind(path.name)
        if kind is not None and path.is_file():
            files[f"sparse/0/{path.name}"] = DatasetFile(f"sparse/0/{path.name}", kind, path)
    used = {file.path.resolve() for file in files.values()}
    left_out = []
    for name in list_files(root):
        path = root / name
        kind = kind_of(name)
        beside = name.split("/")[0] in ("masks", "ignore", "ignore_mask.png", "depth", "disparity")
        if kind is not None and beside and path.is_file():
            files[name] = DatasetFile(name, kind, path)
        elif path.resolve() not in used:
            left_out.append(name)
    return Dataset(sorted(files.values(), key=lambda file: file.name), left_out, missing)
