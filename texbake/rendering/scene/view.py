"""A scene's view to cameras: one, or a turn of them about the scene's middle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.rendering.camera import Camera, axes_toward
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Vector
from texbake.rendering.scene.placing import outline
from texbake.rendering.scene.scene import Scene, View

UP_AXES = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# The near plane of a camera that stands somewhere, in the smaller of its distance to the target and
# the scene's radius.
_NEAR = 1e-3


def camera_of(scene: Scene, options: RenderOptions) -> Camera:
    """Return the camera of a scene's view.

    Parameters
    ----------
    scene
        A view with a `position` stands there. One with `angles` looks at the middle of all visible
        objects (before displacement), as far away as `Camera.framing` does. What the view leaves
        open, and all of it where there is none, is as `options` says.
    options
        `view`, `up`, `fov` and the picture's shape.

    Raises
    ------
    OptionError
        The camera stands on its target, looks along its up direction, or has no field of view.
    MeshError
        The scene is beyond what float64 can square.
    """
    view = scene.view or View()
    fov = options.fov if view.fov is None else view.fov
    if view.position is None or view.target is None:
        angles = view.angles if view.angles is not None else options.view
        return Camera.framing(*_outlines(scene), options=replace(options, view=angles, fov=fov))
    near = view.near
    if near is None:
        _, radius = Camera.sphere_around(*_outlines(scene))
        near = _NEAR * min(radius, math.dist(view.position, view.target) or radius)
    return Camera.looking_at(
        view.position,
        view.target,
        up=_up(view, options),
        fov=math.radians(fov),
        near=near,
    )


def check_view(scene: Scene) -> None:
    """Raise `OptionError` where the scene's own options and view make no camera."""
    view = scene.view
    if view is not None and view.position is not None and view.target is not None:
        axes_toward(view.position, view.target, _up(view, scene.options()))


def _up(view: View, options: RenderOptions) -> Vector:
    return UP_AXES[options.up] if view.up is None else view.up


def turntable_cameras(scene: Scene, options: RenderOptions, n_views: int) -> list[Camera]:
    """Cameras that go once around a scene, as though it stood on a turntable.

    Parameters
    ----------
    scene, options
        As for `camera_of`, which is the first of them.
    n_views
        How many; each stands 1 / n_views of a turn further counter-clockwise, seen from above,
        about the axis through the scene's middle along `options.up`.

    Raises
    ------
    OptionError
        There is to be no camera at all; or as `camera_of`.
    """
    if n_views < 1:
        raise OptionError(f"turntable: {n_views} views are none; give 1 or more")
    first = camera_of(scene, options)
    center, _ = Camera.sphere_around(*_outlines(scene))
    axis = np.array(UP_AXES[options.up])
    cameras = [first]
    for i in range(1, n_views):
        turn = _turn_about(axis, 2.0 * math.pi * i / n_views)
        cameras.append(
            Camera(
                eye=center + turn @ (first.eye - center),
                axes=first.axes @ turn.T,
                fov=first.fov,
                near=first.near,
            )
        )
    return cameras


def _turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """(3, 3): turn about a unit axis, counter-clockwise seen from where it points to."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer(axis, axis)
    return np.asarray(math.cos(angle) * (np.eye(3) - along) + math.sin(angle) * cross + along)


def _outlines(scene: Scene) -> list[Mesh]:
    """Visible objects in world space; all of them where none is."""
    seen = [item for item in scene.objects if item.visible]
    return [outline(item) for item in seen or scene.objects]
