"""An asset of many parts to its sets of maps: each part is baked from its match, then combined.

The parts are baked one after another onto one target after another. Only one high-poly part and its
ray scene are held at a time. They are kept if the next target begins with the same part, so that
all tiles of one mesh are baked with one ray scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from texbake.baking.bake import BakeRun, bake, check_maps
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind, map_kinds
from texbake.baking.options import BakeOptions
from texbake.baking.parts.high_parts import HighMeshes, NamedPart, match_objects, match_parts
from texbake.baking.parts.low_parts import BakeTarget, LowMesh, LowPart, TargetLayout
from texbake.baking.parts.matching import Matching, PartsOptions
from texbake.baking.parts.result import (
    PartFigures,
    PartsReport,
    PartsResult,
    TargetMaps,
    target_name,
)
from texbake.baking.rays import RayMaps, checked_cage
from texbake.baking.report import DistanceSummary
from texbake.baking.result import BakeResult
from texbake.baking.scenes import BakeScenes, face_outwards
from texbake.errors import OptionError, TexbakeError, UvError, quoted
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import BoolArray, FloatArray, Mesh
from texbake.mesh.objects import joined_objects
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.progress import Progress, Stages
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.sampling.rounds import BudgetClock

# Returns the images that change the rays of a set of maps.
RayMapsOf = Callable[[BakeTarget], RayMaps | None]


@dataclass(eq=False)
class PartsBake:
    """A bake of many parts while it runs."""

    kinds: list[MapKind]
    options: BakeOptions
    high_meshes: HighMeshes
    low_parts: list[LowPart]
    stages: Stages
    ray_maps: RayMapsOf
    report: PartsReport
    part: int | None = None
    # inputs, scenes: of the current part, whose index is `part`.
    inputs: BakeInputs | None = None
    scenes: BakeScenes | None = None
    occluders: RayScene | None = None

    def build_occluders(self, parts: list[NamedPart], low: Sequence[Mesh]) -> None:
        """Build the scene of all parts that secondary rays can hit, if any are cast."""
        if all(kind.needs == "hits" for kind in self.kinds):
            return
        mesh, _ = self.high_meshes.joined(parts)
        frame = LocalFrame.around(mesh, *low)
        with self.stages.stage("build ray tree", total=mesh.n_faces, unit="triangles"):
            self.occluders = RayScene.build(mesh, frame, compact=True, threads=self.options.threads)

    def run(self, layout: TargetLayout, folder: Path | None) -> PartsResult:
        """Bake all sets of maps."""
        done: dict[BakeTarget, BakeResult] = {}
        for i, (target, faces) in enumerate(layout.faces.items()):
            place = None if folder is None else folder / str(i)
            if place is not None:
                place.mkdir()
            result = self._target(target, faces, place)
            if result is not None:
                done[target] = result
                self.report.targets[target] = result.report
        if not done:
            raise UvError(
                f"{self.low_parts[0].mesh.name}: its texture coordinates cover no texel of any "
                "map; use a larger `size` or new coordinates"
            )
        self.report.stages = self.stages.records
        return PartsResult(done, self.report)

    def _target(
        self, target: BakeTarget, faces: dict[int, BoolArray], folder: Path | None
    ) -> BakeResult | None:
        """Bake one set of maps; None if no part covers a texel of it."""
        is_tile, report = self.report.options.udim, self.report
        maps = TargetMaps(self.kinds, self.options, is_tile=is_tile)
        distances = DistanceSummary()
        images = self.ray_maps(target)
        for i, chosen in faces.items():
            part = self.low_parts[i]
            inputs = self._take(i).with_low(part.on(chosen, target.udim))
            try:
                result = BakeRun(
                    self.kinds, inputs, self.stages, part.cage, images, self.scenes, distances
                ).run()
            except UvError:
                where = target_name(target) if is_tile else target.texture_set or "the maps"
                report.without_texel.append(f"{part.name} covers no texel of {where}")
                continue
            self.inputs = inputs
            maps.add(result, inputs, part.face_ids, int(chosen.sum()), part.is_stacked)
            of_part = result.report
            report.parts.append(
                PartFigures(
                    target, part.name, tuple(source.name for source in part.sources),
                    int(chosen.sum()), of_part.texels_covered, of_part.texels_missed,
                    of_part.front, of_part.back,
                )
            )  # fmt: skip
        report.n_overlapping += maps.n_overlapping
        assert self.inputs is not None
        return maps.finish(self.inputs.with_options(self.options), self.stages, folder)

    def _take(self, i: int) -> BakeInputs:
        """Make a part the current one: join its high-poly mesh and build the ray scene of it."""
        if self.part == i and self.inputs is not None:
            return self.inputs
        self.inputs = self.scenes = None  # no two ray trees are held at a time
        part = self.low_parts[i]
        high, materials = self.high_meshes.joined(part.sources)
        options = replace(self.options, padding=0, fill="none", denoise=False)
        inputs = BakeInputs.of(high, part.mesh, options, materials, known_bounds=self._bounds())
        scenes = BakeScenes.build(
            high,
            part.mesh,
            self.stages,
            occluders=self.occluders,
            n_parts=len(self.low_parts),
            chunk_faces=options.chunk_faces(high.n_faces, part.mesh.n_faces),
            threads=options.threads,
        )
        self.scenes = scenes
        inputs, self.scenes, orientation = face_outwards(inputs, scenes, self.stages)
        self.report.orientations[part.name] = orientation
        self.part, self.inputs = i, inputs
        return inputs

    def _bounds(self) -> FloatArray | None:
        """(2, 3) float64: the box that positions are encoded in, the same for all parts."""
        if len(self.low_parts) == 1:
            return None
        boxes = [
            mesh.bounds
            for mesh in (*self.high_meshes.meshes, *(part.mesh for part in self.low_parts))
        ]
        lows, highs = zip(*boxes, strict=True)
        return np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])


def bake_parts(
    high: Sequence[Mesh],
    low: Sequence[Mesh],
    options: BakeOptions | None = None,
    parts: PartsOptions | None = None,
    *,
    cage: MeshLike | None = None,
    high_materials: Sequence[Materials | None] | None = None,
    low_materials: Sequence[Materials | None] | None = None,
    ray_maps: RayMapsOf | None = None,
    folder: Path | None = None,
    progress: Progress = None,
) -> PartsResult:
    """Bake an asset of many parts onto one or several sets of maps.

    Parameters
    ----------
    high, low
        High-poly and low-poly meshes, at least one of each. Their groups are parts if parts are
        matched by name, and their objects if all names of these pair up; see `pair_names`.
    options
        None for `BakeOptions()`; without a time budget, and without keeping hits.
    parts
        None for `PartsOptions()`: each low-poly mesh is baked from all high-poly meshes, onto one
        set of maps.
    cage
        Of the low-poly mesh, if there is only one.
    high_materials, low_materials
        One or None for each mesh.
    ray_maps
        Returns the images that change the rays of a set of maps.
    folder
        An existing folder for finished maps, if there is more than one set of maps; the result
        reads them from there. None: they are kept in memory.
    progress
        True shows a bar for the running stage; a listener is called with each stage.

    Returns
    -------
    PartsResult
        The same, byte for byte, for any number of threads. Each part is baked as `bake` bakes it
        alone from its match, but with more than eight parts, texbake measures ray distances at
        fewer points of each.

    Raises
    ------
    MeshError, UvError, CageError, MissError, OptionError
        As `bake` and `match_parts`; `BakeOptions.fail_on_miss` applies to each part
        on each set of maps.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> result = bake_parts([plane()], [plane()], BakeOptions(size=16))
    >>> [(target.udim, sorted(found.maps)) for target, found in result.targets.items()]
    [(1001, ['normal'])]
    """
    cage = None if cage is None else as_mesh(cage)
    options, parts = options or BakeOptions(), parts or PartsOptions()
    if not high or not low:
        raise OptionError("high, low: give at least one high-poly and one low-poly mesh")
    if options.time_budget is not None:
        raise OptionError(
            "time_budget: it applies to the bake of one mesh only; use `max_error` instead"
        )
    if options.keep_hits:
        raise OptionError("keep_hits: hits are kept only of one mesh on one set of maps")
    if cage is not None:
        if len(low) > 1:
            raise OptionError("cage: it belongs to one low-poly mesh; bake the meshes one by one")
        if options.front is not None:
            raise OptionError("front, cage: rays start on the cage; give only one of the two")
        cage = checked_cage(cage, low[0])
    if parts.join_objects:
        high, low = ([joined_objects(mesh) for mesh in meshes] for meshes in (high, low))
    high_meshes = HighMeshes(high, high_materials)
    matching, low_parts, occluders = _low_parts(high, low, parts, cage, low_materials)
    if options.bake_island and (matching is not None or len(low) > 1):
        low_parts = _in_baking_order(options.bake_island, low_parts)
        options = replace(options, bake_island=())
    layout = TargetLayout.of(low_parts, parts)
    kinds = map_kinds(options.maps)
    for part in low_parts:
        _check_sources(kinds, options, high_meshes, part)
    running = PartsBake(
        kinds,
        options,
        high_meshes,
        low_parts,
        Stages(progress),
        ray_maps or (lambda _: None),
        PartsReport(parts, matching, n_crossing=layout.n_crossing, n_outside=layout.n_outside),
    )
    if matching is not None and parts.occluders == "all":
        running.build_occluders(occluders, low)
    return running.run(layout, folder if len(layout.faces) > 1 else None)


def bake_objects(
    high: Mesh | StreamedMesh,
    low: Mesh,
    options: BakeOptions,
    *,
    pair: bool = True,
    cage: Mesh | None = None,
    materials: Materials | None = None,
    skew_mask: FloatArray | None = None,
    offset_map: FloatArray | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> BakeResult:
    """Bake each object from the one of its name if all pair up and `pair`, else as `bake`."""
    paired = None
    if pair and isinstance(high, Mesh) and options.time_budget is None and not options.keep_hits:
        paired = match_objects([high], [low], PartsOptions())
    if paired is None or not isinstance(high, Mesh):
        return bake(
            high, low, options, cage=cage, materials=materials, skew_mask=skew_mask,
            offset_map=offset_map, progress=progress, clock=clock,
        )  # fmt: skip
    images = RayMaps.of(skew_mask, offset_map)
    done = bake_parts(
        [high], [low], options, cage=cage, high_materials=[materials],
        ray_maps=lambda _: images, progress=progress,
    )  # fmt: skip
    (baked,) = done.targets.values()
    warnings = tuple(done.report.part_warnings)
    report = replace(baked.report, n_objects=len(paired[0].matches), of_objects=warnings)
    return replace(baked, report=report)


def _in_baking_order(names: Sequence[str], low_parts: list[LowPart]) -> list[LowPart]:
    """Return the parts with those of some names first, which are baked where parts are stacked."""
    known = [part.name for part in low_parts]
    for name in names:
        if name not in known:
            raise OptionError(
                f"bake_island: no part that is baked is called {quoted(name)}; name one of "
                f"{', '.join(known)}"
            )
    return sorted(low_parts, key=lambda part: part.name not in names)


def _check_sources(
    kinds: list[MapKind], options: BakeOptions, high_meshes: HighMeshes, part: LowPart
) -> None:
    """Raise before any work if no high-poly mesh of a part has what a map is made from."""
    meshes = dict.fromkeys(source.mesh for source in part.sources)
    for kind in kinds:
        errors: list[TexbakeError] = []
        for i in meshes:
            try:
                check_maps(
                    [kind],
                    BakeInputs.of(
                        high_meshes.meshes[i], part.mesh, options, high_meshes.materials[i]
                    ),
                )
            except TexbakeError as error:
                errors.append(error)
        if len(errors) == len(meshes):
            raise errors[0]


def _low_parts(
    high: Sequence[Mesh],
    low: Sequence[Mesh],
    parts: PartsOptions,
    cage: Mesh | None,
    materials: Sequence[Materials | None] | None,
) -> tuple[Matching | None, list[LowPart], list[NamedPart]]:
    """Return the matches, if parts are matched, the low-poly parts, and all parts that occlude."""
    whole = [
        LowMesh(mesh, cage, item)
        for mesh, item in zip(low, materials or [None] * len(low), strict=True)
    ]
    found = match_objects(high, low, parts)
    if found is None and not parts.match_by_name:
        parts.check_matched()
        everything = [NamedPart(mesh.name, i) for i, mesh in enumerate(high)]
        low_parts = [
            mesh.part(NamedPart(mesh.mesh.name, i), everything, parts, mesh.mesh.name)
            for i, mesh in enumerate(whole)
        ]
        return None, low_parts, everything
    matching, highs, lows = found or match_parts(high, low, parts)
    low_parts = []
    for match in matching.matches:
        low_part = lows[match.low]
        # Texture sets that follow the parts have the name that both parts share.
        by_base = parts.match_by_name and parts.texture_sets == "groups"
        name = match.base if by_base else low_part.name
        sources = [highs[i] for i in match.highs]
        low_parts.append(whole[low_part.mesh].part(low_part, sources, parts, name))
    ignored = {*matching.high_ignored}
    return matching, low_parts, [part for i, part in enumerate(highs) if i not in ignored]
