"""The trace: every owned sample of the texture to a hit on the dense mesh, some rows at a time."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.baking.ray_maps import RayMaps
from texbake.baking.rays import RayField
from texbake.baking.secondary.rays import SecondaryRays
from texbake.baking.texels import (
    NO_FACE,
    TILE,
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_samples,
    rasterize_uv,
    snap_uvs,
)
from texbake.baking.trees import Trees
from texbake.errors import MeshError, OptionError
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import run_bands
from texbake.progress import Stages
from texbake.raycast.exact_hits import drop_uncertain_hits
from texbake.raycast.fans import OcclusionRange
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.scene import RayScene

_SAMPLES_AT_ONCE = 1 << 20

Lost = tuple[Samples, Rays]
# Model units across both meshes, of which float32 holds a ten millionth with all its digits, and
# as many times as rays are long without overflow.
_SIZES = (1e-30, 1e37)


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
    secondary_rays: int = 0


@dataclass
class Trace:
    """Casts the rays of a bake.

    Attributes
    ----------
    secondary : SecondaryRays, optional
        What is cast from every hit; None where no map needs it.
    ray_maps : RayMaps, optional
        Images that change the rays.
    trees : Trees, optional
        Open ray trees over the dense mesh; None: it opens and closes its own.
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
    secondary: SecondaryRays | None = None
    ray_maps: RayMaps | None = None
    trees: Trees | None = None
    counts: TraceCounts = field(default_factory=TraceCounts)

    def __post_init__(self) -> None:
        # A cage has a front distance of its own at each vertex.
        self.front = self.options.front if self.cage is None else None
        self.back = self.options.back
        self.caster = ""
        self.texel_faces: IntArray = np.full(
            (self.options.height_px, self.options.width_px), NO_FACE, dtype=np.int32
        )

    def hits(self) -> Iterator[Hits]:
        """Yield the hits of some rows after another, then what missed at first, found or not.

        Raises
        ------
        MeshError
            The meshes are so small or large that float32 maps cannot hold their lengths.
        """
        options = self.options
        grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        faces = self.snap(grid)
        with self.casting() as casts:
            missed = yield from self._first_look(faces, grid, casts)
            if missed:
                yield casts.look_again(missed)

    def snap(self, grid: SampleGrid) -> SnappedFaces:
        """Put the light mesh onto a grid, and note what of it cannot be baked."""
        faces = snap_uvs(self.low, grid)
        self.counts.faces_outside_tile = faces.n_outside_tile
        self.counts.faces_without_uv_area = faces.n_zero_area
        return faces

    @contextmanager
    def casting(self) -> Iterator[Casts]:
        """Yield what casts rays, with the tree over the dense mesh and all distances known.

        Raises
        ------
        MeshError
            The meshes are so small or large that float32 maps cannot hold their lengths.
        """
        trees = self.trees or self.own_trees()
        self.caster = trees.caster.caster
        try:
            reach = None
            if self.secondary is not None:
                reach = self.secondary.reach(trees.frame, trees.occluders)
            yield Casts(self, trees, self._field(trees), reach)
        finally:
            if self.trees is None:
                trees.close()

    def own_trees(self) -> Trees:
        """Open the ray trees that the trace needs; the caller closes them."""
        n_light = self.low.n_faces * (1 if self.cage is None else 2)
        chunk = self.options.chunk_faces(self.high.n_faces, n_light)
        if chunk is not None and self.secondary is not None:
            raise OptionError(
                f"max-memory: {self.high.name} would be cast at in chunks, and ambient occlusion, "
                "bent normals and thickness need all of it at once; bake them apart without it"
            )
        return open_trees(
            self.high, self.low, self.stages, chunk_faces=chunk, threads=self.options.threads
        )

    def _field(self, trees: Trees) -> RayField:
        """Make the rays' field; distances that were not given are measured first."""
        options = self.options
        if self.back is None or (self.front is None and self.cage is None):
            # Rays that a mask turns may go as those of the faces do.
            turned = self.ray_maps is not None and self.ray_maps.skew is not None
            kinds = (options.rays, "face") if turned else (options.rays,)
            with self.stages.stage("measure distances"):
                reach = trees.reach(self.high, self.low, kinds, options.threads)
            if self.front is None and self.cage is None:
                self.front = reach.front
            self.back = reach.back if self.back is None else self.back
        with self.stages.part("prepare low-poly mesh"):
            return RayField(
                self.low,
                trees.frame,
                kind=options.rays,
                front=self.front or 0.0,
                back=self.back,
                cage=self.cage,
                maps=self.ray_maps,
                threads=options.threads,
            )

    def _first_look(
        self, faces: SnappedFaces, grid: SampleGrid, casts: Casts
    ) -> Generator[Hits, None, list[Lost]]:
        threads = self.options.threads
        missed: list[Lost] = []
        step = rows_at_once(grid)
        n_texels = grid.width * grid.height
        with self.stages.stage("bake", total=n_texels, unit="texels", recorded=False) as advance:
            for first in range(0, grid.height, step):
                rows = range(first, min(first + step, grid.height))
                with self.stages.part("rasterize"):
                    owners, n_overlaps = rasterize_uv(faces, grid, rows, threads=threads)
                    samples = owned_samples(owners, faces, grid, first, threads=threads)
                    self._note_texels(owners, rows, grid)
                    self.counts.samples_overlapping += n_overlaps
                    self.counts.samples_covered += len(samples)
                hits, lost = casts.look(samples)
                if lost is not None:
                    missed.append(lost)
                    hits = hits.without(np.flatnonzero(hits.high_faces == NO_HIT))
                yield hits
                advance(len(rows) * grid.width)
        return missed

    def _note_texels(self, owners: IntArray, rows: range, grid: SampleGrid) -> None:
        per_side = grid.per_side
        cells = owners.reshape(len(rows), per_side, grid.width, per_side)
        texels = self.texel_faces[rows.start : rows.stop]
        for i in range(per_side):
            for j in range(per_side):
                np.copyto(texels, cells[:, i, :, j], where=texels == NO_FACE)


