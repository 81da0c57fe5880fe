"""Parametric mapping: the surface's own (u, v) as texture coordinates, through a linear map.

A surface made from (u, v) stores them as its texture coordinates. They become
s = au u + bu v + cu and t = av u + bv v + cv, which repeats, rotates or moves the texture.
"""

from __future__ import annotations

import numpy as np

from texbake.errors import OptionError
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh


def parametric(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map the mesh's own (u, v) to (s, t).

    `options`: `linear` is read: (au, bu, cu, av, bv, cv).
    """
    mesh.corner_uvs()  # raises where there are none
    assert mesh.uvs is not None and mesh.uv_faces is not None
    au, bu, cu, av, bv, cv = options.linear
    u, v = mesh.uvs[:, 0], mesh.uvs[:, 1]
    with np.errstate(over="ignore", invalid="ignore"):
        mapped = np.stack([au * u + bu * v + cu, av * u + bv * v + cv], axis=-1)
    corners = mapped[mesh.uv_faces]
    if not np.isfinite(corners).all():
        raise OptionError(f"linear: {options.linear} makes coordinates that are not finite")
    return Projected(corners=corners)
