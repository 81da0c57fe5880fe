"""Texture coordinates for a mesh, by any method, and the report about them.

The mesh only gains coordinates: positions stay bit-equal and faces keep their order. The size and
position of the model change nothing but options that are given in model units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError, UvError, counted
from texbake.mapping.corner_uvs import (
    Projected,
    check_measurable,
    faces_of_group,
    of_whole_mesh,
    selected,
    with_coordinates,
)
from texbake.mapping.distortion import Distortion, distortion, n_used_tiles
from texbake.mapping.options import METHODS, UnwrapOptions, fitting_padding
from texbake.mapping.options.projection import TransformOptions
from texbake.mapping.transform import scale_to_density, transform_uvs
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, Mesh, UvSet
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import duplicate_faces, find_edges
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass

_MARKS = "seams", "protect", "importance"  # what a user gives for the edges and faces of a mesh
_FARTHEST = 1e12  # tiles from the origin; beyond it, float64 cannot resolve 1/4096 of a tile
_MUCH_PADDING = 3  # times the padding that fits the number of charts
_MANY_ODD = 0.1  # per face; fewer charts, faces or edges are few beside the others


def unwrap(
    mesh: MeshLike,
    options: UnwrapOptions | None = None,
    *,
    seams: npt.ArrayLike | None = None,
    protect: npt.ArrayLike | None = None,
    importance: npt.ArrayLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **changes: Any,
) -> Mesh:
    """Give a mesh texture coordinates.

    Parameters
    ----------
    mesh : Mesh
        Existing coordinates are replaced, unless the method or an option uses them.
    options : UnwrapOptions, optional
        None for `UnwrapOptions()`: an atlas in which no two faces overlap.
    seams : (E, 2) int, optional
        Pairs of vertices: charts of an atlas are cut along these edges, and elsewhere only if a
        piece cannot be laid flat otherwise. With None, texbake chooses the seams.
    protect : (n,) int, optional
        Faces (triangles) between which no seam of an atlas runs, unless they cannot be laid flat.
    importance : (F,) float, optional
        For each face (triangle) a number from 0 to 1. A chart of mean x gets 4^x times the texels
        per unit of length that it gets at 0.
    threads
        None for every processor; the result does not depend on it.
    progress
        Receives the progress of the stages.
    **changes
        Fields of `UnwrapOptions` to change in `options`, as in ``unwrap(mesh, size=2048)``.

    Returns
    -------
    Mesh
        The same mesh with `uvs` and `uv_faces`. Tangents are dropped, since they belong to the old
        coordinates. A face without area gets finite coordinates too.

    Raises
    ------
    UnwrapError
        Atlas: no face has an area, or the charts do not fit.
    UvError
        The method or an option needs existing coordinates, and there are none.
    OptionError
        An option has an invalid value, or names a group that does not exist; a pair of `seams` is
        not an edge of the mesh.
    """
    mesh = as_mesh(mesh)
    options = replace(options or UnwrapOptions(), **changes)
    marks = [seams], [protect], [importance]
    return _unwrapped([mesh], options, marks, Stages(progress), threads)[0][0]


def unwrap_with_report(
    mesh: MeshLike,
    options: UnwrapOptions | None = None,
    *,
    seams: npt.ArrayLike | None = None,
    protect: npt.ArrayLike | None = None,
    importance: npt.ArrayLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **changes: Any,
) -> tuple[Mesh, UnwrapReport]:
    """Give a mesh texture coordinates, as `unwrap` does, and measure them."""
    return unwrap_together(
        [as_mesh(mesh)],
        options,
        seams=[seams],
        protect=[protect],
        importance=[importance],
        threads=threads,
        progress=progress,
        **changes,
    )[0]


def unwrap_together(
    meshes: Sequence[MeshLike],
    options: UnwrapOptions | None = None,
    *,
    seams: Sequence[npt.ArrayLike | None] | None = None,
    protect: Sequence[npt.ArrayLike | None] | None = None,
    importance: Sequence[npt.ArrayLike | None] | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **changes: Any,
) -> list[tuple[Mesh, UnwrapReport]]:
    """Unwrap meshes into one texture; `seams`, `protect`, `importance` and reports by mesh."""
    options = replace(options or UnwrapOptions(), **changes)
    stages = Stages(progress)
    marks = [
        [None] * len(meshes) if each is None else each for each in (seams, protect, importance)
    ]
    for name, each in zip(_MARKS, marks, strict=True):
        if len(each) != len(meshes):
            n_meshes = counted(len(meshes), "mesh", "meshes")
            raise OptionError(f"{name}: there are {len(each)} for {n_meshes}; give one for each")
    results = _unwrapped([as_mesh(mesh) for mesh in meshes], options, marks, stages, threads)
    with stages.stage("measure"):
        measured = [
            _measured(mesh.on_uv_set(options.uv_set), mapped.stacked, options, threads)
            for mesh, mapped in results
        ]
    return [
        (
            mesh,
            UnwrapReport(
                mesh=mesh.name,
                n_faces=mesh.n_polygons,
                options=replace(options, padding=mapped.padding),
                tallies=mapped.tallies,
                notes=mapped.notes,
                distortion=figures,
                stages=stages.records,
            ),
        )
        for (mesh, mapped), figures in zip(results, measured, strict=True)
    ]


def _measured(
    mesh: Mesh, stacked: BoolArray | None, options: UnwrapOptions, threads: int | None
) -> Distortion | None:
    """Measure the coordinates without `stacked` faces; None if no face has an area in them."""
    try:
        if stacked is not None:
            mesh = selected(mesh, ~stacked)
        return distortion(mesh, (options.width_px, options.height_px), threads=threads)
    except UvError:
        return None


def _unwrapped(
    meshes: Sequence[Mesh],
    options: UnwrapOptions,
    marks: Sequence[Sequence[Any]],
    stages: Stages,
    threads: int | None,
) -> list[tuple[Mesh, Projected]]:
    """Map the chosen faces of meshes; `marks` has what the user gives, by the names of `_MARKS`."""
    if len(meshes) == 0:
        raise OptionError("meshes: there are none to unwrap")
    for mesh in meshes:
        check_measurable(mesh)
        if options.uv_set is not None and mesh.uvs is None:
            raise UvError(
                f"{mesh.name}: it has no texture coordinates yet, and a further set comes after "
                "the first; leave out uv_set"
            )
    normals, angle = options.normals, options.angle
    if normals != "uv":  # it splits them where coordinates will be split
        meshes = [with_normals(mesh, normals, angle=angle) for mesh in meshes]
    if options.only is None:
        chosen = [np.ones(mesh.n_faces, dtype=bool) for mesh in meshes]
        parts = list(meshes)
    else:
        chosen = [faces_of_group(mesh, options.only) for mesh in meshes]
        parts = [selected(mesh, faces) for mesh, faces in zip(meshes, chosen, strict=True)]
    kinds = [
        name for name, each in zip(_MARKS, marks, strict=True) if any(x is not None for x in each)
    ]
    if options.method == "atlas":
        mapped = _mapped_by_atlas(parts, options, (meshes, chosen, *marks), stages, threads)
    elif kinds:
        what = "charts" if kinds[0] == "importance" else "seams"
        raise OptionError(f"{kinds[0]}: the method {options.method} has no {what}; use atlas")
    elif len(meshes) > 1:
        raise OptionError(
            f"method: {options.method} maps one mesh at a time; for several meshes use atlas"
        )
    else:
        with stages.stage(f"map ({options.method})"):
            mapped = [_mapped_classically(parts[0], options)]
    results = []
    for mesh, faces, part in zip(meshes, chosen, mapped, strict=True):
        corners = part.corners + np.array(options.offset, dtype=np.float64)
        farthest = float(np.abs(corners).max())
        if not farthest <= _FARTHEST:
            raise OptionError(
                f"scale, warp, offset: coordinates would lie up to {farthest:.3g} tiles from the "
                f"origin; keep them within {_FARTHEST:.0e}"
            )
        if mesh.uvs is None:
            corner_uvs = np.zeros((mesh.n_faces, 3, 2))
            if not faces.all():
                n_others = int(mesh.n_faces - faces.sum())
                part.tallies["faces of other groups without coordinates"] = n_others
        else:
            corner_uvs = mesh.corner_uvs().copy()
        corner_uvs[faces] = corners
        unwrapped = with_coordinates(mesh, corner_uvs)
        if normals == "uv":
            unwrapped = with_normals(unwrapped, normals)
        if options.uv_set is not None:
            assert unwrapped.uvs is not None and unwrapped.uv_faces is not None
            further = UvSet(unwrapped.uvs, unwrapped.uv_faces)
            unwrapped = mesh.replace(uv_sets={**mesh.uv_sets, options.uv_set: further})
        results.append((unwrapped, of_whole_mesh(part, faces)))
    return results


def _mapped_by_atlas(
    parts: Sequence[Mesh],
    options: UnwrapOptions,
    marks: tuple[Sequence[Any], ...],
    stages: Stages,
    threads: int | None,
) -> list[Projected]:
    """Map by one atlas; `marks`: meshes, their faces that are parts, and what `_MARKS` names."""
    from texbake.mapping.atlas.atlas import make_atlas
    from texbake.mapping.marked_seams import cuts_of, importance_of, protected_of

    meshes, chosen, seams, protect, importance = marks
    faces_of = list(zip(meshes, chosen, strict=True))
    mapped = []
    atlases = make_atlas(
        parts,
        options,
        stages,
        seams=[cuts_of(*each, edges, options) for each, edges in zip(faces_of, seams, strict=True)],
        protected=[
            protected_of(*each, ids, options) for each, ids in zip(faces_of, protect, strict=True)
        ],
        importance=[
            importance_of(*each, values) for each, values in zip(faces_of, importance, strict=True)
        ],
        threads=threads,
    )
    n_tiles = n_used_tiles(np.concatenate([atlas.corners for atlas in atlases]))
    n_charts = sum(atlas.charts.n_charts for atlas in atlases)
    for part, atlas in zip(parts, atlases, strict=True):
        charts = atlas.charts
        n_stacked = 0 if charts.stacked is None else int(charts.stacked.sum())
        mapped.append(
            Projected(
                corners=transform_uvs(atlas.corners, options),
                tallies={
                    "faces without area, reduced to a point": charts.n_ignored,
                    "faces that share the texels of their mirror images": n_stacked,
                    "mirrored charts, flipped": charts.n_mirrored,
                    "charts split off because they overlapped their own chart": charts.n_split,
                },
                notes=(*charts.notes, *_notes(part, options, n_tiles, n_charts)),
                padding=atlas.padding,
                stacked=charts.stacked,
            )
        )
    return mapped


def _notes(mesh: Mesh, options: UnwrapOptions, n_tiles: int, n_charts: int) -> Iterator[str]:
    """Yield notes on empty tiles, padding larger than charts, and faces that end charts."""
    if n_tiles < options.tiles and not options.by_group and options.texel_density is None:
        yield (
            f"the charts use {n_tiles} of {options.tiles} tiles, because they would not fit at a "
            "higher texel density"
        )
    size, padding = (options.width_px, options.height_px * options.tiles), options.padding or 0
    fitting = fitting_padding(size, n_charts)
    if padding > _MUCH_PADDING * fitting and options.texel_density is None:
        yield (
            f"{n_charts:,} charts with a padding of {padding} leave little room for texels; use a "
            f"padding of {fitting}, or a larger size"
        )
    if n_charts < _MANY_ODD * mesh.n_polygons or options.keep:
        return
    corners = weld_vertices(mesh)[mesh.faces]
    # No edge of more than two faces joins charts, nor does one of faces wound in opposite ways.
    n_repeated = mesh.count_polygons(duplicate_faces(corners))
    if n_repeated > _MANY_ODD * mesh.n_polygons:
        yield (
            f"{n_repeated:,} faces repeat others, so charts end at all their edges; to remove "
            f"these faces: texbake repair {mesh.name} -o OUT.obj"
        )
    n_misoriented = int(find_edges(corners).misoriented.sum())
    if n_misoriented > _MANY_ODD * mesh.n_polygons:
        yield (
            f"neighboring faces point in opposite directions at {n_misoriented:,} edges, so charts "
            f"end there; to flip the minority: texbake repair {mesh.name} -o OUT.obj"
        )


def _mapped_classically(part: Mesh, options: UnwrapOptions) -> Projected:
    """Map by a classical method, then scale to the requested texel density."""
    module, name = METHODS[options.method].function.split(".")
    method = getattr(import_module(f"texbake.mapping.classical.{module}"), name)
    projected: Projected = method(part, options)
    corners = scale_to_density(part, transform_uvs(projected.corners, options), options)
    return replace(projected, corners=corners, padding=options.padding)


@dataclass(frozen=True, kw_only=True)
class UnwrapReport:
    """Report of one unwrap."""

    mesh: str  # name of the mesh
    n_faces: int  # polygons
    options: UnwrapOptions  # the options of the call, with the padding that an atlas has
    tallies: Mapping[str, int]  # counts of special cases by name, such as "faces touching a pole"
    # steps that failed and what was done instead; charts that miss a bound, and why
    notes: tuple[str, ...]
    distortion: Distortion | None  # none if no face has an area in the texture
    stages: list[StageRecord]

    @property
    def n_charts(self) -> int:
        """Number of charts (UV islands)."""
        return 0 if self.distortion is None else self.distortion.n_charts

    @property
    def fill(self) -> float:
        """Share of the used tiles that faces cover; overlaps count twice."""
        return 0.0 if self.distortion is None else self.distortion.packing_efficiency

    @property
    def seconds(self) -> float:
        """Total time of all stages."""
        return sum(stage.seconds for stage in self.stages)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain dicts, lists, numbers and strings."""
        return {
            "mesh": self.mesh,
            "faces": self.n_faces,
            "options": _options_in_use(self.options),
            "charts": self.n_charts,
            "tiles": 0 if self.distortion is None else self.distortion.n_tiles,
            "fill": self.fill,
            "tallies": dict(self.tallies),
            "notes": list(self.notes),
            "distortion": None if self.distortion is None else self.distortion.to_json(),
            "seconds": self.seconds,
            "stages": [asdict(stage) for stage in self.stages],
        }


def _options_in_use(options: UnwrapOptions) -> dict[str, Any]:
    """The options that the method reads; a warp function by its name."""
    shared = ("method", "size", "only", *TransformOptions.__dataclass_fields__)
    names = [*shared, *METHODS[options.method].options]
    names += ["uv_set"] if options.uv_set is not None else []
    values = {name: getattr(options, name) for name in names}
    if callable(options.warp):
        values["warp"] = getattr(options.warp, "__name__", "a function")
    return values
