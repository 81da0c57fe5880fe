"""Rays through embreex's public interface: slower, for systems where its library is not found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.found import Found, refine_kernel
from texbake.baking.hits import NO_HIT
from texbake.baking.rays import Rays
from texbake.baking.secondary.fans import Fans
from texbake.baking.secondary.reach import Reach
from texbake.errors import DependencyError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh

_MOST_BACK_FACES = 64  # surfaces passed through from behind before a ray counts as a miss


class EmbreexCaster:
    """Casts all rays in one call, and those that met a back face again from behind it."""

    name = "embreex"

    def __init__(self, high: Mesh, frame: LocalFrame) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise DependencyError(
                f"embreex: it does not load ({error}); install it with: pip install embreex"
            ) from error
        self._scene = EmbreeScene(robust=True)
        positions = frame.to_local(high.positions).astype(np.float32)
        self._mesh = TriangleMesh(self._scene, positions, high.faces)
        self._high, self._frame = high, frame
        self._positions = positions

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> Found:
        """Find the nearest hit of each ray within its length."""
        found = Found.nothing(len(rays))
        starts = np.zeros(len(rays))
        open_rays = np.flatnonzero(rays.lengths > 0.0)
        for _ in range(_MOST_BACK_FACES):
            if len(open_rays) == 0:
                break
            open_rays = self._cast_once(rays, open_rays, starts, found, cull_back_faces)
        lines = (rays.origins, rays.directions, rays.lengths)
        triangles = (self._high.positions, self._high.faces, self._frame.center, self._frame.scale)
        refine_kernel(triangles, lines, (found.faces, found.barycentrics, found.distances))
        return found

    def _cast_once(
        self,
        rays: Rays,
        chosen: np.ndarray[tuple[int], np.dtype[np.intp]],
        starts: np.ndarray[tuple[int], np.dtype[np.float64]],
        found: Found,
        cull: bool,
    ) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Cast the chosen rays from their starts on; return those that must go on."""
        directions = rays.directions[chosen]
        origins = rays.origins[chosen] + directions * starts[chosen, np.newaxis]
        result = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            (rays.lengths[chosen] - starts[chosen]).astype(np.float32),
            query="INTERSECT",
            output=True,
        )
        faces = result["primID"].astype(np.int32)
        corners = self._positions[self._high.faces[faces]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        hit = faces != NO_HIT
        behind = hit & (np.einsum("ij,ij->i", normals, directions) >= 0.0)
        found.passed_back[chosen[behind]] = True
        accepted = hit & ~behind if cull else hit
        ids = chosen[accepted]
        found.faces[ids] = faces[accepted]
        found.barycentrics[ids, 0] = result["u"][accepted]
        found.barycentrics[ids, 1] = result["v"][accepted]
        found.distances[ids] = starts[ids] + result["tfar"][accepted]
        again = chosen[behind & cull]
        # Two float32 steps of the local frame past the surface that was met.
        starts[again] += result["tfar"][behind & cull] + 2.4e-7
        still: np.ndarray[tuple[int], np.dtype[np.intp]] = again[
            starts[again] < rays.lengths[again]
        ]
        return still

    def cast_fans(
        self, fans: Fans, sets: npt.NDArray[np.float32], reach: Reach
    ) -> npt.NDArray[np.float32]:
        """Cast all rays of fans; see `arrays.cast_arrays`."""
        from texbake.baking.secondary.arrays import cast_arrays

        def run(
            origins: npt.NDArray[np.float32],
            directions: npt.NDArray[np.float32],
            lengths: npt.NDArray[np.float32],
            query: str,
        ) -> npt.NDArray[np.generic]:
            values: npt.NDArray[np.generic] = self._scene.run(
                origins, directions, lengths, query=query
            )
            return values

        return cast_arrays(run, fans, sets, reach)

    def close(self) -> None:
        """Free Embree's tree."""
        self._scene = self._mesh = None
