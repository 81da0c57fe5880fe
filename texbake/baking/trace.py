"""The rays of a bake: every owned sample of the texture to a hit on the high-poly mesh."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.rays import RayField, RayMaps, UnobstructedRays
from texbake.baking.scenes import BakeScenes
from texbake.baking.secondary_rays import SecondaryRays
from texbake.baking.texels import NO_FACE, SampleGrid, Samples, SnappedFaces, owned_bands, snap_uvs
from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.parallel import resolve_threads, run_bands
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.scene import RayPlaces, rows_of
from texbake.records import dataclass


@dataclass
class TraceCounts:
    """Figures of a trace, counted while it runs.

    `rays_to_closest` of the `rays_missed` took the closest point instead; `rays_lengthened` hit
    only beyond the reach of their vertices; `faces_limited` met `max_reach`; `islands_sharing` are
    stacked.
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
    # Scenes that other bakes use as well; None: the trace builds its own.
    scenes: BakeScenes | None = None

    @property
    def has_secondary_rays(self) -> bool:
        """Whether a map needs rays from the hits."""
        return any(kind.needs != "hits" for kind in self.kinds)

    def build_scenes(self) -> BakeScenes:
        """Build the scenes that the bake needs alone."""
        options, low, high = self.inputs.options, self.inputs.low, self.inputs.source
        n_low = low.n_faces * (1 if self.cage is None else 2)
        if isinstance(high, StreamedMesh):
            chunk: int | None = options.streamed_chunk_faces(n_low)
        else:
            chunk = options.chunk_faces(high.n_faces, n_low)
        if chunk is not None and options.on_miss == "closest":
            raise OptionError(
                f"max_memory, on_miss: {high.name} would be traced in chunks, and the closest "
                "point needs all of it at once; bake with on_miss neutral, or without max_memory"
            )
        if chunk is not None and self.has_secondary_rays:
            raise OptionError(
                f"max_memory: {high.name} would be traced in chunks, and ambient occlusion, "
                "bent normals and thickness need all of it at once; bake them separately, without "
                "`max_memory`"
            )
        return BakeScenes.build(
            high,
            low,
            self.stages,
            chunk_faces=chunk,
            compact=self.has_secondary_rays,
            threads=options.threads,
        )


# About as many samples are cast before their hits become maps; in chunks more of them, because all
# trees are built each time.
_SAMPLES_AT_ONCE = 1 << 20
_SAMPLES_IN_CHUNKS = 1 << 22
# Fewer where each sample has many secondary rays, so that progress is seen.
_SAMPLES_WITH_SECONDARY = 1 << 16
# Rays of a band. A band costs half a millisecond beside its rays, so large ones, whose rays and
# hits take several megabytes, are faster than small ones that stay in a processor's cache.
_LEAST_BAND, _MOST_BAND = 1 << 13, 1 << 16
# Rays are long if they go farther behind the low-poly surface than about `_LONG` times the width of
# a high-poly triangle. They are first cast over `_NEAR` of that distance.
_LONG, _NEAR = 16.0, 0.25


