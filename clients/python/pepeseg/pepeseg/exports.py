"""Files of a model's Gaussians, or of a subset of them: for splat viewers, and as a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import json
import os
from pathlib import Path
from typing import Any

from pepeseg.calls import Place, Steps
from pepeseg.errors import refused
from pepeseg.export_files import fetch_file
from pepeseg.subsets import Subset, to_subset
from pepeseg.v1 import render_service_pb2


@dataclass(frozen=True)
class Export:
    """A file that `export` has written."""

    path: Path
    num_gaussians: int
    num_bytes: int
    sha256: str
    model: str
    # What to add to the positions of the file to get those of the world.
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class MeshExport:
    """A file that `export_mesh` has written."""

    path: Path
    num_vertices: int
    num_triangles: int
    num_bytes: int
    sha256: str
    model: str
    # What to add to the positions of the file to get those of the world.
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


# The formats and origins of an export.
FORMATS = {
    "ply": render_service_pb2.GAUSSIAN_FORMAT_PLY,
    "spz": render_service_pb2.GAUSSIAN_FORMAT_SPZ,
    "glb": render_service_pb2.GAUSSIAN_FORMAT_GLB,
    "sog": render_service_pb2.GAUSSIAN_FORMAT_SOG,
    "html": render_service_pb2.GAUSSIAN_FORMAT_HTML,
}
MESH_FORMATS = {
    "ply": render_service_pb2.MESH_FORMAT_PLY,
    "glb": render_service_pb2.MESH_FORMAT_GLB,
}
ORIGINS = {
    "local": render_service_pb2.COORDINATES_LOCAL,
    "world": render_service_pb2.COORDINATES_WORLD,
}


def _format_of(path: str | os.PathLike[str], format: str | None, formats: dict[str, Any]) -> Any:
    """Returns the format of that name, or the one that the path ends in, else PLY."""
    if format is None:
        format = Path(path).suffix[1:].lower()
        format = format if format in formats else "ply"
    if format not in formats:
        raise refused(f'format "{format}": one of {", ".join(formats)} is wanted')
    return formats[format]


def _origin_of(origin: str) -> Any:
    if origin not in ORIGINS:
        raise refused(f'origin "{origin}": one of {", ".join(ORIGINS)} is wanted')
    return ORIGINS[origin]


def _write(
    at: Place, method: str, request: Any, header: Any, target: Path
) -> Steps[tuple[Any, tuple[float, float, float]]]:
    """Writes what a method exports, and returns its header and the offset to the world."""
    header = yield from fetch_file(at, "rendering", method, request, header, target)
    offset = (header.origin.x, header.origin.y, header.origin.z)
    side = target.with_name(target.name + ".origin.json")
    if header.HasField("origin"):
        side.write_text(json.dumps({"origin": offset}) + "\n", encoding="utf-8")
    else:
        side.unlink(missing_ok=True)  # of an earlier export
    return header, offset


def export(
    at: Place,
    path: str | os.PathLike[str],
    of: Subset = None,
    *,
    without: bool = False,
    origin: str = "local",
    format: str | None = None,
    segment_ids: bool | Sequence[float] = False,
) -> Steps[Export]:
    """Fetches the model, or a subset of it, as a file for splat viewers.

    The file appears at `path` when it is complete and its checksum is right; missing folders above
    it are made.

    Args:
        of: a selection, its number or name, or a segment; None: all.
        without: export all other Gaussians in its place: what is left without the thing.
        origin: positions of a scene with map coordinates. "local": floats relative to an origin,
            which is in PATH.origin.json, in a comment of the PLY and in the result. "world": doubles,
            which many viewers read wrongly or not at all; a GLB has them as its node's translation,
            an SPZ, an SOG and a page are always local.
        format: "ply", "spz", "glb", "sog" or "html", a page that shows the Gaussians in a browser;
            None: what the path ends in, else "ply". The axes of SPZ and GLB are those of glTF: x, -y,
            -z of the world.
        segment_ids: add to each Gaussian of a PLY the ids of the segments that it is in, as the int
            properties segment_0, segment_1, ...; 0: in none. True: of `decompose()`; or its scales.

    Raises:
        NotFoundError: no such selection.
        InvalidArgumentError: no such segment, or an unknown origin or format.
        FailedPreconditionError: the scene has no model yet.
        DataLossError: the bytes fail their checksum.
        OSError: the file cannot be written.
    """
    request = render_service_pb2.ExportGaussiansRequest(
        model=at.model,
        subset=to_subset(at, of, without),
        coordinates=_origin_of(origin),
        format=_format_of(path, format, FORMATS),
    )
    if segment_ids is not False:
        scales = () if segment_ids is True else segment_ids
        request.segment_ids.scales.extend(scales)
        request.segment_ids.SetInParent()
    target = Path(path)
    empty = render_service_pb2.ExportGaussiansResponse.Header()
    header, offset = yield from _write(at, "ExportGaussians", request, empty, target)
    return Export(
        target, header.num_gaussians, header.num_bytes, header.sha256, header.model, offset
    )


def export_mesh(
    at: Place,
    path: str | os.PathLike[str],
    of: Subset = None,
    *,
    without: bool = False,
    origin: str = "local",
    format: str | None = None,
    voxels: int = 256,
    watertight: bool = False,
    triangles: int | None = None,
) -> Steps[MeshExport]:
    """Makes a triangle mesh of the model, or of a subset of it, and fetches it as a file.

    The server makes it in seconds: of the depth and the colours that the model's views render. The
    file appears at `path` as that of `export` does.

    Args:
        of, without, origin: as in `export`.
        format: "ply" or "glb"; None: what the path ends in, else "ply". The axes of a GLB are those
            of glTF: x, -y, -z of the world.
        voxels: on the longest side of the box of the Gaussians, 32 to 1024.
        watertight: close the surface where no view shows it, so that it has a volume.
        triangles: most triangles, at least 100: they are merged where the surface changes least.
            None: all.

    Raises:
        InvalidArgumentError: as `export`; or `voxels` is out of range, or they are too many.
        FailedPreconditionError: the scene has no model yet, or no view shows a surface.
        NotFoundError, DataLossError, OSError: as `export`.
    """
    request = render_service_pb2.ExportMeshRequest(
        model=at.model,
        subset=to_subset(at, of, without),
        coordinates=_origin_of(origin),
        format=_format_of(path, format, MESH_FORMATS),
        voxels=voxels,
        watertight=watertight,
        max_triangles=triangles or 0,
    )
    target = Path(path)
    empty = render_service_pb2.ExportMeshResponse.Header()
    header, offset = yield from _write(at, "ExportMesh", request, empty, target)
    return MeshExport(
        target,
        header.num_vertices,
        header.num_triangles,
        header.num_bytes,
        header.sha256,
        header.model,
        offset,
    )
