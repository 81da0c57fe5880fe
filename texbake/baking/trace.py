"""The rays of a bake: every owned sample of the texture to a hit on the high-poly mesh."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.baking.pineda import NO_FACE
from texbake.baking.rays import RayField, RayMaps
from texbake.baking.scenes import BakeScenes
from texbake.baking.secondary_rays import SecondaryRays
from texbake.baking.texels import (
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_bands,
    snap_uvs,
)
from texbake.errors import OptionError
from texbake.mesh.mesh import IntArray, Mesh
from texbake.progress import Stages
from texbake.raycast.exact_hits import drop_uncertain_hits, retry_misses
from texbake.raycast.fans import OcclusionRange
from texbake.raycast.rays import NO_HIT, RayHits, Rays


@dataclass
class TraceCounts:
    """Figures of a trace, counted while it runs."""

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
        Rays to cast from every hit; None where no map needs any.
    ray_maps : RayMaps, optional
        Images that change the rays.
    scenes : BakeScenes, optional
        What to cast rays into; None: the trace builds its own and closes them.
    counts : TraceCounts
    front, back : float or None
        How far rays go in front of and behind the low-poly surface, in model units; measured once
        the trace has begun, if not given. The front stays None with a cage.
    caster : str
        What casts the rays, once the trace has begun.
    texel_faces : (H, W) int32
        Face of the low-poly mesh that owns the texel (its first owned sample), `NO_FACE` for none.
    """

    high: Mesh
    low: Mesh
    options: BakeOptions
    cage: Mesh | None
    stages: Stages
    secondary: SecondaryRays | None = None
    ray_maps: RayMaps | None = None
    scenes: BakeScenes | None = None
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
        """Yield the hits of one band of texels after another, then those that missed at first.

        Raises
        ------
        MeshError
            The meshes are so small or large that float32 maps cannot hold their lengths.
        """
        options = self.options
        grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        faces = self.snap(grid)
        with self.casting() as rays:
            missed: list[Missed] = []
            for band in owned_bands(faces, grid, self.stages, threads=options.threads):
                with self.stages.part("rasterize"):
                    band.note_faces(self.texel_faces)
                self.counts.samples_overlapping += band.n_overlaps
                self.counts.samples_covered += len(band.samples)
                hits, misses = rays.cast(band.samples)
                if misses is not None:
                    missed.append(misses)
                    hits = hits.without(np.flatnonzero(hits.high_faces == NO_HIT))
                yield hits
            if missed:
                yield rays.retry(missed)

    def snap(self, grid: SampleGrid) -> SnappedFaces:
        """Snap the low-poly mesh to a grid, and count the faces that cannot be baked."""
        faces = snap_uvs(self.low, grid)
        self.counts.faces_outside_tile = faces.n_outside_tile
        self.counts.faces_without_uv_area = faces.n_zero_area
        return faces

    @contextmanager
    def casting(self) -> Iterator[SampleCaster]:
        """Yield what casts the rays of samples, with scenes built and all distances measured.

        Raises
        ------
        MeshError
            The meshes are so small or large that float32 maps cannot hold their lengths.
        """
        scenes = self.scenes or self.own_scenes()
        self.caster = scenes.high.caster
        try:
            ray_field = self._field(scenes)
            secondary = self.secondary
            reach = None if secondary is None else secondary.occlusion_range(scenes)
            yield SampleCaster(self, scenes, ray_field, reach)
        finally:
            if self.scenes is None:
                scenes.close()

    def own_scenes(self) -> BakeScenes:
        """Build the scenes that the trace needs; the caller closes them."""
        n_low = self.low.n_faces * (1 if self.cage is None else 2)
        chunk = self.options.chunk_faces(self.high.n_faces, n_low)
        if chunk is not None and self.secondary is not None:
            raise OptionError(
                f"max_memory: {self.high.name} would be traced in chunks, and ambient occlusion, "
                "bent normals and thickness need all of it at once; bake them separately, without "
                "`max_memory`"
            )
        return BakeScenes.build(
            self.high, self.low, self.stages, chunk_faces=chunk, threads=self.options.threads
        )

    def _field(self, scenes: BakeScenes) -> RayField:
        """Make the rays; distances that were not given are measured first."""
        options = self.options
        if self.back is None or (self.front is None and self.cage is None):
            # Where a mask changes their direction, rays may be those of the faces.
            skewed = self.ray_maps is not None and self.ray_maps.skew is not None
            kinds = (options.rays, "face") if skewed else (options.rays,)
            with self.stages.stage("measure distances"):
                extent = scenes.extent(self.low, kinds, options.threads)
            if self.front is None and self.cage is None:
                self.front = extent.front
            self.back = extent.back if self.back is None else self.back
        with self.stages.part("prepare low-poly mesh"):
            return RayField(
                self.low,
                scenes.frame,
                kind=options.rays,
                front=self.front or 0.0,
                back=self.back,
                cage=self.cage,
                maps=self.ray_maps,
                threads=options.threads,
            )


