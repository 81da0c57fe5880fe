"""Real displacement: a light mesh cut into many triangles and moved by a map of heights.

Every face is cut alike, into n x n triangles, so that neighbors meet corner to corner. What moves
is the smooth normal of each position, interpolated linearly and then normalized: the direction that
displacement maps are baked along.

The surface stays closed: vertices are shared by all faces that meet at a position, whatever
texture coordinates they have there, and where the coordinates differ (at a seam) the vertex moves
by the mean of the heights.

Based on: Cook, "Shade trees", SIGGRAPH 1984. Departs from a renderer's tessellation in that the
density does not depend on the view.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.render.raster.barycentrics import Visibility
from texbake.render.surface import wrap_of
from texbake.texture.lookup import lookup

# Rows of samples a band.
_BAND = 16


def segments_for(mesh: Mesh, width: int, height: int, *, max_triangles: int) -> int:
    """Pieces that an edge must be cut into for a map of this size to be resolved.

    Parameters
    ----------
    mesh
        With texture coordinates.
    width, height
        Of the map, in texels.
    max_triangles
        Bound on the triangles of the whole mesh.

    Returns
    -------
    int
        The least n for which no piece of an edge is longer than a texel, or the most that
        `max_triangles` allows, at least 1.
    """
    corners = mesh.corner_uvs() * (width, height)
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max())
    allowed = math.isqrt(max_triangles // mesh.n_faces)
    return max(1, min(math.ceil(min(longest, allowed)), allowed))


def displace(
    mesh: Mesh, heights: npt.NDArray[np.float32], *, segments: int, threads: int | None = None
) -> Mesh:
    """Cut a mesh into small triangles and move them along its smooth normals.

    Parameters
    ----------
    mesh
        With texture coordinates.
    heights : (H, W) or (H, W, 1) float32
        Signed distances in model units, positive outwards, row 0 at the top.
    segments
        Pieces of each edge, n.
    threads
        None for every processor.

    Returns
    -------
    Mesh
        n x n faces for each face of `mesh`, in its order, with positions and texture coordinates.
        A vertex where the smooth normal is 0 stays where it is.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    OptionError
        The heights are not one channel, or `segments` is below 1.
    """
    if segments < 1:
        raise OptionError(f"segments: {segments} is too few; it must be at least 1")
    image = heights[..., None] if heights.ndim == 2 else heights
    if image.ndim != 3 or image.shape[2] != 1:
        raise OptionError(f"displacement: the shape {heights.shape} is not (height, width, 1)")
    corner_uvs = mesh.corner_uvs()
    points, pieces = _lattice(segments)
    vertices, n_vertices = _lattice_vertices(mesh, points, segments, threads)
    weights = np.stack([segments - points.sum(axis=1), *points.T], axis=1) / segments
    uvs = (weights @ corner_uvs).reshape(-1, 2)
    samples = lookup(image, uvs, wrap=wrap_of(mesh.uvs), threads=threads)[:, 0]
    counts = np.bincount(vertices.ravel(), minlength=n_vertices)
    sums = np.bincount(vertices.ravel(), weights=samples, minlength=n_vertices)
    positions = np.empty((n_vertices, 3))
    positions[vertices] = weights @ mesh.positions[mesh.faces]
    directions = np.zeros((n_vertices, 3))
    directions[vertices] = weights @ smooth_normals(mesh, threads=threads)[mesh.faces]
    lengths = np.linalg.norm(directions, axis=1)
    positions += directions * (sums / counts / np.where(lengths > 0.0, lengths, 1.0))[:, None]
    first_points = np.arange(mesh.n_faces, dtype=np.int32)[:, None, None] * len(points)
    return Mesh(
        positions=positions,
        faces=vertices[:, pieces].reshape(-1, 3),
        uvs=uvs,
        uv_faces=(first_points + pieces).reshape(-1, 3),
        name=mesh.name,
    )


def _lattice(segments: int) -> tuple[IntArray, IntArray]:
    """Points and pieces of a face cut into segments x segments triangles.

    Returns
    -------
    points : (P, 2) int32
        Steps of each point toward the face's second and third corner.
    pieces : (segments^2, 3) int32
        Indices into `points`, wound as the face is.
    """
    steps = np.arange(segments + 1)
    along, up = (grid.ravel() for grid in np.meshgrid(steps, steps))
    kept = along + up <= segments
    points = np.stack([along[kept], up[kept]], axis=1).astype(np.int32)
    index = np.full((segments + 2, segments + 2), -1, np.int32)
    index[points[:, 1], points[:, 0]] = np.arange(len(points))
    i, j = points.T
    upright = np.stack([index[j, i], index[j, i + 1], index[j + 1, i]], axis=1)
    turned = np.stack([index[j, i + 1], index[j + 1, i + 1], index[j + 1, i]], axis=1)
    pieces = np.concatenate([upright, turned])
    return points, pieces[(pieces >= 0).all(axis=1)]


def _lattice_vertices(
    mesh: Mesh, points: IntArray, segments: int, threads: int | None
) -> tuple[IntArray, int]:
    """(F, P) int32: the vertex at each lattice point of each face; and the number of vertices.

    Faces that share a position, or an edge between two positions, share the vertices on it.
    """
    firsts = weld_rows(mesh.positions, threads=threads)
    used, corners = np.unique(firsts[mesh.faces], return_inverse=True)
    corners = corners.reshape(-1, 3)
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).astype(np.int64)
    keys = ends.min(axis=-1) * len(used) + ends.max(axis=-1)
    edge_keys, edges = np.unique(keys, return_inverse=True)
    edges = edges.reshape(-1, 3)
    n_inner = segments - 1
    n_shared = len(used) + len(edge_keys) * n_inner
    i, j = points.T.astype(np.int64)
    vertices = np.empty((len(corners), len(points)), np.int64)
    inside = (i > 0) & (j > 0) & (i + j < segments)
    n_inside = int(inside.sum())
    vertices[:, inside] = n_shared + np.arange(len(corners) * n_inside).reshape(
        len(corners), n_inside
    )
    # Edge k runs from corner k to the next; a point's step along it counts from the lower vertex.
    for edge, (on_edge, steps) in enumerate(
        ((j == 0, i), (i + j == segments, j), (i == 0, segments - j))
    ):
        between = on_edge & (steps > 0) & (steps < segments)
        forward = (ends[:, edge, 0] < ends[:, edge, 1])[:, None]
        step = np.where(forward, steps[between], segments - steps[between])
        vertices[:, between] = len(used) + edges[:, edge, None] * n_inner + step - 1
        vertices[:, on_edge & (steps == 0)] = corners[:, edge, None]
    return vertices.astype(np.int32), n_shared + len(corners) * n_inside


@kernel
def _base_kernel(face_ids, weights, piece_weights, base_ids, base_weights, start, stop):  # type: ignore[no-untyped-def]
    n_pieces = len(piece_weights)
    for row in range(start, stop):
        for column in range(face_ids.shape[1]):
            face = face_ids[row, column]
            if face < 0:
                base_ids[row, column] = -1
                continue
            base_ids[row, column] = face // n_pieces
            corners = piece_weights[face % n_pieces]
            weight1, weight2 = weights[row, column, 0], weights[row, column, 1]
            for k in range(2):
                base_weights[row, column, k] = (
                    (1.0 - weight1 - weight2) * corners[0, k]
                    + weight1 * corners[1, k]
                    + weight2 * corners[2, k]
                )


def on_base(visibility: Visibility, *, segments: int, threads: int | None = None) -> Visibility:
    """What the samples of a displaced mesh see, told as places on the mesh it was made from.

    So tangents and normals of the base can be carried along, interpolated as on the base itself.
    """
    points, pieces = _lattice(segments)
    piece_weights = points[pieces] / segments
    face_ids = np.empty_like(visibility.face_ids)
    weights = np.zeros_like(visibility.barycentrics)

    def work(start: int, stop: int) -> None:
        _base_kernel(
            visibility.face_ids, visibility.barycentrics, piece_weights,
            face_ids, weights, start, stop,
        )  # fmt: skip

    run_bands(work, len(face_ids), band=_BAND, threads=threads)
    return Visibility(face_ids, weights, visibility.depths, visibility.back_facing)
