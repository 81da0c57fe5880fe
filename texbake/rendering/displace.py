"""A mesh displaced by a map for its own sake: as fine as the map, whatever one sees of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.parallel import run_bands
from texbake.rendering.displaced import (
    Displaced,
    Surface,
    displaced,
    interpolated,
    texel_lengths,
)
from texbake.rendering.effects.images import wrap_of
from texbake.rendering.options import RenderOptions
from texbake.rendering.tessellation import Places
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
    """Cut a mesh into small triangles and move them along its smooth normals.

    Parameters
    ----------
    mesh
        With texture coordinates.
    heights : (H, W) or (H, W, 1) float32
        Signed distances in model units, positive outwards, row 0 at the top.
    edge_texels
        Longest edge of a piece in texels. Edges are halved, so that few are shorter than half that.
    max_triangles
        Bound on the pieces; a mesh that has more already is moved as it is.
    threads
        None for every processor.

    Returns
    -------
    Mesh
        Pieces of each face follow one another, in the order of the faces. Vertices at one position
        are one, and stay one; a vertex where the smooth normal is 0 stays where it is.

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    OptionError
        The heights are not one channel or not finite, or `edge_texels` is not above 0.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> sorted(set(displace(plane(), np.full((2, 2), 0.5, np.float32)).positions[:, 2].tolist()))
    [0.5]
    """
    if not edge_texels > 0.0:
        raise OptionError(f"edge_texels: {edge_texels} is not above 0")
    image = heights[..., None] if heights.ndim == 2 else heights
    if image.ndim != 3 or image.shape[2] != 1:
        raise OptionError(f"displacement: the shape {heights.shape} is not (height, width, 1)")
    if not np.isfinite(image).all():
        raise OptionError("displacement: a height is not finite; fill what was not baked first")
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
        Surface(
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
