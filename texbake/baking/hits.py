"""Hits of a bake: one row per sample, enough to make any map without casting rays again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texbake.baking.texels import Samples
from texbake.core import core
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, RayHits, Rays, Rows
from texbake.records import dataclass

# Hits whose values stay in a processor's cache while they are computed.
_BAND = 1 << 15


@dataclass(frozen=True, eq=False)
class Hits(Rows):
    """The hits of a bake, one row for each sample that a face of the low-poly mesh owns."""

    # (n,) int32; row times width plus column of the texel of the sample, row 0 at the top.
    texel_ids: IntArray
    low_faces: IntArray  # (n,) int32; face of the low-poly mesh
    # (n, 2) float32; weights of the second and third corner of that face.
    low_barycentrics: Float32Array
    high_faces: IntArray  # (n,) int32; face of the high-poly mesh, `NO_HIT` for a miss
    # (n, 2) float32; weights of the second and third corner of that face.
    high_barycentrics: Float32Array
    # (n, 3) float32; from the sample on the low-poly mesh to the point hit, in model units; 0 for a
    # miss.
    offsets: Float32Array
    # (n, S) float32; what rays from the point hit have met, where a map needs it; 0 for a miss. The
    # columns are those of `texbake.raycast.rays`, lengths in model units.
    secondary: Float32Array | None = None

    @classmethod
    def empty(cls, samples: Samples) -> Hits:
        """Return rows of samples, to be filled."""
        n = len(samples)
        return cls(
            samples.texel_ids,
            samples.faces,
            np.empty((n, 2), dtype=np.float32),
            np.empty(n, dtype=np.int32),
            np.empty((n, 2), dtype=np.float32),
            np.empty((n, 3), dtype=np.float32),
        )

    @property
    def is_hit(self) -> BoolArray:
        """Which rows are hits; the others are misses."""
        return np.asarray(self.high_faces != NO_HIT)

    def computed(
        self,
        values: Float32Array | int,
        kernel: Callable[[Hits, Float32Array], object],
        threads: int | None,
    ) -> Float32Array:
        """(n, C) values of hits, by a kernel in bands: C new channels, or given ones in place."""
        if isinstance(values, int):
            values = np.empty((len(self), values), dtype=np.float32)

        def work(start: int, stop: int) -> None:
            band = slice(start, stop)
            kernel(self.where(band), values[band])

        run_bands(work, len(self), band=_BAND, threads=threads)
        return values

    def interpolated(
        self, values: Float32Array, corners: IntArray, threads: int | None
    ) -> Float32Array:
        """(n, C) float32: values (N, C) of the corners (F, 3) of high-poly faces, at the hits."""

        def interpolate(some: Hits, out: Float32Array) -> None:
            core.interpolate_corners(some.high_faces, some.high_barycentrics, values, corners, out)

        return self.computed(values.shape[1], interpolate, threads)

    def fill(self, samples: Samples, rays: Rays, ray_hits: RayHits, frame: LocalFrame) -> None:
        """Fill in rows of samples from what their rays hit, by `core/sample_rays.c`."""
        self.high_faces[:] = ray_hits.faces
        core.offsets_of_hits(
            samples.barycentrics,
            rays.directions,
            rays.fronts,
            ray_hits.faces,
            ray_hits.barycentrics,
            ray_hits.distances,
            frame.scale,
            self.low_barycentrics,
            self.high_barycentrics,
            self.offsets,
        )
