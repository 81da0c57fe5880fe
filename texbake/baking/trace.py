"""The rays of a bake: every owned sample of the texture to a hit on the high-poly mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.rays import RayField, RayMaps, UnobstructedRays
from texbake.baking.scenes import BakeScenes
from texbake.baking.secondary_rays import SecondaryRays
from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_bands,
    snap_uvs,
)
from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.parallel import run_bands
from texbake.progress import Stages
from texbake.raycast.hemispheres import OcclusionRange
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.scene import RayPlaces


@dataclass
class TraceCounts:
    """Figures of a trace, counted while it runs.

    `rays_to_closest` of the `rays_missed` took the closest point of the high-poly mesh instead.
    `rays_lengthened` found nothing as far as their vertices reach, and something further away.
    `faces_limited` need longer rays somewhere than `max_reach` allows.
    `islands_sharing` are stacked islands for which another one was baked.
    """

    samples_covered: int = 0
    samples_overlapping: int = 0
    faces_outside_tile: int = 0
    faces_without_uv_area: int = 0
    rays_cast: int = 0
    rays_missed: int = 0
    rays_to_closest: int = 0
    rays_lengthened: int = 0
    rays_past_back_faces: int = 0
    secondary_rays: int = 0
    islands_sharing: int = 0
    faces_limited: int = 0


@dataclass(frozen=True, eq=False)
class BakeSetup:
    """What a bake is made of, once its inputs have been checked."""

    kinds: list[MapKind]
    inputs: BakeInputs
    stages: Stages
    cage: Mesh | None = None
    ray_maps: RayMaps | None = None
    # Scenes that other bakes use as well; None: this one builds its own and closes them.
    scenes: BakeScenes | None = None


class Trace:
    """Casts the rays of a bake.

    Attributes
    ----------
    counts : TraceCounts
    secondary : SecondaryRays or None
        Rays to cast from every hit; None where no map needs any.
    front, back : float or None
        How far rays go in front of and behind the low-poly surface, in model units; measured once
        the trace has begun, if not given. The front stays None with a cage.
    median_reach : (float, float) or None
        Front and back at the median vertex, where each vertex has its own.
    caster : str
        What casts the rays, once the trace has begun.
    texel_faces : (H, W) int32
        Face of the low-poly mesh that owns the texel (its first owned sample), `NO_FACE` for none.
    """

    def __init__(self, setup: BakeSetup) -> None:
        self.setup, self.counts = setup, TraceCounts()
        self.low, self.options = setup.inputs.low, setup.inputs.options
        self.stages, self.cage = setup.stages, setup.cage
        self.secondary = SecondaryRays.for_maps(setup.kinds, setup.inputs)
        # A cage has a front distance of its own at each vertex.
        self.front = self.options.front if self.cage is None else None
        self.back = self.options.back
        self.median_reach: tuple[float, float] | None = None
        self.caster = ""
        self.texel_faces: IntArray = np.full(
            (self.options.height_px, self.options.width_px), NO_FACE, dtype=np.int32
        )

    def hits(self) -> Iterator[Hits]:
        """Yield the hits of one band of texels after another."""
        options = self.options
        grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        faces = self.snap(grid)
        with self.casting() as rays:
            in_chunks = rays.scenes.high.in_chunks
            at_once = _SAMPLES_IN_CHUNKS if in_chunks else _SAMPLES_AT_ONCE
            if self.secondary is not None:
                at_once = _SAMPLES_WITH_SECONDARY
            for band in owned_bands(
                faces, grid, self.stages, samples_at_once=at_once, threads=options.threads
            ):
                with self.stages.part("rasterize"):
                    band.note_faces(self.texel_faces)
                self.counts.samples_overlapping += band.n_overlaps
                self.counts.samples_covered += len(band.samples)
                yield rays.cast(band.samples, grid)

    def snap(self, grid: SampleGrid) -> SnappedFaces:
        """Snap the low-poly mesh to a grid, and count the faces that cannot be baked."""
        faces = snap_uvs(self.low, grid)
        self.counts.faces_outside_tile = faces.n_outside_tile
        self.counts.faces_without_uv_area = faces.n_zero_area
        return faces

    @contextmanager
    def casting(self) -> Iterator[SampleCaster]:
        """Yield the caster of the samples' rays, with scenes built and all distances measured."""
        scenes = self.setup.scenes or self.own_scenes()
        self.caster = scenes.high.caster
        try:
            ray_field, longest = self._fields(scenes)
            with self.stages.part("prepare low-poly mesh"):
                _ = ray_field.layout  # made here, before threads ask for it
            secondary = self.secondary
            reach = None if secondary is None else secondary.occlusion_range(scenes)
            yield SampleCaster(self, scenes, ray_field, longest, reach)
        finally:
            if self.setup.scenes is None:
                scenes.close()

    def own_scenes(self) -> BakeScenes:
        """Build the scenes that the trace needs; the caller closes them."""
        n_low = self.low.n_faces * (1 if self.cage is None else 2)
        high = self.setup.inputs.source
        if isinstance(high, StreamedMesh):
            chunk: int | None = self.options.streamed_chunk_faces(n_low)
        else:
            chunk = self.options.chunk_faces(high.n_faces, n_low)
        if chunk is not None and self.options.on_miss == "closest":
            raise OptionError(
                f"max_memory, on_miss: {high.name} would be traced in chunks, and the closest "
                "point needs all of it at once; bake with on_miss neutral, or without max_memory"
            )
        if chunk is not None and self.secondary is not None:
            raise OptionError(
                f"max_memory: {high.name} would be traced in chunks, and ambient occlusion, "
                "bent normals and thickness need all of it at once; bake them separately, without "
                "`max_memory`"
            )
        return BakeScenes.build(
            high,
            self.low,
            self.stages,
            chunk_faces=chunk,
            compact=self.secondary is not None,
            threads=self.options.threads,
        )

    def _fields(self, scenes: BakeScenes) -> tuple[RayField, UnobstructedRays | None]:
        """Make the rays, and those for what they do not find, which reach as far as any.

        Distances that were not given are measured first: at each vertex, where neither is given.
        """
        options = self.options
        if self.back is None or (self.front is None and self.cage is None):
            # Where a mask changes their direction, rays may be those of the faces.
            maps = self.setup.ray_maps
            skewed = maps is not None and maps.skew is not None
            kinds = (options.rays, "face") if skewed else (options.rays,)
            with self.stages.stage("measure distances"):
                extent = scenes.extent(self.low, kinds)
                if self.fits_vertices:
                    scenes.reach(options.rays)
            most = np.inf if options.max_reach is None else options.max_reach
            if self.front is None and self.cage is None:
                self.front = min(extent.front, most)
            self.back = min(extent.back, most) if self.back is None else self.back
        with self.stages.part("prepare low-poly mesh"):
            longest = RayField(
                self.low,
                scenes.frame,
                kind=options.rays,
                front=self.front or 0.0,
                back=self.back,
                cage=self.cage,
                maps=self.setup.ray_maps,
                threads=options.threads,
            )
            if not self.fits_vertices:
                return longest, None
            fitted = scenes.fitted(longest, self.low, options.rays)
            assert fitted.reaches is not None
            if options.max_reach is not None:
                wanted = scenes.reach(options.rays).at(self.low)
                self.counts.faces_limited = int((wanted > fitted.reaches).any(axis=(1, 2)).sum())
            medians = np.median(fitted.reaches.reshape(-1, 2), axis=0)
            front, back = scenes.frame.length_to_model(medians).tolist()
            self.median_reach = front, back
            return fitted, UnobstructedRays(longest, scenes.low_scene)

    @property
    def fits_vertices(self) -> bool:
        """Whether each vertex has ray distances of its own."""
        options = self.options
        is_given = options.front is not None or options.back is not None
        return not is_given and self.cage is None and self.setup.ray_maps is None


