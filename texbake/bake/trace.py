"""The trace: every owned sample of the texture to a hit on the dense mesh, some rows at a time."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np

from texbake.bake.cast import Caster, open_caster
from texbake.bake.found import Found
from texbake.bake.hits import NO_HIT, Hits
from texbake.bake.options import BakeOptions
from texbake.bake.rays import RayField, Rays
from texbake.bake.texels import (
    NO_FACE,
    TILE,
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_samples,
    rasterize_uv,
    snap_uvs,
)
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import run_bands
from texbake.progress import Stages

_SAMPLES_AT_ONCE = 1 << 20


@dataclass
class TraceCounts:
    """What a trace met, filled while it goes."""

    samples_covered: int = 0
    samples_overlapping: int = 0
    faces_outside_tile: int = 0
    faces_without_uv_area: int = 0
    rays_cast: int = 0
    rays_missed: int = 0
    rays_recovered: int = 0
    rays_past_back_faces: int = 0


@dataclass
class Trace:
    """Casts the rays of a bake.

    Attributes
    ----------
    counts : TraceCounts
    front, back : float or None
        Distances that the rays went, in model units; measured ones once the trace has begun. The
        front stays None with a cage.
    caster : str
        What cast the rays, once the trace has begun.
    texel_faces : (H, W) int32
        Face of the light mesh that owns the texel (its first owned sample), `NO_FACE` for none.
    """

    high: Mesh
    low: Mesh
    options: BakeOptions
    cage: Mesh | None
    stages: Stages
    counts: TraceCounts = field(default_factory=TraceCounts)

    def __post_init__(self) -> None:
        # A cage has a front distance of its own at each vertex.
        self.front = self.options.front if self.cage is None else None
        self.back = self.options.back
        self.caster = ""
        self._grid = SampleGrid(
            self.options.width_px, self.options.height_px, self.options.samples_per_side
        )
        self.texel_faces: IntArray = np.full(
            (self._grid.height, self._grid.width), NO_FACE, dtype=np.int32
        )

    def hits(self) -> Iterator[Hits]:
        """Yield the hits and misses of some rows after another.

        Samples that missed at first and were recovered come last, and are misses before.
        """
        frame = LocalFrame.around(self.high, self.low)
        faces = snap_uvs(self.low, self._grid)
        self.counts.faces_outside_tile = faces.n_outside_tile
        self.counts.faces_without_uv_area = faces.n_zero_area
        with self.stages.stage("build ray tree", total=self.high.n_faces, unit="triangles"):
            caster = open_caster(self.high, frame, threads=self.options.threads)
        self.caster = caster.name
        try:
            field = self._field(frame, caster)
            missed = yield from self._first_look(faces, field, caster, frame)
        finally:
            caster.close()
        if missed:
            with self.stages.stage("retry missed rays", unit="rays"):
                recovered = self._second_look(missed, frame)
            yield recovered

    def _field(self, frame: LocalFrame, caster: Caster) -> RayField:
        """Make the rays' field; distances that were not given are measured first."""
        options = self.options
        if self.back is None or (self.front is None and self.cage is None):
            from texbake.bake.distances import measure_reach

            with self.stages.stage("measure distances"):
                reach = measure_reach(
                    self.high, self.low, frame, caster, options.rays, options.threads
                )
            if self.front is None and self.cage is None:
                self.front = reach.front
            self.back = reach.back if self.back is None else self.back
        with self.stages.part("prepare light mesh"):
            return RayField(
                self.low,
                frame,
                kind=options.rays,
                front=self.front or 0.0,
                back=self.back,
                cage=self.cage,
                threads=options.threads,
            )

    def _first_look(
        self, faces: SnappedFaces, field: RayField, caster: Caster, frame: LocalFrame
    ) -> Generator[Hits, None, list[tuple[Samples, Rays]]]:
        grid, threads = self._grid, self.options.threads
        missed: list[tuple[Samples, Rays]] = []
        step = rows_at_once(grid)
        n_texels = grid.width * grid.height
        with self.stages.stage("bake", total=n_texels, unit="texels", recorded=False) as advance:
            for first in range(0, grid.height, step):
                rows = range(first, min(first + step, grid.height))
                with self.stages.part("rasterize"):
                    owners, n_overlaps = rasterize_uv(faces, grid, rows, threads=threads)
                    samples = owned_samples(owners, faces, grid, first, threads=threads)
                    self._note_texels(owners, rows)
                    self.counts.samples_overlapping += n_overlaps
                    self.counts.samples_covered += len(samples)
                with self.stages.part("cast rays"):
                    rays = field.rays(samples)
                    found = caster.cast(rays, cull_back_faces=self.options.cull_back_faces)
                    self._count(found)
                    hits = _hits(samples, rays, found, frame, threads)
                lost = found.faces == NO_HIT
                if lost.any():
                    missed.append((samples.where(lost), rays.where(lost)))
                yield hits
                advance(len(rows) * grid.width)
        return missed

    def _second_look(self, missed: list[tuple[Samples, Rays]], frame: LocalFrame) -> Hits:
        from texbake.bake.watertight import retry_watertight

        samples = Samples.joined([part for part, _ in missed])
        rays = Rays.joined([part for _, part in missed])
        found = retry_watertight(
            rays,
            self.high,
            frame,
            cull_back_faces=self.options.cull_back_faces,
            threads=self.options.threads,
        )
        recovered = found.faces != NO_HIT
        n_recovered = int(np.count_nonzero(recovered))
        self.counts.rays_recovered = n_recovered
        self.counts.rays_missed -= n_recovered
        return _hits(samples, rays, found, frame, self.options.threads).where(recovered)

    def _note_texels(self, owners: IntArray, rows: range) -> None:
        per_side = self._grid.per_side
        cells = owners.reshape(len(rows), per_side, self._grid.width, per_side)
        texels = self.texel_faces[rows.start : rows.stop]
        for i in range(per_side):
            for j in range(per_side):
                np.copyto(texels, cells[:, i, :, j], where=texels == NO_FACE)

    def _count(self, found: Found) -> None:
        self.counts.rays_cast += len(found.faces)
        self.counts.rays_missed += int(np.count_nonzero(found.faces == NO_HIT))
        self.counts.rays_past_back_faces += int(np.count_nonzero(found.passed_back))


