"""How far the longest rays may go: not through another part of the low-poly mesh.

A ray that is cast again, as far as the greatest distance of the bake, could start beyond the next
part of the model, as beyond the next finger of a hand, and hit that instead of its own part. So it
starts no farther out than the first face of the low-poly mesh that faces it from there, and ends
where it leaves its own part of the low-poly mesh at the back. What the low-poly mesh leaves out,
like a stud on a plate, limits nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.mesh.mesh import FloatArray
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

# Where a ray leaves the face it starts from, in the local frame: ten float32 roundings.
_LEAVES = 1e-6


@dataclass(frozen=True, eq=False)
class ClearRays:
    """Rays of a field, made shorter where another part of the low-poly mesh is in the way.

    Attributes
    ----------
    low : RayScene
        The low-poly mesh.
    """

    field: RayField
    low: RayScene

    def rays(self, samples: Samples, *, threads: int | None = None) -> Rays:
        """Return the rays of some samples, in their order."""
        rays = self.field.rays(samples, threads=threads)
        points = rays.origins + rays.fronts[:, None] * rays.directions
        backs = rays.lengths - rays.fronts
        fronts = np.minimum(rays.fronts, self._free(points, -rays.directions, rays.fronts, False))
        backs = np.minimum(backs, self._free(points, rays.directions, backs, True))
        return replace(
            rays,
            origins=points - fronts[:, None] * rays.directions,
            lengths=np.where(rays.lengths > 0.0, fronts + backs, 0.0),
            fronts=fronts,
        )

    def _free(
        self, points: FloatArray, directions: FloatArray, lengths: FloatArray, behind: bool
    ) -> FloatArray:
        """(n,) float64: how far it is to the first face if `behind` is its side; else infinite."""
        starts = points + _LEAVES * directions
        reaches = np.maximum(lengths - _LEAVES, 0.0)
        probes = Rays(starts, directions, reaches, np.zeros(len(points)))
        met = self.low.cast_alone(probes)
        limits = (met.faces != NO_HIT) & (met.passed_back == behind)
        return np.where(limits, met.distances + _LEAVES, np.inf)
