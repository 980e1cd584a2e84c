"""Photographs as they were uploaded, or as a model was trained on them."""

from __future__ import annotations

from dataclasses import dataclass

from pepeseg.calls import Place, Receive, Steps
from pepeseg.errors import damaged, refused
from pepeseg.v1 import dataset_service_pb2, prompt_pb2

_FRAMES = {
    "photograph": prompt_pb2.PIXEL_FRAME_PHOTOGRAPH,
    "view": prompt_pb2.PIXEL_FRAME_VIEW,
}


@dataclass(frozen=True)
class Photograph:
    """An image file.

    Attributes:
        data: its bytes.
        content_type: "image/jpeg", "image/png", "image/webp" or "image/heic".
        width, height: pixels; 0: not known, as for an original.
    """

    data: bytes
    content_type: str
    width: int
    height: int


class _Parts:
    """Collects the parts of a photograph."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._header = dataset_service_pb2.GetPhotographResponse.Header()

    def take(self, part: dataset_service_pb2.GetPhotographResponse) -> None:
        if part.HasField("header"):
            self._header = part.header
            return
        self._data += part.chunk

    def finish(self) -> Photograph:
        header = self._header
        if len(self._data) != header.num_bytes:
            raise damaged(
                f"the photograph is cut short: {len(self._data)} of {header.num_bytes} bytes"
            )
        return Photograph(bytes(self._data), header.content_type, header.width, header.height)


def photograph(
    at: Place,
    view: str,
    *,
    dataset: int | None = None,
    max_side: int = 0,
    frame: str = "photograph",
    original: bool = False,
) -> Steps[Photograph]:
    """Fetches the photograph of a view.

    Args:
        view: the view's name, which is the file's path without "images/"; empty: the first by name.
        dataset: number of a dataset of the scene; None: the one that the model was trained on.
        max_side: maximum of the longer side, pixels; a larger photograph is shrunk. 0: no maximum.
        frame: "photograph": as it was taken, upright, in the pixels of prompts and masks. "view":
            undistorted, in the size that the model was trained on.
        original: return the file as it was uploaded, byte for byte.

    Raises:
        NotFoundError: no such photograph; a frame of a video is not a photograph.
        InvalidArgumentError: the file does not decode, or a value is out of range.
        FailedPreconditionError: the scene has no model yet.
        DataLossError: the stored file is damaged; upload it again.
    """
    if frame not in _FRAMES:
        raise refused(f'frame "{frame}": one of {", ".join(_FRAMES)} is wanted')
    if original and (frame != "photograph" or max_side != 0):
        raise refused("an original has neither a frame nor max_side")
    request = dataset_service_pb2.GetPhotographRequest(
        parent=at.model if dataset is None else f"{at.scene}/datasets/{dataset}",
        photograph=view,
        max_side=max_side,
        original=original,
    )
    if not original:
        request.frame = _FRAMES[frame]
    parts = _Parts()
    yield Receive("datasets", "GetPhotograph", request, at.scene, parts.take)
    return parts.finish()
