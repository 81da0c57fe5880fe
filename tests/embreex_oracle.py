"""An independent `RayScene`: rays through the public interface of embreex, slow but plain."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from texbake.raycast.fans import DEPTH, N_COLUMNS, OPEN, OPEN_DIRECTION
from texbake.raycast.moller_trumbore import refine_kernel
from texbake.raycast.packets import directions_kernel, frames_kernel
from texbake.raycast.rays import NO_HIT, RayHits

MAX_BACK_FACES = 64  # back faces that a ray passes through before it counts as a miss
FARTHEST = np.finfo(np.float32).max


class EmbreexScene:
    """Casts all rays in one call, and those that hit a back face again from behind it."""

    caster = "embreex"

    def __init__(self, mesh, frame):
        self.mesh, self.frame = mesh, frame
        self.positions = frame.to_local(mesh.positions).astype(np.float32)
        self.scene = EmbreeScene(robust=True)
        self.triangles = TriangleMesh(self.scene, self.positions, mesh.faces)

    @classmethod
    def build(cls, mesh, frame, **_):
        return cls(mesh, frame)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.scene = self.triangles = None

    def cast(self, rays, *, cull_back_faces=True):
        hits = RayHits.misses(len(rays))
        starts = np.zeros(len(rays))
        open_rays = np.flatnonzero(rays.lengths > 0.0)
        for _ in range(MAX_BACK_FACES):
            if len(open_rays) == 0:
                break
            open_rays = self._cast_once(rays, open_rays, starts, hits, cull_back_faces)
        lines = (rays.origins, rays.directions, rays.lengths)
        triangles = (self.mesh.positions, self.mesh.faces, self.frame.center, self.frame.scale)
        refine_kernel(triangles, lines, (hits.faces, hits.barycentrics, hits.distances))
        return hits

    def _cast_once(self, rays, chosen, starts, hits, cull):
        """Cast the chosen rays from their starts on; return those that must go on."""
        directions = rays.directions[chosen]
        origins = rays.origins[chosen] + directions * starts[chosen, np.newaxis]
        result = self.scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            (rays.lengths[chosen] - starts[chosen]).astype(np.float32),
            query="INTERSECT",
            output=True,
        )
        faces = result["primID"].astype(np.int32)
        corners = self.positions[self.mesh.faces[faces]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        hit = faces != NO_HIT
        behind = hit & (np.einsum("ij,ij->i", normals, directions) >= 0.0)
        hits.passed_back[chosen[behind]] = True
        accepted = hit & ~behind if cull else hit
        ids = chosen[accepted]
        hits.faces[ids] = faces[accepted]
        hits.barycentrics[ids, 0] = result["u"][accepted]
        hits.barycentrics[ids, 1] = result["v"][accepted]
        hits.distances[ids] = starts[ids] + result["tfar"][accepted]
        again = chosen[behind & cull]
        # Two float32 steps of the local frame past the surface that was hit.
        starts[again] += result["tfar"][behind & cull] + 2.4e-7
        return again[starts[again] < rays.lengths[again]]

    def cast_fans(self, fans, sets, occlusion_range):
        """As `RayScene.cast_fans`, one direction of all fans per call."""
        n, n_rays = len(fans), sets.shape[1]
        results = np.full((n, N_COLUMNS), np.nan, dtype=np.float32)
        frames, directions = np.empty((12, n), np.float32), np.empty((3, n), np.float32)
        frames_kernel(fans.axes, fans.planes, 0, frames)
        set_ids = fans.set_ids & np.uint32(len(sets) - 1)

        def cast(side, length, query, j):
            directions_kernel(frames, set_ids, sets, j, np.float32(side), directions)
            origins = fans.points + side * occlusion_range.offset * fans.planes
            lengths = np.full(n, min(length, FARTHEST), dtype=np.float32)
            return self.scene.run(
                origins.astype(np.float32), np.ascontiguousarray(directions.T), lengths, query=query
            )

        if occlusion_range.outer > 0.0:
            sums = np.zeros((n, 4), dtype=np.float32)
            for j in range(n_rays):
                free = (cast(1.0, occlusion_range.outer, "OCCLUDED", j) != 0).astype(np.float32)
                sums[:, 0] += free
                sums[:, 1:] += free[:, np.newaxis] * directions.T
            results[:, OPEN] = sums[:, 0] / n_rays
            results[:, OPEN_DIRECTION] = sums[:, 1:] / n_rays
            closed = sums[:, 0] == 0.0
            results[closed, OPEN_DIRECTION] = fans.axes[closed]
        if occlusion_range.inner > 0.0:
            depths = np.zeros(n, dtype=np.float32)
            for j in range(n_rays):
                depths += cast(-1.0, occlusion_range.inner, "DISTANCE", j).astype(np.float32)
            results[:, DEPTH] = depths / n_rays
        return results
