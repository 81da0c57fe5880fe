"""The user's meshes as a case of the bench."""

from __future__ import annotations

import numpy as np

from texbake.baking.scenes import measure_extent
from texbake.errors import MeshError
from texbake.mapping.unwrap import unwrap
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.topology import degenerate_faces
from texbake.raycast.scene import RayScene
from texbake.study.bench.cases import BenchCase

_ATLAS_SIZE = 1024


def own_case(high: Mesh, low: Mesh) -> BenchCase:
    """Return a case of a user's pair, as all programs can read it.

    Positions are rounded to float32 and normals are left out. The low-poly mesh is unwrapped if it
    has no texture coordinates. Rays reach as far as texbake measures that they must.
    """
    for mesh in high, low:
        if degenerate_faces(mesh).all():
            raise MeshError(
                f"{mesh.name}: none of its {mesh.n_faces} faces has an area, so there is nothing "
                "to measure; give a mesh with a surface"
            )
    high, low = _bare(high), _bare(low)
    if low.uvs is None:
        low = unwrap(low, size=_ATLAS_SIZE)
    frame = LocalFrame.around(high, low)
    with RayScene.build(high, frame) as scene:
        extent = measure_extent(scene, low, "smooth")
    return BenchCase(name=high.name, high=high, low=low, reach=max(extent.front, extent.back))


def _bare(mesh: Mesh) -> Mesh:
    """Without normals, groups, materials and colors, with the positions that files hold."""
    return Mesh(
        positions=mesh.positions.astype(np.float32).astype(np.float64),
        faces=mesh.faces,
        uvs=mesh.uvs,
        uv_faces=mesh.uv_faces,
        name=mesh.name,
    )
