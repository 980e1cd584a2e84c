"""Edits of Gaussians: remove a thing and fill the hole, crop, move, copy, recolour."""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
from dataclasses import dataclass
import re
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from pepeseg import prompts, selections
from pepeseg.calls import Place, Receive, Steps
from pepeseg.cameras import to_quaternion
from pepeseg.errors import damaged, refused
from pepeseg.subsets import Subset, to_subset
from pepeseg.v1 import edit_service_pb2, geometry_pb2

_Request = edit_service_pb2.EditModelRequest

# What to edit: a selection, its number or name, a segment, or a prompt, which is selected first.
What = Union[Subset, prompts.Prompt]
# An axis of the scene, "x", "y" or "z", and degrees; a quaternion w, x, y, z; or a matrix [3, 3].
Rotation = Union[tuple[str, float], npt.ArrayLike]
# Called with what is being done, and with how many of how many steps are done.
OnProgress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Edit:
    """An edited model.

    Attributes:
        model: name of the new model, which is live.
        edited_from: name of the model that was edited. `client.of(scene,
            model=edited_from).make_live()` undoes the edit.
        num_removed, num_added, num_changed: Gaussians that were removed, added, and moved or
            recoloured.
        selection: name of a selection of the new model: the Gaussians that were added, or else
            changed; empty: there are none.
    """

    model: str
    edited_from: str
    num_removed: int
    num_added: int
    num_changed: int
    selection: str


def _edit(
    at: Place,
    what: What,
    without: bool,
    request: _Request,
    on_progress: OnProgress | None = None,
) -> Steps[Edit]:
    if what is None:
        raise refused("edit what? A selection, a segment or a Prompt is wanted")
    if isinstance(what, prompts.Prompt):
        selected = yield from selections.select(at, what)
        if selected.num_gaussians == 0:
            raise refused("the prompt selects no Gaussians")
        at, what = dataclasses.replace(at, model=selected.model), selected
    request.model = at.model
    request.subset.CopyFrom(to_subset(at, what, without))
    results: list[Any] = []

    def take(part: edit_service_pb2.EditModelResponse) -> None:
        if part.HasField("result"):
            results.append(part.result)
        elif on_progress is not None:
            done = part.progress
            on_progress(done.activity, done.num_done, done.num_all)

    yield Receive("editing", "EditModel", request, at.scene, take)
    if not results:
        raise damaged("the edit ended without a result")
    (result,) = results
    return Edit(
        model=result.model,
        edited_from=result.edited_from,
        num_removed=result.num_removed,
        num_added=result.num_added,
        num_changed=result.num_changed,
        selection=result.selection,
    )


def _numbers(value: Any) -> npt.NDArray[np.float64]:
    """Returns the numbers; none if they are something else."""
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)


def _vector(name: str, value: npt.ArrayLike) -> geometry_pb2.Vector3:
    numbers = _numbers(value)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise refused(f"{name}: x, y, z in scene units are wanted, this is {value!r}")
    x, y, z = numbers
    return geometry_pb2.Vector3(x=x, y=y, z=z)


def _rotation(rotate: Rotation) -> geometry_pb2.Quaternion:
    wanted = 'an axis and degrees, such as ("y", 90), a quaternion w, x, y, z or a matrix [3, 3]'
    if isinstance(rotate, (tuple, list)) and len(rotate) == 2 and isinstance(rotate[0], str):
        axis, half = rotate[0], np.radians(float(rotate[1])) / 2
        if axis not in ("x", "y", "z") or not np.isfinite(half):
            raise refused(f"rotate: {wanted} is wanted, this is {rotate!r}")
        about_axis = geometry_pb2.Quaternion(w=np.cos(half))
        setattr(about_axis, axis, np.sin(half))
        return about_axis
    numbers = _numbers(rotate)
    if numbers.shape == (4,) and np.isfinite(numbers).all() and numbers.any():
        w, x, y, z = numbers / np.linalg.norm(numbers)
        return geometry_pb2.Quaternion(w=w, x=x, y=y, z=z)
    if numbers.shape != (3, 3) or not np.isfinite(numbers).all():
        raise refused(f"rotate: {wanted} is wanted, this is {rotate!r}")
    if not np.allclose(numbers @ numbers.T, np.eye(3), atol=1e-4) or np.linalg.det(numbers) < 0:
        raise refused("rotate: the matrix is not a rotation")
    return to_quaternion(numbers)


def _move(
    by: npt.ArrayLike | None,
    rotate: Rotation | None,
    scale: float | None,
    about: npt.ArrayLike | None,
    copy: bool,
) -> _Request:
    if by is None and rotate is None and scale is None:
        raise refused("by, rotate or scale is wanted: where to, how turned, how large")
    move = _Request.Move(copy=copy)
    if by is not None:
        move.translation.CopyFrom(_vector("by", by))
    if rotate is not None:
        move.rotation.CopyFrom(_rotation(rotate))
    if scale is not None:
        if not 0.001 <= scale <= 1000:
            raise refused(f"scale: {scale} is not between 0.001 and 1000")
        move.scale = scale
    if about is not None:
        move.pivot.CopyFrom(_vector("about", about))
    return _Request(move=move)


