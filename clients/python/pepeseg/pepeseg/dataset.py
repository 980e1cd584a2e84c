"""Which files of a folder are part of a dataset, and what each is, as in `pepeseg upload`.

images/...                          photographs (.jpg .jpeg .png .webp .heic .heif), also in subfolders
videos/..., images/...              videos (.mp4 .m4v .mov .webm .mkv .avi)
sparse/N/ or sparse/                COLMAP cameras, images (poses), points3D (points)
transforms.json, poses_bounds.npy   poses by nerfstudio or instant-ngp, or by LLFF
masks/STEM.json|png|npy             SAM masks with COCO RLE, a label image, or an array [masks, height, width]
masks/STEM/NAME.png                 binary masks, one a file
ignore_mask.png, ignore/STEM.png    pixels to leave out, in all views or in one
points.ply, sparse_pc.ply           points to start from in place of COLMAP's
gaussians.ply                       3DGS's layout: replaces the reconstruction
depth/STEM.png|npy|pfm              far is large (or `depth_kind`)
disparity/STEM.png|npy|pfm          near is large

transforms.json may name its points (ply_file_path) and masks (mask_path) wherever they are: pixels of
value 0 in such masks are ignored, and they are never segments. Letters of the folders' names may be
upper case, and the scene may be the only folder inside. Files of systems (._NAME, .DS_Store,
Thumbs.db) and the videos of Live Photos are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
import json
import os
from pathlib import Path
import re
from typing import Any

from pepeseg.errors import not_there, refused
from pepeseg.v1 import dataset_service_pb2

_PHOTOGRAPHS = (".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif")
_VIDEOS = (".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi")
_MAPS = (".png", ".npy", ".pfm")


class FileKind(Enum):
    """What a file of a dataset is, with the contract's values."""

    IMAGE = dataset_service_pb2.FILE_KIND_IMAGE
    POSES = dataset_service_pb2.FILE_KIND_POSES
    MASK = dataset_service_pb2.FILE_KIND_MASK
    IGNORE_MASK = dataset_service_pb2.FILE_KIND_IGNORE_MASK
    DEPTH = dataset_service_pb2.FILE_KIND_DEPTH
    POINTS = dataset_service_pb2.FILE_KIND_POINTS
    DISPARITY = dataset_service_pb2.FILE_KIND_DISPARITY
    GAUSSIANS = dataset_service_pb2.FILE_KIND_GAUSSIANS
    VIDEO = dataset_service_pb2.FILE_KIND_VIDEO


@dataclass(frozen=True)
class DatasetFile:
    """A file to upload.

    Attributes:
        name: its name in the dataset, relative, with '/'.
        path: where it is on this machine.
    """

    name: str
    kind: FileKind
    path: Path


@dataclass(frozen=True)
class Dataset:
    """What `upload` takes.

    Attributes:
        files: sorted by name.
        left_out: names of files that are not part of a dataset, sorted.
        missing: photographs that the poses name and that do not exist.
    """

    files: list[DatasetFile]
    left_out: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def names(self, kind: FileKind) -> list[str]:
        """Returns the names of the files of a kind."""
        return [file.name for file in self.files if file.kind == kind]


def is_photograph(name: str) -> bool:
    return name.lower().endswith(_PHOTOGRAPHS)


def is_video(name: str) -> bool:
    return name.lower().endswith(_VIDEOS)


def colmap_kind(name: str) -> FileKind | None:
    """Returns the kind of a file of a COLMAP model by its name, None if it is not part of one."""
    if re.fullmatch(r"(cameras|images)\.(bin|txt)", name):
        return FileKind.POSES
    return FileKind.POINTS if re.fullmatch(r"points3D\.(bin|txt)", name) else None


