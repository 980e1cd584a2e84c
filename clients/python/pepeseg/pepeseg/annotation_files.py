"""The masks of labels as files of annotation tools."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any
import zipfile

from pepeseg import prompts
from pepeseg.calls import Place, Steps, Work
from pepeseg.errors import refused
from pepeseg.export_files import fetch_file
from pepeseg.v1 import label_service_pb2

FORMATS = {
    "coco": label_service_pb2.ANNOTATION_FORMAT_COCO,
    "yolo": label_service_pb2.ANNOTATION_FORMAT_YOLO,
    "labelme": label_service_pb2.ANNOTATION_FORMAT_LABELME,
    "masks": label_service_pb2.ANNOTATION_FORMAT_MASKS,
    "cvat": label_service_pb2.ANNOTATION_FORMAT_CVAT,
    "ids": label_service_pb2.ANNOTATION_FORMAT_IDS,
}


@dataclass(frozen=True)
class AnnotationExport:
    """A zip, or a folder, that `export_annotations` has written."""

    path: Path
    num_things: int
    num_views: int
    model: str


def export_annotations(
    at: Place,
    path: str | os.PathLike[str],
    format: str = "coco",
    *,
    labels: Sequence[str] = (),
    segments: int | None = None,
    scales: Sequence[float] = (),
    targets: prompts.Targets = None,
    sam_borders: bool | None = None,
    table: bool = False,
    on_progress: Callable[[int, int], None] | None = None,
) -> Steps[AnnotationExport]:
    """Segments the labels of the scene in the views, and writes the masks for an annotation tool.

    The mask of a label is that of `segment(label=...)`, in pixels of the photograph; in the label's own view it is
    the label's. A thing has the same track id in all views.

    Args:
        path: a zip if it ends in ".zip", else a folder, which is made if it is missing. Files in it
            that are not written stay.
        format: "coco" (annotations.json with run lengths), "yolo" (labels/STEM.txt with polygons,
            data.yaml), "labelme" (STEM.json with polygons), "masks" (LABEL/STEM.png, 0 and 255), "cvat"
            (annotations.xml, CVAT for images 1.1) or "ids" (STEM.png, the track id of each pixel).
        labels: ids of labels; empty: all.
        segments: a level of the decomposition, from 0, the finest. Its segments are the things in
            place of the labels: "1-12" is segment 12 of level 1. A label that fits one names it.
        scales: of the decomposition, as in `decompose`.
        targets: the views: None or "all", "held-out", or names.
        sam_borders: as in `segment`, for 8 views at a time.
        table: write things.csv, too, with a row for each thing: its parent, names, Gaussians, views,
            pixels, and its box in scene units.
        on_progress: called now and then with the number of masks that are done, and of all.

    Raises:
        FailedPreconditionError: the scene has no label, or no model yet.
        NotFoundError: no such label.
        InvalidArgumentError: an unknown format, view or level, no view is held out, or segments next
            to labels or sam_borders.
        DataLossError: the bytes fail their checksum.
        OSError: a file cannot be written.
    """
    if format not in FORMATS:
        raise refused(f'format "{format}": one of {", ".join(FORMATS)} is wanted')
    request = label_service_pb2.ExportAnnotationsRequest(
        model=at.model,
        format=FORMATS[format],
        labels=labels,
        targets=prompts.targets(targets),
        table=table,
    )
    if sam_borders is not None:
        request.sam_borders = sam_borders
    if segments is not None:
        request.segments.CopyFrom(
            label_service_pb2.ExportAnnotationsRequest.Segments(scales=scales, level=segments)
        )

    def report(part: Any) -> None:
        if on_progress is not None and part.HasField("progress"):
            on_progress(part.progress.num_masks_done, part.progress.num_masks)

    target = Path(path)
    is_zip = target.suffix.lower() == ".zip"
    packed = target if is_zip else target.with_name(target.name + ".unpacking.zip")
    empty = label_service_pb2.ExportAnnotationsResponse.Header()
    header = yield from fetch_file(
        at, "labels", "ExportAnnotations", request, empty, packed, report
    )

    def unpack() -> None:
        try:
            with zipfile.ZipFile(packed) as files:
                files.extractall(target)
        finally:
            packed.unlink()

    if not is_zip:
        yield Work(unpack)
    return AnnotationExport(target, header.num_things, header.num_views, header.model)