@dataclass
class Casts:
    """What casts the rays of a trace, while its tree stands; the trace keeps the counts."""

    trace: Trace
    trees: Trees
    field: RayField
    reach: OcclusionRange | None
    n_doubtful: int = 0  # hits that wait for the second look

    def look(self, samples: Samples) -> tuple[Hits, Lost | None]:
        """Hits and misses of some samples, in their order, and what missed, if anything did."""
        with self.trace.stages.part("cast rays"):
            rays = self.field.rays(samples)
            found = self.trees.caster.cast(rays, cull_back_faces=self.trace.options.cull_back_faces)
            self.n_doubtful += drop_uncertain_hits(
                found, rays, self.trace.high, self.trees.frame, self.trace.options.threads
            )
            self._count(found)
            hits = _hits(samples, rays, found, self.trees.frame, self.trace.options.threads)
            lost = found.faces == NO_HIT
        hits = self._look_around(hits)
        if lost.any():
            return hits, (samples.where(lost), rays.where(lost))
        return hits, None

    def look_again(self, missed: list[Lost]) -> Hits:
        """Hits of those that missed only by rounding, and the other misses, in their order."""
        from texbake.raycast.exact_hits import retry_misses

        trace = self.trace
        with trace.stages.stage("retry missed rays", unit="rays"):
            samples = Samples.joined([part for part, _ in missed])
            rays = Rays.joined([part for _, part in missed])
            found = retry_misses(
                rays,
                trace.high,
                self.trees.frame,
                cull_back_faces=trace.options.cull_back_faces,
                threads=trace.options.threads,
            )
            n_found = int(np.count_nonzero(found.faces != NO_HIT))
            trace.counts.rays_recovered += max(n_found - self.n_doubtful, 0)
            trace.counts.rays_missed -= n_found
            self.n_doubtful = 0
            hits = _hits(samples, rays, found, self.trees.frame, trace.options.threads)
        return self._look_around(hits)

    def _look_around(self, hits: Hits) -> Hits:
        """Add what rays from the hits meet, where a map needs that."""
        if self.trace.secondary is None or self.reach is None:
            return hits
        with self.trace.stages.part("secondary rays"):
            hits, n_rays = self.trace.secondary.look_around(
                hits, self.trees.frame, self.trees.around or self.trees.caster, self.reach
            )
        self.trace.counts.secondary_rays += n_rays
        return hits

    def _count(self, found: RayHits) -> None:
        counts = self.trace.counts
        counts.rays_cast += len(found.faces)
        counts.rays_missed += int(np.count_nonzero(found.faces == NO_HIT))
        counts.rays_past_back_faces += int(np.count_nonzero(found.passed_back))


def open_trees(
    high: Mesh,
    low: Mesh,
    stages: Stages,
    *,
    frame: LocalFrame | None = None,
    chunk_faces: int | None = None,
    threads: int | None = None,
) -> Trees:
    """Build the tree over a dense mesh, in a frame around both meshes if none is given.

    `chunk_faces` is as for `RayScene.build`.
    """
    frame = LocalFrame.around(high, low) if frame is None else frame
    _check_size(frame, low)
    with stages.stage("build ray tree", total=high.n_faces, unit="triangles"):
        return Trees(frame, RayScene.build(high, frame, chunk_faces=chunk_faces, threads=threads))


def rows_at_once(grid: SampleGrid) -> int:
    """Rows of texels in one go: whole rows of tiles, about `_SAMPLES_AT_ONCE` samples."""
    least = TILE // grid.per_side
    rows = _SAMPLES_AT_ONCE // (grid.n_columns * grid.per_side)
    return max(rows // least, 1) * least


def _hits(
    samples: Samples, rays: Rays, found: RayHits, frame: LocalFrame, threads: int | None
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


def _check_size(frame: LocalFrame, low: Mesh) -> None:
    """Raise where lengths of the meshes do not fit into the numbers of hits and maps."""
    size = 1.0 / frame.scale
    if not _SIZES[0] <= size <= _SIZES[1]:
        raise MeshError(
            f"{low.name}: it and the dense mesh are about {size:.1e} model units across, which the "
            "float32 numbers of maps do not hold; scale both first"
        )


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