def _kind_in_folder(folder: str, name: str, in_depth: FileKind) -> FileKind | None:
    """Returns the kind of a file by its name below one of the layout's folders, or None."""
    lower = name.lower()
    if folder == "images" and is_photograph(name):
        return FileKind.IMAGE
    if folder in ("images", "videos") and is_video(name):
        return FileKind.VIDEO
    if folder == "sparse":
        return colmap_kind(re.sub(r"^[0-9]+/", "", name))
    if folder == "masks" and lower.endswith((".json", ".png", ".npy")):
        return FileKind.MASK
    if folder == "ignore" and lower.endswith(".png"):
        return FileKind.IGNORE_MASK
    if folder in ("depth", "disparity") and lower.endswith(_MAPS):
        return in_depth if folder == "depth" else FileKind.DISPARITY
    return None


_KINDS_BY_NAME = {
    "transforms.json": FileKind.POSES,
    "poses_bounds.npy": FileKind.POSES,
    "ignore_mask.png": FileKind.IGNORE_MASK,
    "points.ply": FileKind.POINTS,
    "sparse_pc.ply": FileKind.POINTS,
    "gaussians.ply": FileKind.GAUSSIANS,
}


def kind_of(name: str, in_depth: FileKind = FileKind.DEPTH) -> FileKind | None:
    """Returns a file's kind by its name relative to the dataset's folder, None for other files."""
    folder, slash, rest = name.partition("/")
    return _kind_in_folder(folder, rest, in_depth) if slash else _KINDS_BY_NAME.get(name)


_LAYOUT = ("images", "videos", "masks", "ignore", "depth", "disparity", "sparse")
_SYSTEM_FILES = (
    "thumbs.db",
    "desktop.ini",
    "__macosx",
    "@eadir",
    "#recycle",
    "$recycle.bin",
    "lost+found",
)


def is_system_file(name: str) -> bool:
    """Returns whether a system or program leaves such a file next to photographs."""
    return any(part.startswith(".") or part.lower() in _SYSTEM_FILES for part in name.split("/"))


def plain_path(path: str) -> str:
    r"""Returns a path below the folder as the server reads it: "..\data\.\images\7" is
    "data/images/7"."""
    parts = path.replace("\\", "/").split("/")
    return "/".join(part for part in parts if part not in ("", ".", ".."))


def _in_layout(name: str) -> str:
    """Returns the name with the layout's folder in lower case."""
    folder, slash, rest = name.partition("/")
    return folder.lower() + slash + rest if slash and folder.lower() in _LAYOUT else name


def _scene_folder(folder: Path) -> Path:
    """Returns the only folder inside, if there is nothing else, as archives unpack to."""
    for _ in range(4):
        inside = [entry for entry in folder.iterdir() if not is_system_file(entry.name)]
        if len(inside) != 1 or not inside[0].is_dir() or inside[0].name.lower() in _LAYOUT:
            break
        folder = inside[0]
    return folder


def _referenced(root: Path) -> dict[str, FileKind]:
    """Returns the points and masks that transforms.json names, by their paths in lower case. A file
    that is not such JSON names none: the server says what is wrong."""
    try:
        document: Any = json.loads((root / "transforms.json").read_bytes())
    except (OSError, ValueError):
        return {}
    if not isinstance(document, dict):
        return {}
    frames = document.get("frames")
    named = {}
    for frame in [document, *(frames if isinstance(frames, list) else [])]:
        mask = frame.get("mask_path") if isinstance(frame, dict) else None
        if isinstance(mask, str):
            named[plain_path(mask).lower()] = FileKind.MASK
    points = document.get("ply_file_path")
    if isinstance(points, str):
        named[plain_path(points).lower()] = FileKind.POINTS
    return named


def _live_photos(files: list[DatasetFile]) -> set[str]:
    """Returns the names of videos that have the name of a photograph next to them."""

    def stem(file: DatasetFile) -> str:
        return file.path.with_suffix("").as_posix().lower()

    photographs = {stem(file) for file in files if file.kind == FileKind.IMAGE}
    return {
        file.name for file in files if file.kind == FileKind.VIDEO and stem(file) in photographs
    }