def rows_at_once(grid: SampleGrid) -> int:
    """Rows of texels in one go: whole rows of tiles, about `_SAMPLES_AT_ONCE` samples."""
    least = TILE // grid.per_side
    rows = _SAMPLES_AT_ONCE // (grid.n_columns * grid.per_side)
    return max(rows // least, 1) * least


def _hits(
    samples: Samples, rays: Rays, found: Found, frame: LocalFrame, threads: int | None
) -> Hits:
    """Put rays and what they found together, lengths in model units."""
    n = len(samples)
    hits = Hits(
        samples.texel_ids,
        samples.faces,
        np.empty((n, 2), dtype=np.float32),
        found.faces,
        np.empty((n, 2), dtype=np.float32),
        np.empty((n, 3), dtype=np.float32),
    )

    def fill(start: int, stop: int) -> None:
        band = slice(start, stop)
        _hits_kernel(
            (samples.barycentrics[band], rays.directions[band], rays.fronts[band]),
            (found.faces[band], found.barycentrics[band], found.distances[band]),
            frame.scale,
            (hits.low_barycentrics[band], hits.high_barycentrics[band], hits.offsets[band]),
        )

    run_bands(fill, n, band=1 << 16, threads=threads)
    return hits


@kernel
def _hits_kernel(lines, found, scale, hits):  # type: ignore[no-untyped-def]
    sample_barycentrics, directions, fronts = lines
    faces, barycentrics, distances = found
    low_barycentrics, high_barycentrics, offsets = hits
    for i in range(len(faces)):
        for k in range(2):
            low_barycentrics[i, k] = sample_barycentrics[i, k]
            high_barycentrics[i, k] = barycentrics[i, k]
        depth = (distances[i] - fronts[i]) / scale if faces[i] != NO_HIT else 0.0
        for axis in range(3):
            offsets[i, axis] = directions[i, axis] * depth
