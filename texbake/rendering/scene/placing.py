"""Objects in the world, and the matrices that put them there.

A transform scales first, then turns about x, y and z in that order, then moves. One that mirrors
turns faces and tangents as `texbake.mesh.compose` says, so that an object and its mirror image
both show their outside, with the same relief.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.mesh.compose import transformed
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.rendering.scene.scene import SceneObject


def placed(item: SceneObject) -> Mesh:
    """Mesh of an object in world space: the same one where it has no transform."""
    return item.mesh if item.transform is None else transformed(item.mesh, item.transform)


def outline(item: SceneObject) -> Mesh:
    """Faces and positions of an object in world space, to be framed; nothing else of the mesh."""
    if item.transform is None:
        return item.mesh
    linear, translation = item.transform[:3, :3], item.transform[:3, 3]
    return Mesh(
        positions=item.mesh.positions @ linear.T + translation,
        faces=item.mesh.faces,
        name=item.mesh.name,
    )


def transform_matrix(
    *,
    translate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float | tuple[float, float, float] = 1.0,
) -> FloatArray:
    """(4, 4) float64 that scales, turns about x, y and z in that order, and moves.

    Parameters
    ----------
    translate
        In world units.
    rotate
        Degrees, counter-clockwise seen from where the axis points to. Quarter turns are exact.
    scale
        Along the object's own axes; negative to mirror.

    Examples
    --------
    >>> transform_matrix(rotate=(0, 90, 0), translate=(0, 5, 0)) @ [1, 0, 0, 1]
    array([ 0.,  5., -1.,  1.])
    """
    linear = np.diag(np.broadcast_to(np.asarray(scale, np.float64), 3))
    for axis, angle in enumerate(rotate):
        cosine, sine = _cos_sin(angle)
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = cosine
        turn[first, second], turn[second, first] = -sine, sine
        linear = turn @ linear
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = translate
    return matrix


def _cos_sin(degrees: float) -> tuple[float, float]:
    quarters, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
