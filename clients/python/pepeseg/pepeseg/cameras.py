"""Viewpoints: the views of a model, and any other camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from pepeseg.calls import Place, Steps, all_pages
from pepeseg.errors import refused
from pepeseg.v1 import geometry_pb2, prompt_pb2, scene_service_pb2

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera anywhere in the scene.

    Attributes:
        width, height: pixels, at most 16 megapixels in all.
        fx, fy, cx, cy: focal lengths and principal point, pixels; pixel centres are at + 0.5.
        cam_from_world: [4, 4], rigid. World axes and unit are those of the dataset's poses; camera
            axes: x right, y down, z forward.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    cam_from_world: npt.ArrayLike


@dataclass(frozen=True, eq=False)
class View:
    """A photograph's view, after undistortion.

    Attributes:
        name: path of the photograph as it was uploaded, without "images/".
        camera: its camera; `camera.cam_from_world` is float64 [4, 4].
        held_out: whether it was held out of training, for scoring.
        photograph_size: width and height of the photograph as it was uploaded, pixels.
        psnr, ssim: scores of a held-out view when the model was made, dB and [-1, 1]; None: not
            scored.
    """

    name: str
    camera: Camera
    held_out: bool
    psnr: float | None
    ssim: float | None
    photograph_size: tuple[int, int]


# Where a prompt or a picture is: a view, its name, or a camera.
Viewpoint = Union[str, View, Camera]


def to_quaternion(rotation: Matrix) -> geometry_pb2.Quaternion:
    """Converts a rotation [3, 3]: an eigenvector of Bar-Itzhack's symmetric matrix."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    symmetric = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    w, x, y, z = np.linalg.eigh(symmetric)[1][:, 3]
    return geometry_pb2.Quaternion(w=w, x=x, y=y, z=z)


def _to_matrix(transform: geometry_pb2.RigidTransform) -> Matrix:
    rotation, translation = transform.rotation, transform.translation
    quaternion = np.array([rotation.w, rotation.x, rotation.y, rotation.z])
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = translation.x, translation.y, translation.z
    return matrix


def _free_camera(camera: Camera) -> prompt_pb2.Viewpoint.FreeCamera:
    matrix = np.asarray(camera.cam_from_world, np.float64)
    if matrix.shape != (4, 4):
        raise refused(f"cam_from_world: [4, 4] is wanted, this is {list(matrix.shape)}")
    rotation = matrix[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
        raise refused("cam_from_world: its upper left [3, 3] is no rotation")
    x, y, z = matrix[:3, 3]
    return prompt_pb2.Viewpoint.FreeCamera(
        camera=geometry_pb2.PinholeCamera(
            width=camera.width,
            height=camera.height,
            fx=camera.fx,
            fy=camera.fy,
            cx=camera.cx,
            cy=camera.cy,
        ),
        cam_from_world=geometry_pb2.RigidTransform(
            rotation=to_quaternion(rotation), translation=geometry_pb2.Vector3(x=x, y=y, z=z)
        ),
    )


def to_viewpoint(view: Viewpoint) -> prompt_pb2.Viewpoint:
    if isinstance(view, Camera):
        return prompt_pb2.Viewpoint(free=_free_camera(view))
    return prompt_pb2.Viewpoint(view=view.name if isinstance(view, View) else view)


def _parse_view(view: Any) -> View:
    camera = view.camera
    scored = view.HasField("scores")
    return View(
        name=view.view,
        camera=Camera(
            camera.width,
            camera.height,
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            _to_matrix(view.cam_from_world),
        ),
        held_out=view.held_out,
        psnr=view.scores.psnr if scored else None,
        ssim=view.scores.ssim if scored else None,
        # Servers that do not report it know only the view's pixels.
        photograph_size=(
            view.photograph_width or camera.width,
            view.photograph_height or camera.height,
        ),
    )


def views(at: Place) -> Steps[list[View]]:
    """Lists the views that the model was trained and scored on, by name.

    Raises:
        FailedPreconditionError: the scene has no model yet.
    """
    request = scene_service_pb2.ListViewsRequest(parent=at.model)
    found = yield from all_pages("scenes", "ListViews", request, "views", at.scene)
    return [_parse_view(view) for view in found]
