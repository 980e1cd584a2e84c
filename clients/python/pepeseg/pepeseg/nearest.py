"""The nearest names in errors about scenes and views that do not exist."""

from __future__ import annotations

import difflib
import re
from typing import TypeVar

from pepeseg.calls import Place, Steps, all_pages
from pepeseg.errors import InvalidArgumentError, NotFoundError, PepesegError
from pepeseg.v1 import scene_service_pb2

T = TypeVar("T")

_PHOTOGRAPH = re.compile(r'photograph "(.*?)"')
_SCENE = re.compile(r"(?:projects/[^/]+/)?scenes/([^/ ]+)")


def _unknown_view(error: PepesegError) -> str:
    """Returns the name of the view that the error is about; "" if it is about something else."""
    if isinstance(error, InvalidArgumentError) and "not a view of the model" in error.message:
        return error.value
    found = _PHOTOGRAPH.match(error.message) if error.reason == "NO_SUCH_PHOTOGRAPH" else None
    return found[1] if found else ""


def _names(at: Place, error: PepesegError) -> Steps[tuple[str, list[str]]]:
    """Returns the name that does not exist, and those that do."""
    view = _unknown_view(error)
    if view:
        request = scene_service_pb2.ListViewsRequest(parent=at.model)
        views = yield from all_pages("scenes", "ListViews", request, "views", at.scene)
        return view, [each.view for each in views]
    # Errors of a whole scene name it in their text only.
    missing = error.resource or error.message
    scene = _SCENE.match(missing) if isinstance(error, NotFoundError) else None
    if not scene:
        return "", []
    everything = scene_service_pb2.ListScenesRequest()
    scenes = yield from all_pages("scenes", "ListScenes", everything, "scenes")
    return scene[1], [each.name.rpartition("/")[2] for each in scenes]


def _nearest(word: str, names: list[str]) -> list[str]:
    """Returns at most three similar names, the most similar first, equal ones by name."""
    likeness = {name: difflib.SequenceMatcher(None, word, name).ratio() for name in names}
    near = [name for name in names if likeness[name] >= 0.6]
    return sorted(near, key=lambda name: (-likeness[name], name))[:3]


def with_nearest_names(at: Place, steps: Steps[T]) -> Steps[T]:
    """Runs an operation. Its error about an unknown scene or view says which names are similar."""
    try:
        return (yield from steps)
    except (InvalidArgumentError, NotFoundError) as error:
        try:
            word, names = yield from _names(at, error)
        except PepesegError:
            word, names = "", []  # such as a key that may not list scenes
        near = _nearest(word, names) if word not in names else []
        if near:
            error.message += f"; did you mean {' or '.join(near)}?"
            error.args = (error.message,)
        raise
