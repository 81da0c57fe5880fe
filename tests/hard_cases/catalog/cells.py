"""Texture coordinates for meshes without any: a cell of the texture for each face."""

from __future__ import annotations

from functools import cache

import numpy as np
from catalog.case import Case

from texbake import Mesh


@cache
def in_cells(case: Case[Mesh]) -> Mesh:
    """Mesh of a case, with its own coordinates or one cell for each face, without any unwrap."""
    mesh = case.make()
    if mesh.uvs is not None:
        return mesh
    n = int(np.ceil(np.sqrt(mesh.n_faces)))
    cells = np.arange(mesh.n_faces)
    origins = np.column_stack([cells % n, cells // n]).astype(float)
    corners = (origins[:, None] + [[0.15, 0.15], [0.85, 0.15], [0.15, 0.85]]) / n
    return mesh.replace(
        uvs=corners.reshape(-1, 2), uv_faces=np.arange(3 * mesh.n_faces).reshape(-1, 3)
    )
