"""Scale, rotate and move a mesh, or flip its faces."""

from __future__ import annotations

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.compose import transformed, turned_over
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.options import UNITS, TransformOptions
from texbake.mesh.subdivide import subdivide

# Takes a mesh whose z axis points up to one whose y axis does.
Y_FROM_Z = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def transform(mesh: MeshLike, options: TransformOptions | None = None) -> Mesh:
    """Scale, rotate, move or subdivide a mesh, or flip its faces.

    Parameters
    ----------
    mesh : Mesh
    options
        None leaves the mesh as it is.

    Returns
    -------
    Mesh
        Texture coordinates, groups and colors stay; normals and tangents follow.

    Raises
    ------
    OptionError
        Positions are not finite numbers any more.
    """
    mesh = as_mesh(mesh)
    options = options or TransformOptions()
    mesh = subdivide(mesh, options.subdivide)
    matrix = _matrix(options)
    if not np.array_equal(matrix, np.eye(4)):
        with np.errstate(over="ignore", invalid="ignore"):
            largest = np.abs(matrix[:3, :3]).max() * np.abs(mesh.positions).max()
            if not np.isfinite(largest + np.abs(matrix).max()):
                raise OptionError("scale, move: positions would not be finite numbers any more")
        mesh = transformed(mesh, matrix)
    if options.flip:
        mesh = turned_over(mesh, np.ones(mesh.n_faces, np.bool_))
    return with_normals(mesh, options.normals, angle=options.angle)


def _matrix(options: TransformOptions) -> FloatArray:
    """(4, 4) map of all options but `flip`."""
    factor = options.scale * UNITS.get(options.units or "m", 1.0)
    linear = factor * (Y_FROM_Z if options.up == "z" else np.eye(3))
    for axis, angle in enumerate(options.rotate):
        linear = pm.matmul(_rotation(axis, angle), linear)
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = options.move
    return matrix


def _rotation(axis: int, degrees: float) -> FloatArray:
    """(3, 3) rotation about an axis, counter-clockwise; exact for quarter turns."""
    quarters = degrees / 90.0
    if quarters == round(quarters):
        cos, sin = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters % 4)]
    else:
        cos, sin = pm.cos(np.radians(degrees)), pm.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cos
    matrix[first, second], matrix[second, first] = -sin, sin
    return matrix