@dataclass(frozen=True, eq=False)
class Missed:
    """Samples whose rays hit nothing, or too close to an edge to be certain.

    Attributes
    ----------
    samples : Samples
    rays : Rays
        One per sample.
    n_uncertain : int
        How many of them were uncertain hits.
    """

    samples: Samples
    rays: Rays
    n_uncertain: int


@dataclass(frozen=True, eq=False)
class SampleCaster:
    """Casts rays of samples while the scenes of a trace are open; the trace counts them.

    Attributes
    ----------
    occlusion_range : OcclusionRange, optional
        Of the secondary rays; None: none are cast.
    """

    trace: Trace
    scenes: BakeScenes
    field: RayField
    occlusion_range: OcclusionRange | None

    def cast(self, samples: Samples) -> tuple[Hits, Missed | None]:
        """Return hits and misses of some samples, in their order, and those to retry, if any."""
        trace, scene = self.trace, self.scenes.high
        options = trace.options
        with trace.stages.part("cast rays"):
            rays = self.field.rays(samples)
            found = scene.cast(rays, cull_back_faces=options.cull_back_faces)
            n_uncertain = drop_uncertain_hits(found, rays, scene.mesh, scene.frame, options.threads)
            self._count(found)
            hits = Hits.of(samples, rays, found, scene.frame, threads=options.threads)
            missed = found.faces == NO_HIT
        hits = self._cast_secondary(hits)
        if missed.any():
            return hits, Missed(samples.where(missed), rays.where(missed), n_uncertain)
        return hits, None

    def retry(self, missed: list[Missed]) -> Hits:
        """Return the exact hits of samples that missed, and the remaining misses, in order."""
        trace, scene = self.trace, self.scenes.high
        options = trace.options
        with trace.stages.stage("retry missed rays", unit="rays"):
            samples = Samples.joined([part.samples for part in missed])
            rays = Rays.joined([part.rays for part in missed])
            found = retry_misses(
                rays,
                scene.mesh,
                scene.frame,
                cull_back_faces=options.cull_back_faces,
                threads=options.threads,
            )
            n_found = int(np.count_nonzero(found.faces != NO_HIT))
            n_uncertain = sum(part.n_uncertain for part in missed)
            trace.counts.rays_recovered += max(n_found - n_uncertain, 0)
            trace.counts.rays_missed -= n_found
            hits = Hits.of(samples, rays, found, scene.frame, threads=options.threads)
        return self._cast_secondary(hits)

    def _cast_secondary(self, hits: Hits) -> Hits:
        """Add what rays from the hits meet, where a map needs it."""
        secondary = self.trace.secondary
        if secondary is None or self.occlusion_range is None:
            return hits
        with self.trace.stages.part("secondary rays"):
            hits, n_rays = secondary.cast(hits, self.scenes, self.occlusion_range)
        self.trace.counts.secondary_rays += n_rays
        return hits

    def _count(self, found: RayHits) -> None:
        counts = self.trace.counts
        counts.rays_cast += len(found.faces)
        counts.rays_missed += int(np.count_nonzero(found.faces == NO_HIT))
        counts.rays_past_back_faces += int(np.count_nonzero(found.passed_back))