# About as many samples are cast before their hits become maps; in chunks more of them, because all
# trees are built each time.
_SAMPLES_AT_ONCE = 1 << 20
_SAMPLES_IN_CHUNKS = 1 << 22
# Fewer where each sample has many secondary rays, so that progress is seen.
_SAMPLES_WITH_SECONDARY = 1 << 16
# Rays of a band, their hits and the rows of `Hits` stay in a processor's cache.
_SAMPLES_PER_BAND = 1 << 14


@dataclass(frozen=True, eq=False)
class SampleCaster:
    """Casts rays of samples while the scenes of a trace are open; the trace counts them."""

    trace: Trace
    scenes: BakeScenes
    field: RayField
    # Rays for the samples whose own miss, or meet a surface from behind; None: they are cast once.
    longest: UnobstructedRays | None
    occlusion_range: OcclusionRange | None  # of the secondary rays; None: none are cast

    def cast(self, samples: Samples, grid: SampleGrid) -> Hits:
        """Return hits and misses of some samples, in their order."""
        scene = self.scenes.high
        with self.trace.stages.part("cast rays"):
            if scene.in_chunks:
                hits, counted = self._cast_by_chunks(samples, grid)
            else:
                hits, counted = self._cast_by_bands(samples, grid)
            counts = self.trace.counts
            counts.rays_cast += len(samples)
            counts.rays_missed += sum(n for n, _, _ in counted)
            counts.rays_past_back_faces += sum(n for _, n, _ in counted)
            counts.rays_lengthened += sum(n for _, _, n in counted)
        if self.trace.options.on_miss == "closest":
            self._take_closest(samples, hits)
        return self._cast_secondary(hits, grid.per_side**2)

    def _take_closest(self, samples: Samples, hits: Hits) -> None:
        """Turn misses into hits at the closest point of a face that faces the ray, in place.

        Where back faces are hit as well, every face counts. A miss stays one where no face does.
        """
        rows = np.flatnonzero(~hits.is_hit)
        if len(rows) == 0:
            return
        options, scenes = self.trace.options, self.scenes
        with self.trace.stages.part("closest points"):
            tree = scenes.closest_tree
            rays = self.field.rays(samples.where(rows))
            reached = np.isfinite(rays.fronts)  # not by rays without a direction
            rows, rays = rows[reached], rays.where(reached)
            points = rays.origins + rays.directions * rays.fronts[:, np.newaxis]
            facing = -rays.directions if options.cull_back_faces else None
            _, faces, weights = tree.closest_points(points, facing=facing, threads=options.threads)
            found = faces != NO_HIT
            rows, faces, weights = rows[found], faces[found], weights[found]
            corners = tree.positions[tree.faces[faces]]
            offsets = pm.vecmat(weights, corners) - points[found]
            hits.high_faces[rows] = faces
            hits.high_barycentrics[rows] = weights[:, 1:]
            hits.offsets[rows] = scenes.frame.length_to_model(offsets)
            self.trace.counts.rays_to_closest += len(rows)

    def _cast_by_chunks(
        self, samples: Samples, grid: SampleGrid
    ) -> tuple[Hits, list[tuple[int, int, int]]]:
        """Cast all samples into one chunk of the high-poly mesh after another."""
        scene, options = self.scenes.high, self.trace.options

        def cast_all(some: Samples, rays_of: RayField | UnobstructedRays) -> tuple[Hits, RayHits]:
            def make(band: slice) -> tuple[Rays, RayPlaces]:
                of_band = some.where(band)
                return rays_of.rays(of_band, threads=1), self.field.places(of_band, grid)

            found = scene.cast_made(len(some), make, cull_back_faces=options.cull_back_faces)
            hits = Hits.empty(some)

            def fill(start: int, stop: int) -> None:
                band = slice(start, stop)
                rays = rays_of.rays(some.where(band), threads=1)
                hits.where(band).fill(some.where(band), rays, found.where(band), scene.frame)

            run_bands(fill, len(some), band=_SAMPLES_PER_BAND, threads=options.threads)
            return hits, found

        hits, found = cast_all(samples, self.field)
        return hits, [self._lengthen(samples, hits, found, cast_all)]

    def _cast_by_bands(
        self, samples: Samples, grid: SampleGrid
    ) -> tuple[Hits, list[tuple[int, int, int]]]:
        """Cast band by band from samples to hits, so that rays need no memory."""
        scene, options = self.scenes.high, self.trace.options
        hits = Hits.empty(samples)
        counted: list[tuple[int, int, int]] = []

        def cast_some(some: Samples, rays_of: RayField | UnobstructedRays) -> tuple[Hits, RayHits]:
            rays = rays_of.rays(some, threads=1)
            places = self.field.places(some, grid)
            found = scene.cast_band(rays, places, cull_back_faces=options.cull_back_faces)
            of_some = Hits.empty(some)
            of_some.fill(some, rays, found, scene.frame)
            return of_some, found

        def cast(start: int, stop: int) -> None:
            some = samples.where(slice(start, stop))
            of_some, found = cast_some(some, self.field)
            counted.append(self._lengthen(some, of_some, found, cast_some))
            hits.where(slice(start, stop)).take(of_some)

        run_bands(cast, len(samples), band=_SAMPLES_PER_BAND, threads=options.threads)
        return hits, counted

    def _lengthen(
        self,
        samples: Samples,
        hits: Hits,
        found: RayHits,
        cast: Callable[[Samples, RayField | UnobstructedRays], tuple[Hits, RayHits]],
    ) -> tuple[int, int, int]:
        """Cast the longest rays for what was not found, and change the hits in place.

        A ray that met a surface from behind may have started inside of a part that stands out; it
        keeps its hit where the longest ray passes a back face as well.

        Returns the numbers of rays that missed, that passed back faces, and whose hits are those of
        the longest rays.
        """
        missed, passed = found.faces == NO_HIT, found.passed_back
        rows = np.flatnonzero(missed | passed)
        n_missed, n_passed = int(np.count_nonzero(missed)), int(np.count_nonzero(passed))
        if self.longest is None or len(rows) == 0:
            return n_missed, n_passed, 0
        longer, found_again = cast(samples.where(rows), self.longest)
        is_hit = found_again.faces != NO_HIT
        better = is_hit & (missed[rows] | ~found_again.passed_back)
        hits.take(longer.where(better), rows[better])
        n_missed -= int(np.count_nonzero(better & missed[rows]))
        n_passed += int(np.count_nonzero(found_again.passed_back[better]))
        n_passed -= int(np.count_nonzero(passed[rows[better]]))
        return n_missed, n_passed, int(np.count_nonzero(better))

    def _cast_secondary(self, hits: Hits, n_samples: int) -> Hits:
        """Add what rays from the hits meet, where a map needs it."""
        secondary = self.trace.secondary
        if secondary is None or self.occlusion_range is None:
            return hits
        with self.trace.stages.part("secondary rays"):
            hits, n_rays = secondary.cast(hits, self.scenes, self.occlusion_range, n_samples)
        self.trace.counts.secondary_rays += n_rays
        return hits
