"""An asset of many parts to its sets of maps: each part baked from its match, then put together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texbake.baking.bake import check_maps
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import map_kinds
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.parts.dense import DenseMeshes
from texbake.baking.parts.light import Layout, LightMesh, LightPart
from texbake.baking.parts.matching import Matching, match_names
from texbake.baking.parts.options import PartsOptions
from texbake.baking.parts.pieces import Piece, pieces_of
from texbake.baking.parts.result import PartsResult
from texbake.baking.parts.work import RayMapsOf, Work
from texbake.baking.rays import check_cage
from texbake.errors import OptionError, TexbakeError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages


def match_parts(
    high: Sequence[Mesh], low: Sequence[Mesh], parts: PartsOptions
) -> tuple[Matching, list[Piece], list[Piece]]:
    """Who would be baked from whom; also the dense and the light parts that the places mean.

    Raises
    ------
    MeshError
        Two light parts are of one name, or nothing matches.
    """
    highs = pieces_of(high, parts.high_suffix)
    lows = pieces_of(low, parts.low_suffix)
    names = [piece.name for piece in highs], [piece.name for piece in lows]
    return match_names(*names, parts), highs, lows


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
    progress: ProgressSink | None = None,
) -> PartsResult:
    """Bake an asset of many parts onto one or several sets of maps.

    Parameters
    ----------
    high, low
        Dense and light meshes, at least one of each; their groups are parts, if names are matched.
    options
        None for `BakeOptions()`; without a time budget, and without keeping hits.
    parts
        None for `PartsOptions()`: each light mesh is baked from all dense ones, onto one map.
    cage
        Of the light mesh, where it is one.
    high_materials, low_materials
        One or None for each mesh.
    ray_maps
        Is asked for the images that change the rays of a set of maps.
    folder
        There, and an existing one: maps that are done wait in files in it, if there is more than
        one set; the result reads them from there.
    progress
        Is told of the stages.

    Returns
    -------
    PartsResult
        The same, byte for byte, for any number of threads. Each part is baked as `bake` would bake
        it alone from its match.

    Raises
    ------
    MeshError, UvError, CageError, MissError, OptionError
        As `bake` and `match_parts`; `BakeOptions.fail_on_miss` counts for each part on each set.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> result = bake_parts([plane()], [plane()], BakeOptions(size=16))
    >>> [(canvas.udim, sorted(found.maps)) for canvas, found in result.canvases.items()]
    [(1001, ['normal'])]
    """
    cage = None if cage is None else as_mesh(cage)
    options, parts = options or BakeOptions(), parts or PartsOptions()
    if not high or not low:
        raise OptionError("parts: there is no dense or no light mesh; give at least one of each")
    if options.time_budget is not None:
        raise OptionError("time-budget: is for the bake of one mesh; give --max-error")
    if options.keep_hits:
        raise OptionError("hits: are kept of a bake of one mesh onto one set of maps")
    if cage is not None:
        if len(low) > 1:
            raise OptionError("cage: is for one light mesh; bake them one by one")
        if options.front is not None:
            raise OptionError("front, cage: rays start on the cage; give one of the two")
        check_cage(cage, low[0])
    dense = DenseMeshes(high, high_materials)
    if "vertex-color" in options.maps and options.vertex_colors == "auto":
        dense.check_colors()
    matching, light, occluders = _light_parts(high, low, parts, cage, low_materials)
    layout = Layout.of(light, parts)
    kinds = map_kinds(options.maps)
    for part in light:
        _check_sources(kinds, options, dense, part)
    work = Work(
        kinds,
        options,
        dense,
        light,
        Stages(progress),
        ray_maps or (lambda _: None),
        parts.udim,
    )
    if matching is not None and parts.occluders == "all":
        work.see(occluders, low)
    return work.bake(layout, matching, parts, folder if len(layout.faces) > 1 else None)


def _check_sources(
    kinds: list[MapKind], options: BakeOptions, dense: DenseMeshes, part: LightPart
) -> None:
    """Raise before any work where no dense mesh of a part has what a map is made from."""
    meshes = dict.fromkeys(piece.mesh for piece in part.sources)
    for kind in kinds:
        errors: list[TexbakeError] = []
        for i in meshes:
            try:
                check_maps(
                    [kind], BakeInputs(dense.meshes[i], part.mesh, options, dense.materials[i])
                )
            except TexbakeError as error:
                errors.append(error)
        if len(errors) == len(meshes):
            raise errors[0]


def _light_parts(
    high: Sequence[Mesh],
    low: Sequence[Mesh],
    parts: PartsOptions,
    cage: Mesh | None,
    materials: Sequence[Materials | None] | None,
) -> tuple[Matching | None, list[LightPart], list[Piece]]:
    """How names match, if they are to; the light parts; and all dense parts not to be ignored."""
    whole = [
        LightMesh(mesh, cage, item)
        for mesh, item in zip(low, materials or [None] * len(low), strict=True)
    ]
    if not parts.match_by_name:
        everything = [Piece(mesh.name, i) for i, mesh in enumerate(high)]
        light = [
            mesh.part(Piece(mesh.mesh.name, i), everything, parts, mesh.mesh.name)
            for i, mesh in enumerate(whole)
        ]
        return None, light, everything
    matching, highs, lows = match_parts(high, low, parts)
    light = []
    for match in matching.matches:
        piece = lows[match.low]
        # Sets that follow the parts have the name that both sides share.
        name = match.base if parts.texture_sets == "groups" else piece.name
        sources = [highs[i] for i in match.highs]
        light.append(whole[piece.mesh].part(piece, sources, parts, name))
    ignored = {*matching.high_ignored}
    return matching, light, [piece for i, piece in enumerate(highs) if i not in ignored]
