"""Files that the server streams: a header, then chunks."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
from pathlib import Path
from typing import Any, BinaryIO

from pepeseg.calls import Place, Receive, Steps
from pepeseg.errors import damaged


class _ExportFile:
    """Writes the parts of an export to a file, and checks the whole."""

    def __init__(self, file: BinaryIO, header: Any, on_part: Callable[[Any], None] | None) -> None:
        self._file = file
        self._sha256 = hashlib.sha256()
        self._num_bytes = 0
        self._header = header
        self._on_part = on_part

    def take(self, part: Any) -> None:
        if self._on_part is not None:
            self._on_part(part)
        if part.HasField("header"):
            self._header = part.header
        self._sha256.update(part.chunk)
        self._num_bytes += len(part.chunk)
        self._file.write(part.chunk)

    def finish(self) -> Any:
        header = self._header
        if (self._num_bytes, self._sha256.hexdigest()) != (header.num_bytes, header.sha256):
            raise damaged(
                f"the file is not what was announced: {self._num_bytes} of {header.num_bytes} bytes"
            )
        return header


def fetch_file(
    at: Place,
    service: str,
    method: str,
    request: Any,
    header: Any,
    target: Path,
    on_part: Callable[[Any], None] | None = None,
) -> Steps[Any]:
    """Writes what a method exports, and returns its header. `header`: an empty one.

    The file appears at `target` when it is complete and its checksum is right; missing folders above
    it are made. `on_part` gets every message.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(target.name + ".part")
    try:
        with open(beside, "wb") as file:
            parts = _ExportFile(file, header, on_part)
            yield Receive(service, method, request, at.scene, parts.take)
            header = parts.finish()
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)
    return header
