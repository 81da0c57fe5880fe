"""Where the texture is cut: charts, and the seams between them.

Edges are told apart by where they lie, not by their indices, so that vertices and texture
coordinates that a file repeats do not cut anything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows


def chart_ids(mesh: Mesh) -> IntArray:
    """Chart of each face: faces joined by edges that they share in space and in the texture.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.

    Returns
    -------
    (F,) int32
        Charts are numbered from 0 in the order of their first faces. A face whose neighbors have
        other coordinates along the shared edges is a chart of its own, also if it has no area.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> chart_ids(plane(2, 1))
    array([0, 0, 0, 0], dtype=int32)
    """
    return connected_faces(edge_ids(_texture_corners(mesh)))


def border_edges(mesh: Mesh) -> npt.NDArray[np.bool_]:
    """Edges that no other face shares in space and in the texture: the outlines of charts.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.

    Returns
    -------
    (F, 3) bool
        Of the edge from each corner to the next.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    """
    return _used_once(edge_ids(_texture_corners(mesh)))


def seam_length(mesh: Mesh, faces: npt.NDArray[np.bool_] | None = None) -> float:
    """Length, in model units, along which the texture is cut and the surface is not.

    Each cut is counted once, though both its sides are borders of charts: half the sum of the
    lengths of new boundary edges.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    faces : (F,) bool, optional
        The faces to look at, as if there were no others; None for all.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    """
    kept = np.ones(mesh.n_faces, dtype=bool) if faces is None else faces
    in_texture = edge_ids(_texture_corners(mesh)[kept])
    in_space = edge_ids(weld_rows(mesh.positions)[mesh.faces[kept]])
    corners = mesh.positions[mesh.faces[kept]]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return float(lengths[_used_once(in_texture) & ~_used_once(in_space)].sum()) / 2.0


def edge_ids(corners: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.int64]:
    """Number the undirected edges between corners.

    Parameters
    ----------
    corners : (F, 3) int
        Equal for corners that are the same; below 2^31.

    Returns
    -------
    (F, 3) int64
        Of the edge from each corner to the next; from 0 without gaps.
    """
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).astype(np.int64)
    low, high = ends.min(axis=2), ends.max(axis=2)
    _, ids = np.unique((low << 32 | high).ravel(), return_inverse=True)
    return ids.reshape(-1, 3)


def connected_faces(edges: npt.NDArray[np.int64]) -> IntArray:
    """Components of faces that share an edge.

    Parameters
    ----------
    edges : (F, 3) int64
        Of each face, from `edge_ids`.

    Returns
    -------
    (F,) int32
        Numbered from 0 in the order of their first faces.
    """
    n_faces = len(edges)
    components = np.arange(n_faces, dtype=np.int64)
    while True:
        # Each face takes the least number around its edges; then numbers are followed to their
        # ends, so that a chain of n faces takes log n rounds and not n.
        least = np.full(int(edges.max()) + 1, n_faces, dtype=np.int64)
        np.minimum.at(least, edges.ravel(), np.repeat(components, 3))
        nearest = least[edges].min(axis=1)
        if np.array_equal(nearest, components):
            break
        np.minimum.at(nearest, components, nearest.copy())
        while not np.array_equal(nearest, nearest[nearest]):
            nearest = nearest[nearest]
        components = nearest
    _, ids = np.unique(components, return_inverse=True)
    return ids.astype(np.int32)


def _texture_corners(mesh: Mesh) -> IntArray:
    """(F, 3) int32: equal for corners at one position with one texture coordinate."""
    uvs: FloatArray = mesh.corner_uvs().reshape(-1, 2)
    places = mesh.positions[mesh.faces.ravel()]
    return weld_rows(np.concatenate([places, uvs], axis=1)).reshape(-1, 3)


def _used_once(edges: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    return np.asarray(np.bincount(edges.ravel())[edges] == 1)
