"""A mesh displaced by a height map at full resolution: the reference for baked maps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.parallel import run_bands
from texbake.rendering.displaced import BaseSurface, Displaced, Places, displaced, texel_lengths
from texbake.rendering.effects.images import wrap_of
from texbake.rendering.options import RenderOptions
from texbake.texture.lookup import lookup, texel_coordinates

# Lookups a band.
_BAND = 1 << 15


def displace(
    mesh: Mesh,
    heights: npt.NDArray[np.float32],
    *,
    edge_texels: float = 1.0,
    max_triangles: int = RenderOptions.max_triangles,
    threads: int | None = None,
) -> Mesh:
    """Cut a mesh with texture coordinates into small triangles and move them along its normals.

    `heights` (H, W) or (H, W, 1) are in model units, positive outwards. No edge of a piece is
    longer than `edge_texels`. Pieces of each face follow one another, in the order of the faces;
    vertices at one position are one, and stay one.
    """
    image = heights[..., None] if heights.ndim == 2 else heights
    corner_uvs = mesh.corner_uvs()
    texels = texel_coordinates(corner_uvs, image.shape[1], image.shape[0])
    wrap = wrap_of(mesh.uvs)

    def moves(places: Places, points: FloatArray) -> FloatArray:
        values = np.empty((len(places.vertices), 1))

        def work(start: int, stop: int) -> None:
            uvs = interpolated(corner_uvs, places, slice(start, stop))
            values[start:stop] = lookup(image, uvs, wrap=wrap, threads=1)

        run_bands(work, len(values), band=_BAND, threads=threads)
        return values

    def excess(now: Displaced) -> FloatArray:
        seen = np.zeros(len(now.points), np.uint8)
        return texel_lengths(now.pieces, texels, seen) / edge_texels

    result = displaced(
        BaseSurface(
            points=mesh.positions,
            faces=mesh.faces,
            normals=smooth_normals(mesh, threads=threads),
            linear=np.eye(3),
        ),
        moves,
        excess,
        max_triangles=max_triangles,
        threads=threads,
    )
    pieces = result.pieces
    corners = Places(
        vertices=pieces.faces.reshape(-1),
        base_faces=np.repeat(pieces.base_faces, 3),
        weights=pieces.base_weights.reshape(-1, 2),
    )
    return Mesh(
        positions=result.positions,
        faces=pieces.faces,
        uvs=interpolated(corner_uvs, corners, slice(None)),
        uv_faces=np.arange(3 * len(pieces.faces), dtype=np.int32).reshape(-1, 3),
        name=mesh.name,
    )


def interpolated(corners: FloatArray, places: Places, rows: slice) -> FloatArray:
    """(n, C) float64: values at corners (F, 3, C), interpolated at places."""
    a, b, c = np.moveaxis(corners[places.base_faces[rows]], 1, 0)
    along, up = places.weights[rows].T.astype(np.float64)
    return np.asarray(a + along[:, None] * (b - a) + up[:, None] * (c - a))


def directed_edges(faces: IntArray) -> IntArray:
    """(E, 2) edges of all faces in their order, without those from a vertex to itself."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return edges[edges[:, 0] != edges[:, 1]]


def are_closed(edges: IntArray) -> bool:
    """Whether directed edges (E, 2) are of a closed surface: each as often as its opposite."""
    forward, counts = np.unique(edges, axis=0, return_counts=True)
    backward, counts_back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    return np.array_equal(forward, backward) and np.array_equal(counts, counts_back)
