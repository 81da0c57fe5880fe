"""Where the texture is cut: charts, and the seams between them.

Edges are told apart by where they lie, not by their indices, so that vertices and texture
coordinates that a file repeats do not cut anything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.topology import face_components
from texbake.mesh.weld import weld_rows

BoolArray = npt.NDArray[np.bool_]


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


def border_edges(mesh: Mesh) -> BoolArray:
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


def seam_edges(mesh: Mesh, faces: BoolArray | None = None) -> BoolArray:
    """Edges along which the texture is cut and the surface is not, on both sides of each cut.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    faces : (F,) bool, optional
        The faces to look at, as if there were no others; None for all.

    Returns
    -------
    (F, 3) bool
        Of the edge from each corner to the next; False for faces that are not looked at.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    """
    kept = np.ones(mesh.n_faces, dtype=bool) if faces is None else faces
    in_texture = edge_ids(_texture_corners(mesh)[kept])
    in_space = edge_ids(weld_rows(mesh.positions)[mesh.faces[kept]])
    cut = np.zeros((mesh.n_faces, 3), dtype=bool)
    cut[kept] = _used_once(in_texture) & ~_used_once(in_space)
    return cut


def seam_length(mesh: Mesh, faces: BoolArray | None = None) -> float:
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
    rows, starts = np.nonzero(seam_edges(mesh, faces))
    tails = mesh.positions[mesh.faces[rows, starts]]
    heads = mesh.positions[mesh.faces[rows, (starts + 1) % 3]]
    return float(np.linalg.norm(heads - tails, axis=1).sum()) / 2.0


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
    tails, heads = corners.astype(np.int32), np.roll(corners, -1, axis=1).astype(np.int32)
    ends = np.stack([np.minimum(tails, heads), np.maximum(tails, heads)], axis=2)
    firsts = weld_rows(ends.reshape(-1, 2))
    numbers = np.cumsum(firsts == np.arange(len(firsts))) - 1
    return np.asarray(numbers[firsts].reshape(-1, 3), dtype=np.int64)


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
    # Faces that share an edge hang together as faces that share a vertex do.
    components, _ = face_components(edges.astype(np.int32), int(edges.max(initial=-1)) + 1)
    return components


def _texture_corners(mesh: Mesh) -> IntArray:
    """(F, 3) int32: equal for corners at one position with one texture coordinate."""
    mesh.corner_uvs()  # raises where there are none
    assert mesh.uvs is not None
    places = weld_rows(mesh.positions)[mesh.faces]
    uvs = weld_rows(mesh.uvs)[mesh.uv_faces]
    return weld_rows(np.stack([places, uvs], axis=2).reshape(-1, 2)).reshape(-1, 3)


def _used_once(edges: npt.NDArray[np.int64]) -> BoolArray:
    return np.asarray(np.bincount(edges.ravel())[edges] == 1)