def _color(color: str | npt.ArrayLike) -> tuple[float, float, float]:
    wanted = '"#rrggbb" or red, green and blue in [0, 1]'
    if isinstance(color, str):
        digits = re.fullmatch("#?([0-9A-Fa-f]{6})", color)
        if digits is None:
            raise refused(f"color: {wanted} is wanted, this is {color!r}")
        rgb = bytes.fromhex(digits[1])
        return rgb[0] / 255, rgb[1] / 255, rgb[2] / 255
    numbers = _numbers(color)
    # The comparison is false for NaN.
    if numbers.shape != (3,) or not ((numbers >= 0) & (numbers <= 1)).all():
        raise refused(f"color: {wanted} is wanted, this is {color!r}")
    return float(numbers[0]), float(numbers[1]), float(numbers[2])


def remove(
    at: Place,
    what: What,
    *,
    fill: bool = True,
    on_progress: OnProgress | None = None,
) -> Steps[Edit]:
    """Removes a thing, and fills the hole. As all edits it makes a new model, which becomes the live
    one; the former stays. A call that is repeated makes another model.

    Args:
        what: a selection, its number or name, a segment, or a `Prompt`, which is selected first.
        fill: remove what the thing has hidden from all views, too, continue flat surfaces under it,
            and light its shadow on them. Takes some seconds.
        on_progress: called with what is being done, and with the number of steps that are done, and
            of all, while the hole is filled.

    Raises:
        InvalidArgumentError: nothing, or all of the model, would be removed.
        NotFoundError: no such selection.
        FailedPreconditionError: the selection is of another model, or the scene has no model yet.
        ResourceExhaustedError: the project has no space for the model, or the server no memory.
        UnavailableError: too many edits are waiting.
    """
    request = _Request(remove=_Request.Remove(fill=fill))
    return (yield from _edit(at, what, False, request, on_progress))


def keep(at: Place, what: What) -> Steps[Edit]:
    """Removes everything else: crops the scene to a thing.

    Args:
        what: as in `remove`.

    Raises:
        InvalidArgumentError, NotFoundError, FailedPreconditionError, ResourceExhaustedError,
            UnavailableError: as in `remove`.
    """
    return (yield from _edit(at, what, True, _Request(remove=_Request.Remove())))


def move(
    at: Place,
    what: What,
    *,
    by: npt.ArrayLike | None = None,
    rotate: Rotation | None = None,
    scale: float | None = None,
    about: npt.ArrayLike | None = None,
    without: bool = False,
) -> Steps[Edit]:
    """Moves, turns and scales a thing.

    Args:
        what: as in `remove`.
        by: how far along the axes of the scene, [3], scene units.
        rotate: an axis of the scene and degrees, ("y", 90), counter-clockwise as the axis points at
            you; a quaternion w, x, y, z; or a rotation matrix [3, 3].
        scale: how much larger, [0.001, 1000].
        about: the point that rotation and scale keep, [3], scene units; None: the middle of the box
            of the Gaussians.
        without: move all other Gaussians in its place.

    Raises:
        InvalidArgumentError: nothing is selected, or a value is out of range.
        NotFoundError, FailedPreconditionError, ResourceExhaustedError, UnavailableError: as in
            `remove`.
    """
    request = _move(by, rotate, scale, about, copy=False)
    return (yield from _edit(at, what, without, request))


def copy(
    at: Place,
    what: What,
    *,
    by: npt.ArrayLike | None = None,
    rotate: Rotation | None = None,
    scale: float | None = None,
    about: npt.ArrayLike | None = None,
    without: bool = False,
) -> Steps[Edit]:
    """Adds a copy of a thing, moved, turned and scaled; `Edit.selection` has it.

    Args:
        what, by, rotate, scale, about, without: as in `move`.

    Raises:
        InvalidArgumentError, NotFoundError, FailedPreconditionError, ResourceExhaustedError,
            UnavailableError: as in `move`; the model would have more than 50,000,000 Gaussians.
    """
    request = _move(by, rotate, scale, about, copy=True)
    return (yield from _edit(at, what, without, request))


def recolor(
    at: Place,
    what: What,
    color: str | npt.ArrayLike,
    *,
    strength: float = 1.0,
    without: bool = False,
) -> Steps[Edit]:
    """Gives a thing another colour; light and dark stay.

    Args:
        what: as in `remove`.
        color: "#rrggbb"; or red, green and blue, [0, 1] each.
        strength: share of the new colour, (0, 1].
        without: recolour all other Gaussians in its place.

    Raises:
        InvalidArgumentError: nothing is selected, or a value is out of range.
        NotFoundError, FailedPreconditionError, ResourceExhaustedError, UnavailableError: as in
            `remove`.
    """
    red, green, blue = _color(color)
    if not 0 < strength <= 1:
        raise refused(f"strength: {strength} is not in (0, 1]")
    request = _Request(
        recolor=_Request.Recolor(red=red, green=green, blue=blue, strength=strength)
    )
    return (yield from _edit(at, what, without, request))
