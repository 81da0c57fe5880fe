"""Charts that a mesh has already."""

from __future__ import annotations

import math

import numpy as np

from texbake.errors import UvError
from texbake.mapping.areas import measurable_uvs, signed_areas, surface_areas
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import IntArray, Mesh


def kept_charts(mesh: Mesh, size: tuple[int, int], *, regions: IntArray | None = None) -> Charts:
    """Take the coordinates of a mesh as its charts, shapes and relative sizes as they are.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates. Charts that lie on one another are charts of their own; mirrored
        ones stay mirrored.
    size : (int, int)
        Texels in a row and rows of the texture that the coordinates were made for.
    regions : (F,) int32, optional
        Faces of different regions share no chart: what they share is taken apart.

    Returns
    -------
    Charts
        In model units: all charts together have the area of the faces in space.

    Raises
    ------
    UvError
        There are no coordinates, or none of the faces has an area in the texture or in space.
    """
    corners = measurable_uvs(mesh) * (np.array(size) / max(size))
    in_texture = float(np.abs(signed_areas(corners)).sum())
    in_space = float(surface_areas(mesh.positions[mesh.faces]).sum())
    if not (in_texture > 0.0 and in_space > 0.0):
        raise UvError(f"{mesh.name}: its faces have no area in the texture; unwrap it without keep")
    assert mesh.uv_faces is not None
    ids = chart_ids(mesh)
    if regions is not None:
        pairs = np.stack([ids, regions], axis=1)
        ids = np.unique(pairs, axis=0, return_inverse=True)[1].astype(np.int32)
    face_charts = np.repeat(ids.reshape(-1, 1), 3, axis=1)
    keys = np.stack([face_charts.ravel(), mesh.uv_faces.ravel()], axis=1)
    _, firsts, faces = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return Charts(
        uvs=corners.reshape(-1, 2)[firsts] * math.sqrt(in_space / in_texture),
        faces=faces.reshape(-1, 3).astype(np.int32),
        chart_ids=face_charts.ravel()[firsts].astype(np.int32),
        n_ignored=0,
        n_mirrored=0,
        n_split=0,
    )
