"""Texture coordinates for plain arrays, by the function of xatlas-python."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mapping.unwrap import unwrap
from texbake.mesh.interchange import plain_array
from texbake.mesh.mesh import Float32Array, Mesh


def parametrize(
    positions: npt.ArrayLike,
    indices: npt.ArrayLike,
    normals: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    *,
    threads: int | None = None,
    **changes: Any,
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32], Float32Array]:
    """Unwrap triangles, as `xatlas.parametrize` does; see also `texbake.compat.xatlas`.

    Parameters
    ----------
    positions : (V, 3) float
    indices : (F, 3) int
        Corners of the faces.
    normals, uvs : array, optional
        Accepted as xatlas accepts them, and not used: charts depend on the shape alone.
    threads
        None for every processor; the result does not depend on it.
    **changes
        Fields of `UnwrapOptions`, as in ``parametrize(positions, indices, quality="fast")``.
        Without them the atlas has the quality `good` and suits a texture of 1024 x 1024 texels.

    Returns
    -------
    mapping : (N,) uint32
        The vertex that each vertex of the atlas was: attributes of the atlas are
        ``attributes[mapping]``.
    indices : (F, 3) uint32
        The faces, in their order, as indices into the vertices of the atlas.
    uvs : (N, 2) float32
        Their texture coordinates, in the unit square.

    Raises
    ------
    UnwrapError
        No face has an area, or the charts do not fit.

    Examples
    --------
    >>> vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
    >>> mapping, indices, uvs = parametrize(vertices, [[0, 1, 2], [0, 2, 3]])
    >>> mapping[indices].tolist()
    [[0, 1, 2], [0, 2, 3]]
    >>> uvs.shape
    (4, 2)
    """
    mesh = Mesh(
        positions=plain_array(positions, "positions"),
        faces=plain_array(indices, "indices"),
        name="mesh",
    )
    unwrapped = unwrap(mesh, threads=threads, **changes)
    assert unwrapped.uvs is not None and unwrapped.uv_faces is not None
    pairs = np.stack([unwrapped.faces.ravel(), unwrapped.uv_faces.ravel()], axis=1)
    used, corners = np.unique(pairs, axis=0, return_inverse=True)
    return (
        used[:, 0].astype(np.uint32),
        corners.reshape(-1, 3).astype(np.uint32),
        unwrapped.uvs[used[:, 1]].astype(np.float32),
    )
