"""Independent ray casters: through the public interface of embreex, and in plain numpy."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from texbake.raycast.rays import DEPTH, N_COLUMNS, NO_HIT, OPEN, OPEN_DIRECTION, RayHits

MAX_BACK_FACES = 64  # back faces that a ray passes through before it counts as a miss
FARTHEST = np.finfo(np.float32).max


def refine(hits, rays, mesh, frame):
    """Where rays meet the planes of the faces they hit, in float64, in place."""
    hit = np.flatnonzero(hits.faces != NO_HIT)
    corners = frame.to_local(mesh.positions)[mesh.faces[hits.faces[hit]]]
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    directions, starts = rays.directions[hit], rays.origins[hit] - a
    slopes = -np.einsum("ij,ij->i", directions, np.cross(b, c))
    moments = np.cross(directions, starts)
    met = slopes != 0.0
    hit, slopes, moments = hit[met], slopes[met], moments[met]
    b, c, starts, directions = b[met], c[met], starts[met], directions[met]
    u = np.clip(-np.einsum("ij,ij->i", moments, c) / slopes, 0.0, 1.0)
    v = np.clip(np.einsum("ij,ij->i", moments, b) / slopes, 0.0, 1.0 - u)
    hits.barycentrics[hit] = np.column_stack([u, v])
    ways = u[:, None] * b + v[:, None] * c - starts
    hits.distances[hit] = np.einsum("ij,ij->i", ways, directions)


def hemisphere_frames(axes):
    """(n, 3, 3) float32: two tangents and the axis of each hemisphere, after Duff et al. 2017."""
    x, y, z = axes.T
    sign = np.where(z >= 0, np.float32(1), np.float32(-1))
    a = -1.0 / (sign + z).astype(np.float64)
    b = (x * y) * a
    first = [1.0 + (sign * x * x) * a, sign * b, -sign * x]
    second = [b, sign + (y * y) * a, -y]
    return np.stack([*first, *second, x, y, z], axis=1).astype(np.float32).reshape(-1, 3, 3)


def hemisphere_directions(frames, planes, local, side):
    """(n, 3) float32: directions from tangent space, mirrored at the planes they lie below."""
    x, y, z = local.T[:, :, np.newaxis]
    directions = x * frames[:, 0] + y * frames[:, 1] + z * frames[:, 2]
    px, py, pz = planes.T
    height = directions[:, 0] * px + directions[:, 1] * py + directions[:, 2] * pz
    below = 2 * np.minimum(height, np.float32(0))
    mirrored = directions - below[:, np.newaxis] * planes
    return np.ascontiguousarray(np.float32(side) * mirrored)


class PlainScene:
    """Tests every ray against every face, by three signed volumes in float64."""

    def __init__(self, mesh, frame):
        self.mesh, self.frame = mesh, frame

    def cast(self, rays, *, cull_back_faces=True):
        hits = RayHits.misses(len(rays))
        corners = self.frame.to_local(self.mesh.positions)[self.mesh.faces]
        for i in range(len(rays)):
            if rays.lengths[i] <= 0.0:
                continue
            direction = rays.directions[i]
            p, q, r = np.moveaxis(corners - rays.origins[i], 1, 0)
            volumes = np.stack([np.cross(r, q), np.cross(p, r), np.cross(q, p)]) @ direction
            total = volumes.sum(axis=0)
            inside = ((volumes >= 0.0).all(axis=0) | (volumes <= 0.0).all(axis=0)) & (total != 0.0)
            with np.errstate(invalid="ignore", divide="ignore"):
                points = (volumes[0, :, None] * p + volumes[1, :, None] * q
                          + volumes[2, :, None] * r) / total[:, None]  # fmt: skip
            distances = np.where(inside, points @ direction, np.inf)
            distances[~((distances >= 0.0) & (distances <= rays.lengths[i]))] = np.inf
            behind = np.where(total <= 0.0, distances, np.inf).min()
            ahead = np.where(total > 0.0, distances, np.inf) if cull_back_faces else distances
            end = rays.lengths[i]
            if np.isfinite(ahead.min()):
                hits.faces[i], hits.distances[i] = ahead.argmin(), ahead.min()
                end = ahead.min()
            hits.passed_back[i] = behind <= end
        refine(hits, rays, self.mesh, self.frame)
        return hits


class EmbreexScene:
    """Casts all rays in one call, and those that hit a back face again from behind it."""

    caster = "embreex"
    in_chunks = False
    threads = None

    def __init__(self, mesh, frame):
        self.mesh = self.source = mesh
        self.frame = frame
        self.positions = frame.to_local(mesh.positions).astype(np.float32)
        self.scene = EmbreeScene(robust=True)
        self.triangles = TriangleMesh(self.scene, self.positions, mesh.faces)

    @classmethod
    def build(cls, mesh, frame, **_):
        return cls(mesh, frame)

    def cast(self, rays, *, cull_back_faces=True, places=None):
        del places
        hits = RayHits.misses(len(rays))
        starts = np.zeros(len(rays))
        open_rays = np.flatnonzero(rays.lengths > 0.0)
        for _ in range(MAX_BACK_FACES):
            if len(open_rays) == 0:
                break
            open_rays = self._cast_once(rays, open_rays, starts, hits, cull_back_faces)
        refine(hits, rays, self.mesh, self.frame)
        return hits

    def cast_in_order(self, n, make, *, cull_back_faces, threads):
        return self.cast(make(slice(n))[0], cull_back_faces=cull_back_faces)

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

    def cast_hemispheres(self, domes, sets, occlusion_range):
        """As `RayScene.cast_hemispheres`, one direction of all hemispheres per call."""
        n, n_rays = len(domes), sets.shape[1]
        results = np.full((n, N_COLUMNS), np.nan, dtype=np.float32)
        frames = hemisphere_frames(domes.axes)
        set_ids = domes.set_ids & np.uint32(len(sets) - 1)

        def cast(side, length, query, j):
            directions = hemisphere_directions(frames, domes.planes, sets[set_ids, j], side)
            origins = domes.points + side * occlusion_range.offset * domes.planes
            lengths = np.full(n, min(length, FARTHEST), dtype=np.float32)
            result = self.scene.run(origins.astype(np.float32), directions, lengths, query=query)
            return result, directions

        if occlusion_range.outer > 0.0:
            sums = np.zeros((n, 4), dtype=np.float32)
            for j in range(n_rays):
                result, directions = cast(1.0, occlusion_range.outer, "OCCLUDED", j)
                free = (result != 0).astype(np.float32)
                sums[:, 0] += free
                sums[:, 1:] += free[:, np.newaxis] * directions
            results[:, OPEN] = sums[:, 0] / n_rays
            results[:, OPEN_DIRECTION] = sums[:, 1:] / n_rays
            closed = sums[:, 0] == 0.0
            results[closed, OPEN_DIRECTION] = domes.axes[closed]
        if occlusion_range.inner > 0.0:
            depths = np.zeros(n, dtype=np.float32)
            for j in range(n_rays):
                depths += cast(-1.0, occlusion_range.inner, "DISTANCE", j)[0].astype(np.float32)
            results[:, DEPTH] = depths / n_rays
        return results