def _check_name(name: str) -> None:
    try:
        name.encode()
    except UnicodeEncodeError as error:
        raise refused(
            f"the name {os.fsencode(name)!r} is not UTF-8; rename the file, for example with "
            "convmv -f latin1 -t utf8"
        ) from error


def _where_else(left_out: list[str]) -> str:
    """Returns where photographs were seen that the layout does not take."""
    for name in left_out:
        if is_photograph(name) or is_video(name):
            parent = Path(name).parent.as_posix()
            return f"; there are some in {parent}/: name that folder, or call it images/"
    return ""


def _fail(error: OSError) -> None:
    raise not_there(f"cannot list {error.filename}: {error.strerror}")


def list_files(root: Path) -> list[str]:
    """Lists all files below a folder, relative, with '/'. Links to folders are not followed."""
    names: list[str] = []
    for folder, _, files in os.walk(root, onerror=_fail):
        names.extend((Path(folder) / file).relative_to(root).as_posix() for file in files)
    return sorted(names)


def _take_loose(root: Path, left_out: list[str]) -> tuple[list[DatasetFile], list[str]]:
    """Separates photographs and videos in the folder itself from the other left-out files."""
    files, rest = [], []
    for name in left_out:
        loose = "/" not in name and (root / name).is_file()
        if loose and is_photograph(name):
            files.append(DatasetFile(f"images/{name}", FileKind.IMAGE, root / name))
        elif loose and is_video(name):
            files.append(DatasetFile(f"videos/{name}", FileKind.VIDEO, root / name))
        else:
            rest.append(name)
    return files, rest


def read_folder(folder: str | os.PathLike[str], depth_kind: str = "depth") -> Dataset:
    """Reads the folder of a dataset, or one video.

    Photographs and videos in the folder itself are taken as images/NAME and videos/NAME if there
    are none below images/ and videos/.

    Args:
        depth_kind: what depth/ holds: "depth" (far is large, 0 unknown) or "disparity" (near is
            large).

    Raises:
        NotFoundError: no such folder.
        InvalidArgumentError: it has neither photographs nor a video.
    """
    if depth_kind not in ("depth", "disparity"):
        raise refused(f'depth_kind "{depth_kind}": depth or disparity is wanted')
    in_depth = FileKind.DEPTH if depth_kind == "depth" else FileKind.DISPARITY
    root = Path(folder)
    if root.is_file() and is_video(root.name):
        return Dataset([DatasetFile(f"videos/{root.name}", FileKind.VIDEO, root)])
    if not root.is_dir():
        raise not_there(f"no such folder or video: {root}")
    root = _scene_folder(root)
    referenced = _referenced(root)
    files, left_out = [], []
    for name in list_files(root):
        if is_system_file(name):
            continue
        laid_out = _in_layout(name)
        named = referenced.get(name.lower())
        kind = kind_of(laid_out, in_depth) or named
        # A mask among the photographs is none of them.
        if kind is FileKind.IMAGE and named is FileKind.MASK:
            kind = FileKind.MASK
        # Some tools write no points at all, and the contract has no files without bytes.
        if kind is FileKind.POINTS and (root / name).stat().st_size == 0:
            kind = None
        if kind is not None and (root / name).is_file():
            _check_name(name)
            files.append(DatasetFile(laid_out, kind, root / name))
        else:
            left_out.append(name)
    if not any(file.kind in (FileKind.IMAGE, FileKind.VIDEO) for file in files):
        loose, left_out = _take_loose(root, left_out)
        if not loose:
            raise refused(
                f"{root}: no photographs ({', '.join(_PHOTOGRAPHS)} in it or in its images/) and "
                f"no video ({', '.join(_VIDEOS)}){_where_else(left_out)}"
            )
        files += loose
        for file in loose:
            _check_name(file.name)
    live = _live_photos(files)
    files = [file for file in files if file.name not in live]
    return Dataset(sorted(files, key=lambda file: file.name), sorted([*left_out, *live]))
