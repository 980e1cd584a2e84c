"""Which files of a folder are part of a dataset, and what each is, as in `pepeseg upload`.

images/...                          photographs (.jpg .jpeg .png .webp .heic .heif), also in subfolders
videos/..., images/...              videos (.mp4 .m4v .mov .webm .mkv .avi)
sparse/0/ or sparse/                COLMAP cameras, images (poses), points3D (points)
transforms.json, poses_bounds.npy   poses by nerfstudio or instant-ngp, or by LLFF
masks/STEM.json|png|npy             SAM masks with COCO RLE, a label image, or an array [masks, height, width]
masks/STEM/NAME.png                 binary masks, one a file
ignore_mask.png, ignore/STEM.png    pixels to leave out, in all views or in one
points.ply, sparse_pc.ply           points to start from in place of COLMAP's
gaussians.ply                       3DGS's layout: replaces the reconstruction
depth/STEM.png|npy|pfm              far is large (or `depth_kind`)
disparity/STEM.png|npy|pfm          near is large
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
import os
from pathlib import Path
import re

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
        return colmap_kind(name.removeprefix("0/"))
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
    files, left_out = [], []
    for name in list_files(root):
        kind = kind_of(name, in_depth)
        if kind is not None and (root / name).is_file():
            files.append(DatasetFile(name, kind, root / name))
        else:
            left_out.append(name)
    if not any(file.kind in (FileKind.IMAGE, FileKind.VIDEO) for file in files):
        loose, left_out = _take_loose(root, left_out)
        if not loose:
            raise refused(
                f"{root}: no photographs ({', '.join(_PHOTOGRAPHS)} in it or in its images/) and "
                f"no video ({', '.join(_VIDEOS)})"
            )
        files += loose
    return Dataset(sorted(files, key=lambda file: file.name), left_out)
