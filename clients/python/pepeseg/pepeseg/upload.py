"""Uploads: sends the files that the server lacks, resumes after lost connections, checks chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import hashlib
import os
import time
from typing import Any, Union
import warnings

from pepeseg import errors
from pepeseg.calls import Pause, Place, Send, Steps, Unary, Work, all_pages, new_request_id
from pepeseg.dataset import Dataset, DatasetFile, read_folder
from pepeseg.progress import Bar
from pepeseg.scenes import create_scene
from pepeseg.v1 import dataset_service_pb2

_CHUNK_BYTES = 1 << 20
_FIRST_PAUSE = 0.25
_LONGEST_PAUSE = 8.0
_PATIENCE_SECONDS = 60.0
_NAMES_TOLD = 10

# True: a bar. A function is called with the bytes that the server has and those of all files.
Progress = Union[bool, Callable[[int, int], None]]

# Errors after which a repetition may succeed: no connection, an earlier stream that still writes
# the file, an offset that has changed.
_MAY_PASS = (
    errors.UnavailableError,
    errors.CancelledError,
    errors.AbortedError,
    errors.OutOfRangeError,
)


@dataclass(frozen=True)
class SealedDataset:
    """A dataset on the server, from which trainings start. It never changes.

    Attributes:
        name: "scenes/{scene}/datasets/{number}".
        advice: what may make a training of it poor and what to do about it, for people; `upload`
            warns of it.
    """

    name: str
    num_files: int
    num_bytes: int
    advice: tuple[str, ...] = ()


def _parse(message: dataset_service_pb2.Dataset) -> SealedDataset:
    return SealedDataset(message.name, message.num_files, message.num_bytes, tuple(message.advice))


def _declare(files: list[DatasetFile]) -> list[dataset_service_pb2.FileDeclaration]:
    declarations = []
    for file in files:
        digest = hashlib.sha256()
        with open(file.path, "rb") as stream:
            while piece := stream.read(_CHUNK_BYTES):
                digest.update(piece)
            size = stream.tell()
        declarations.append(
            dataset_service_pb2.FileDeclaration(
                path=file.name, kind=file.kind.value, size=size, sha256=digest.hexdigest()
            )
        )
    return declarations


def _request_id_of(declarations: list[dataset_service_pb2.FileDeclaration]) -> str:
    """Returns an id that is the same for the same files, so that an earlier upload is resumed."""
    digest = hashlib.sha256()
    for file in declarations:
        digest.update(f"{file.path}\n{file.kind} {file.size} {file.sha256}\n".encode())
    return f"files-{digest.hexdigest()}"


def _open_upload(at: Place, files: list[DatasetFile]) -> Steps[dataset_service_pb2.Upload]:
    """Returns the unfinished upload of the same files, or a new one if that was sealed."""
    declarations = yield Work(lambda: _declare(files))
    request = dataset_service_pb2.CreateUploadRequest(
        parent=at.scene, files=declarations, request_id=_request_id_of(declarations)
    )
    upload: dataset_service_pb2.Upload
    upload = yield Unary("datasets", "CreateUpload", request, at.scene)
    if upload.sealed:
        request.request_id = new_request_id()
        upload = yield Unary("datasets", "CreateUpload", request, at.scene)
    return upload


class _Rest:
    """The requests that send what the server lacks of an upload."""

    def __init__(
        self,
        upload: dataset_service_pb2.Upload,
        files: list[DatasetFile],
        tell: Callable[[int, int], None],
    ) -> None:
        by_name = {file.name: file for file in files}
        offsets = {part.path: part.committed_bytes for part in upload.partial_files}
        self._upload = upload.name
        self._files = [(by_name[name], offsets.get(name, 0)) for name in upload.missing_files]
        self._tell = tell
        self.num_bytes = upload.num_bytes
        self.num_there = upload.num_bytes - sum(
            os.path.getsize(file.path) - offset for file, offset in self._files
        )

    def __bool__(self) -> bool:
        return bool(self._files)

    def requests(self) -> Iterator[dataset_service_pb2.WriteFilesRequest]:
        done = self.num_there
        request = dataset_service_pb2.WriteFilesRequest
        for file, offset in self._files:
            header = request.Header(upload=self._upload, path=file.name, offset=offset)
            yield request(header=header)
            with open(file.path, "rb") as stream:
                stream.seek(offset)
                while piece := stream.read(_CHUNK_BYTES):
                    yield request(chunk=piece)
                    done += len(piece)
                    self._tell(done, self.num_bytes)
            yield request(end=request.End())


class _Pauses:
    """The pauses between tries, which grow while the server receives nothing."""

    def __init__(self) -> None:
        self._most = -1
        self._pause = _FIRST_PAUSE
        self._since = time.monotonic()

    def next(self, num_there: int, error: Exception) -> Pause:
        """Returns the next pause, or raises `error` if nothing has been received for a minute."""
        if num_there > self._most:
            self._most, self._pause, self._since = num_there, _FIRST_PAUSE, time.monotonic()
        if time.monotonic() - self._since > _PATIENCE_SECONDS:
            raise error
        pause = Pause(self._pause)
        self._pause = min(2 * self._pause, _LONGEST_PAUSE)
        return pause


def _finish(
    at: Place,
    upload: dataset_service_pb2.Upload,
    files: list[DatasetFile],
    tell: Callable[[int, int], None],
) -> Steps[Any]:
    """Sends what is missing and seals the upload. After a lost connection it gets from the server
    what is there, and resumes."""
    pauses = _Pauses()
    seal = dataset_service_pb2.SealUploadRequest(name=upload.name)
    ask = dataset_service_pb2.GetUploadRequest(name=upload.name)
    while True:
        rest = _Rest(upload, files, tell)
        try:
            if rest:
                yield Send("datasets", "WriteFiles", rest.requests(), at.scene)
            return (yield Unary("datasets", "SealUpload", seal, at.scene))
        except _MAY_PASS as error:
            broken = error
        while True:
            yield pauses.next(rest.num_there, broken)
            try:
                upload = yield Unary("datasets", "GetUpload", ask, at.scene)
                break
            except _MAY_PASS:
                continue


def _warn_of(dataset: Dataset) -> None:
    if not dataset.missing:
        return
    named = ", ".join(dataset.missing[:_NAMES_TOLD])
    more = len(dataset.missing) - _NAMES_TOLD
    rest = f" and {more} more" if more > 0 else ""
    warnings.warn(f"photographs that the poses name are missing: {named}{rest}", stacklevel=2)


def upload(
    at: Place,
    source: str | os.PathLike[str] | Dataset,
    *,
    depth_kind: str = "depth",
    progress: Progress = False,
) -> Steps[SealedDataset]:
    """Uploads a dataset, and creates the scene if it does not exist.

    Files that the server has are not sent. After a lost connection the upload resumes at the last
    byte that the server has, until the server has received nothing for a minute; calling again
    resumes it, too.

    Args:
        source: a folder in the layout of `pepeseg.dataset` or of photographs only, a video, or the
            result of an importer.
        depth_kind: as in `dataset.read_folder`.
        progress: True for a bar, or a function that is called with the number of bytes that the
            server has and the number of all.

    Raises:
        NotFoundError: no such folder.
        InvalidArgumentError: it has no photographs, or the server refuses a name or a size.
        ResourceExhaustedError: the project's quota or the server's disk is full.
        DataLossError: a file changed during the upload, or was damaged on the way.
        UnavailableError: the server has received nothing for a minute.
        OSError: a file cannot be read.
    """
    dataset = source if isinstance(source, Dataset) else read_folder(source, depth_kind)
    _warn_of(dataset)
    bar = Bar("B", scaled=True) if progress is True else None

    def tell(done: int, total: int) -> None:
        if bar is not None:
            bar.show("upload", done, total)
        elif callable(progress):
            progress(done, total)

    try:
        yield from create_scene(at)
        opened = yield from _open_upload(at, dataset.files)
        sealed = yield from _finish(at, opened, dataset.files, tell)
    finally:
        if bar is not None:
            bar.close()
    for advice in sealed.advice:
        warnings.warn(advice, stacklevel=2)
    return _parse(sealed)


def list_datasets(at: Place) -> Steps[list[SealedDataset]]:
    """Lists the datasets of the scene, oldest first."""
    request = dataset_service_pb2.ListDatasetsRequest(parent=at.scene)
    found = yield from all_pages("datasets", "ListDatasets", request, "datasets", at.scene)
    return [_parse(dataset) for dataset in found]


def get_dataset(at: Place, dataset: int | str) -> Steps[SealedDataset]:
    """Returns a dataset by its number or name.

    Raises:
        NotFoundError: no such dataset.
    """
    text = str(dataset)
    name = text if "/" in text else f"{at.scene}/datasets/{text}"
    request = dataset_service_pb2.GetDatasetRequest(name=name)
    return _parse((yield Unary("datasets", "GetDataset", request, at.scene)))


def delete_upload(at: Place, upload: int | str) -> Steps[None]:
    """Deletes an unfinished upload by its number or name, with what was sent of it.

    Raises:
        NotFoundError: no such upload.
        FailedPreconditionError: it is sealed: a dataset is deleted with its scene.
    """
    text = str(upload)
    name = text if "/" in text else f"{at.scene}/uploads/{text}"
    request = dataset_service_pb2.DeleteUploadRequest(name=name)
    yield Unary("datasets", "DeleteUpload", request, at.scene, repeatable=False)
