"""Tangents of a mesh's corners, after MikkTSpace."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.mikktspace import corner_spaces
from texbake.mesh.normals import shading_normals
from texbake.mesh.weld import weld_rows

# Cosine of the angle between the x axis and a normal from which on (0.08 degrees) they count as
# parallel: the default tangent of a corner must span a plane with its normal, in float32.
_PARALLEL = 1.0 - 1e-6


def corner_tangents(mesh: Mesh) -> npt.NDArray[np.float32]:
    """MikkTSpace tangent of each corner, for the mesh's texture coordinates and normals.

    Interpolate tangents, normals and bitangents over a face without renormalizing them; the
    bitangent of a corner is ``w * cross(normal, tangent)``. The normals are the mesh's own, as
    they are, else `smooth_normals`. Tangents that came with the file (`Mesh.tangents`) are not
    looked at.

    Position, scale and unit of the mesh change nothing beyond float32 rounding, and scaling by a
    power of two not even that. Corners are one vertex where their positions are equal, and their
    normals and texture coordinates are equal in float32.

    Returns
    -------
    (F, 3, 4) float32
        x, y, z: unit, never NaN. w: 1, or -1 where the mapping is mirrored.

        What has no tangent by the rules gets one all the same:

        - A corner whose face has no area in texture space and touches no mapped face there, or
          has two equal positions and no vertex in common with other faces: (1, 0, 0) and -1,
          which are the reference's; where the normal lies along x, a unit vector perpendicular to
          it and 1.
        - A corner around which the directions of growing u cancel (in the reference a tangent
          of length 0): a unit vector perpendicular to its normal, and the w of the mapping.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.

    Examples
    --------
    >>> square = Mesh(
    ...     positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0]], faces=[[0, 1, 2]],
    ...     uvs=[[0, 0], [1, 0], [1, 1]], uv_faces=[[0, 1, 2]],
    ... )
    >>> corner_tangents(square)[0, 0]
    array([1., 0., 0., 1.], dtype=float32)
    """
    corner_uvs = mesh.corner_uvs()
    uvs = (corner_uvs * unit_scale(float(np.abs(corner_uvs).max()))).astype(np.float32)
    shading, shading_faces = shading_normals(mesh)
    normals, normal_faces = shading, shading_faces
    if mesh.normals is not None and mesh.normal_faces is not None:
        # Zero vectors among them stay: to the reference they mean no projection.
        normals, normal_faces = mesh.normals, mesh.normal_faces
    corner_normals = normals[normal_faces].astype(np.float32)
    points = mesh.positions[mesh.faces] * LocalFrame.around(mesh).scale
    vertices = _welded_corners(points, corner_normals, uvs)
    tangents, preserving, has_fan = corner_spaces(points, corner_normals, uvs, vertices)
    signs = np.where(preserving, 1.0, -1.0)
    _fill_missing(tangents, signs, has_fan, shading[shading_faces])
    return np.concatenate([tangents, signs[..., None]], axis=2, dtype=np.float32)


def _welded_corners(*attributes: npt.NDArray[Any]) -> IntArray:
    """(F, 3): the same number for corners at which all (F, 3, K) attributes are equal."""
    ids = [weld_rows(values.reshape(-1, values.shape[2])) for values in attributes]
    return weld_rows(np.stack(ids, axis=1)).reshape(-1, 3)


def _fill_missing(
    tangents: FloatArray,
    signs: FloatArray,
    has_fan: npt.NDArray[np.bool_],
    normals: FloatArray,
) -> None:
    """Give corners without a tangent, in place, what `corner_tangents` promises them."""
    missing = ~tangents.any(axis=2)
    if not missing.any():
        return
    around = normals[missing]
    without_fan = ~has_fan[missing]
    along_x = np.abs(around[:, 0]) > _PARALLEL
    signs[missing] = np.where(without_fan & along_x, 1.0, signs[missing])
    tangents[missing] = np.where(
        (without_fan & ~along_x)[:, None], [1.0, 0.0, 0.0], _perpendicular(around)
    )


def _perpendicular(normals: FloatArray) -> FloatArray:
    """A unit vector perpendicular to each normal; the x axis for a zero one."""
    axes = np.eye(3)[np.abs(normals).argmin(axis=1)]
    across = np.cross(axes, normals)
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    return np.where(lengths > 0.0, across / np.where(lengths > 0.0, lengths, 1.0), [1.0, 0.0, 0.0])