class Trace:
    """Casts the rays of a bake, with all ray distances measured."""

    def __init__(self, setup: BakeSetup) -> None:
        self.setup, self.counts = setup, TraceCounts()
        self.low, self.options = setup.inputs.low, setup.inputs.options
        self.stages, self.cage = setup.stages, setup.cage
        self.scenes = setup.scenes or setup.build_scenes()
        # How far rays go in front of and behind the low-poly surface, in model units; measured if
        # not given. A cage has a front distance of its own at each vertex.
        self.front = self.options.front if self.cage is None else None
        self.back = self.options.back
        # Front and back at the median vertex, where each vertex has its own.
        self.median_reach: tuple[float, float] | None = None
        # Face that owns the first sample of each texel, `NO_FACE` for none.
        self.texel_faces: IntArray = np.full(
            (self.options.height_px, self.options.width_px), NO_FACE, dtype=np.int32
        )
        # Rays for the samples whose own miss, or meet a surface from behind; None: they are cast
        # once.
        self._longest: UnobstructedRays | None = None
        self._field = self._measured_field()
        with self.stages.part("prepare low-poly mesh"):
            _ = self._field.layout  # computed here, before threads ask for it
        self._secondary = SecondaryRays.for_maps(setup.kinds, setup.inputs, self.scenes)

    def hits(self) -> Iterator[Hits]:
        """Yield the hits of one band of texels after another."""
        options = self.options
        grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        at_once = _SAMPLES_IN_CHUNKS if self.scenes.high.in_chunks else _SAMPLES_AT_ONCE
        if self._secondary is not None:
            at_once = _SAMPLES_WITH_SECONDARY
        for band in owned_bands(
            self.snap(grid), grid, self.stages, samples_at_once=at_once, threads=options.threads
        ):
            with self.stages.part("rasterize"):
                band.note_faces(self.texel_faces)
            self.counts.samples_overlapping += band.n_overlaps
            self.counts.samples_covered += len(band.samples)
            yield self.cast(band.samples, grid)

    def snap(self, grid: SampleGrid) -> SnappedFaces:
        """Snap the low-poly mesh to a grid, and count the faces that cannot be baked."""
        faces = snap_uvs(self.low, grid)
        self.counts.faces_outside_tile = faces.n_outside_tile
        self.counts.faces_without_uv_area = faces.n_zero_area
        return faces

    def _measured_field(self) -> RayField:
        """Make rays, and longest ones for misses, by distances measured where none are given."""
        options, scenes = self.options, self.scenes
        fits_vertices = (
            options.front is None
            and options.back is None
            and self.cage is None
            and self.setup.ray_maps is None
        )
        if self.back is None or (self.front is None and self.cage is None):
            # Where a mask changes their direction, rays may be those of the faces.
            maps = self.setup.ray_maps
            skewed = maps is not None and maps.skew is not None
            kinds = (options.rays, "face") if skewed else (options.rays,)
            with self.stages.stage("measure distances"):
                extent = scenes.extent(kinds)
                if fits_vertices:
                    scenes.reach(self.low, options.rays)
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
            if not fits_vertices:
                return longest
            fitted = scenes.fitted(longest, self.low, options.rays)
            assert fitted.reaches is not None
            if options.max_reach is not None:
                full_reaches = scenes.reach(self.low, options.rays)
                self.counts.faces_limited = int(
                    (full_reaches > fitted.reaches).any(axis=(1, 2)).sum()
                )
            medians = np.median(fitted.reaches.reshape(-1, 2), axis=0)
            front, back = scenes.frame.length_to_model(medians).tolist()
            self.median_reach = front, back
            self._longest = UnobstructedRays(longest, scenes.low_scene)
            return fitted

    def cast(self, samples: Samples, grid: SampleGrid, *, with_secondary: bool = True) -> Hits:
        """Return hits and misses of some samples, in their order, with what rays from them meet."""
        threads = self.options.threads
        hits = Hits.empty(samples)
        counted = [(0, 0, 0)]

        def cast(start: int, stop: int, threads: int | None = 1) -> None:
            band = slice(start, stop)
            counted.append(self._cast_again(samples.where(band), grid, hits.where(band), threads))

        with self.stages.part("cast rays"):
            if self.scenes.high.in_chunks:
                cast(0, len(samples), threads)  # all of them into one chunk after another
            else:
                of_thread = len(samples) // (2 * resolve_threads(threads))
                band = min(max(of_thread, _LEAST_BAND), _MOST_BAND)
                run_bands(cast, len(samples), band=band, threads=threads)
            n_missed, n_passed, n_lengthened = np.sum(counted, axis=0).tolist()
            self.counts.rays_cast += len(samples)
            self.counts.rays_missed += n_missed
            self.counts.rays_past_back_faces += n_passed
            self.counts.rays_lengthened += n_lengthened
        if self.options.on_miss == "closest":
            self._take_closest(samples, hits)
        if self._secondary is None or not with_secondary:
            return hits
        with self.stages.part("secondary rays"):
            hits, n_rays = self._secondary.cast(hits, grid.per_side**2)
        self.counts.secondary_rays += n_rays
        return hits

    def _take_closest(self, samples: Samples, hits: Hits) -> None:
        """Turn misses into hits at the closest point that faces the ray, if any, in place."""
        rows = np.flatnonzero(~hits.is_hit)
        if len(rows) == 0:
            return
        options, scenes = self.options, self.scenes
        with self.stages.part("closest points"):
            tree = scenes.closest_tree
            rays = self._field.rays(samples.where(rows))
            reached = np.isfinite(rays.fronts)  # not by rays without a direction
            rows, rays = rows[reached], rays.where(reached)
            points = rays.origins + rays.directions * rays.fronts[:, np.newaxis]
            facing = -rays.directions if options.cull_back_faces else None
            _, faces, weights = tree.closest_points(points, facing=facing, threads=options.threads)
            found = faces != NO_HIT
            rows, faces, weights = rows[found], faces[found], weights[found]
            offsets = pm.vecmat(weights, tree.positions[tree.faces[faces]]) - points[found]
            hits.high_faces[rows] = faces
            hits.high_barycentrics[rows] = weights[:, 1:]
            hits.offsets[rows] = scenes.frame.length_to_model(offsets)
            self.counts.rays_to_closest += len(rows)

    def _cast(
        self,
        rays_of: RayField | UnobstructedRays,
        samples: Samples,
        grid: SampleGrid,
        hits: Hits,
        threads: int | None,
    ) -> RayHits:
        """Cast the rays of samples, chunk by chunk, and fill in the rows of their hits."""
        scene = self.scenes.high

        def make(band: slice) -> tuple[Rays, RayPlaces]:
            some = samples.where(band)
            return rays_of.rays(some, threads=1), self._field.places(some, grid)

        if not scene.in_chunks:
            all_rays, places = make(slice(None))
            rays_at = rows_of(all_rays, places)
            ray_hits = self._cast_near_first(all_rays, places, threads)
        else:
            rays_at, cull = make, self.options.cull_back_faces
            ray_hits = scene.cast_in_order(
                len(samples), rays_at, cull_back_faces=cull, threads=threads
            )

        def fill(start: int, stop: int) -> None:
            band = slice(start, stop)
            rays, _ = rays_at(band)
            hits.where(band).fill(samples.where(band), rays, ray_hits.where(band), scene.frame)

        run_bands(fill, len(samples), band=_MOST_BAND, threads=threads)
        return ray_hits

    def _cast_near_first(self, rays: Rays, places: RayPlaces, threads: int | None) -> RayHits:
        """Cast long rays over a part of their length first, since short bundles are narrower."""
        scene, cull = self.scenes.high, self.options.cull_back_faces
        mesh = scene.mesh
        size = float(scene.frame.length_to_local(mesh.diagonal)) / math.sqrt(max(mesh.n_faces, 1))
        fronts, lengths = rays.fronts, rays.lengths
        is_long = lengths > fronts + _LONG * size
        lengths = np.where(is_long, (1.0 - _NEAR) * fronts + _NEAR * lengths, lengths)
        near = rows_of(replace(rays, lengths=lengths), places)
        hits = scene.cast_in_order(len(rays), near, cull_back_faces=cull, threads=threads)
        rows = np.flatnonzero(is_long & (hits.faces == NO_HIT))
        if len(rows):
            far = rows_of(rays.where(rows), places.where(rows))
            far_hits = scene.cast_in_order(len(rows), far, cull_back_faces=cull, threads=threads)
            hits.take(far_hits, rows)
        return hits

    def _cast_again(
        self, samples: Samples, grid: SampleGrid, hits: Hits, threads: int | None
    ) -> tuple[int, int, int]:
        """Cast rays, and the longest where these miss or start inside; count all three."""
        first_hits = self._cast(self._field, samples, grid, hits, threads)
        missed, passed = first_hits.faces == NO_HIT, first_hits.passed_back
        rows = np.flatnonzero(missed | passed)
        n_missed, n_passed = int(np.count_nonzero(missed)), int(np.count_nonzero(passed))
        if self._longest is None or len(rows) == 0:
            return n_missed, n_passed, 0
        some = samples.where(rows)
        longer = Hits.empty(some)
        second_hits = self._cast(self._longest, some, grid, longer, threads)
        is_hit = second_hits.faces != NO_HIT
        better = is_hit & (missed[rows] | ~second_hits.passed_back)
        hits.take(longer.where(better), rows[better])
        n_missed -= int(np.count_nonzero(better & missed[rows]))
        n_passed += int(np.count_nonzero(second_hits.passed_back[better]))
        n_passed -= int(np.count_nonzero(passed[rows[better]]))
        return n_missed, n_passed, int(np.count_nonzero(better))
