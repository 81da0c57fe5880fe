"""Texture coordinates for a mesh, by any method, and the report about them.

The mesh only gains coordinates: positions stay bit-equal and faces keep their order. The size and
position of the model change nothing but options that are given in model units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import Any

import numpy as np

from texbake.errors import OptionError, UvError
from texbake.mapping.areas import check_measurable
from texbake.mapping.corner_uvs import (
    Projected,
    faces_of_group,
    selected,
    with_coordinates,
    with_selected_corners,
)
from texbake.mapping.distortion import Distortion, distortion
from texbake.mapping.options import METHOD_OPTIONS, UnwrapOptions
from texbake.mapping.options.transform import TransformOptions
from texbake.mapping.transform import at_density, transformed
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.progress import ProgressSink, StageRecord, Stages

# Tiles that coordinates may lie away: of what is farther, float64 has no 1/4096 of a tile left.
_FARTHEST = 1e12


@dataclass(frozen=True, kw_only=True, eq=False)
class _Mapped:
    """Coordinates of one mesh by corner, and what a report says of them."""

    corners: FloatArray
    tallies: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def unwrap(
    mesh: Mesh,
    options: UnwrapOptions | None = None,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
    **changes: Any,
) -> Mesh:
    """Give a mesh texture coordinates.

    Parameters
    ----------
    mesh : Mesh
        Coordinates that it has are replaced, except where the method or an option uses them.
    options : UnwrapOptions, optional
        None for `UnwrapOptions()`: an atlas in which no two faces overlap.
    threads
        None for every processor; the result does not depend on it.
    progress
        Told of the stages.
    **changes
        Fields of `UnwrapOptions` that differ from `options`: ``unwrap(mesh, size=2048)``.

    Returns
    -------
    Mesh
        The same mesh with `uvs` and `uv_faces`; tangents that came with it, made for other
        coordinates, are gone. A face without area gets defined, finite coordinates.

    Raises
    ------
    UnwrapError
        Atlas: no face has an area, or the charts do not fit.
    UvError
        Coordinates that the method or an option builds on are missing.
    OptionError
        A field has a value that it cannot have, or names a group that is not there.
    """
    options = replace(options or UnwrapOptions(), **changes)
    return _unwrapped([mesh], options, Stages(progress), threads)[0][0]


def unwrap_with_report(
    mesh: Mesh,
    options: UnwrapOptions | None = None,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
    **changes: Any,
) -> tuple[Mesh, UnwrapReport]:
    """Give a mesh texture coordinates, as `unwrap`, and measure them."""
    return unwrap_together([mesh], options, threads=threads, progress=progress, **changes)[0]


def unwrap_together(
    meshes: Sequence[Mesh],
    options: UnwrapOptions | None = None,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
    **changes: Any,
) -> list[tuple[Mesh, UnwrapReport]]:
    """Give several meshes texture coordinates in one texture, at one texel density.

    Parameters
    ----------
    meshes : sequence of Mesh
        Each is measured in its own model units.
    options, threads, progress, **changes
        As for `unwrap`; several meshes need the method `atlas`, by which no two faces overlap, of
        whichever meshes they are.

    Returns
    -------
    list of (Mesh, UnwrapReport)
        In the order of the meshes. The stages are those of all together; the figures are those of
        each mesh by itself.

    Raises
    ------
    UnwrapError, UvError, OptionError
        As `unwrap`.
    """
    options = replace(options or UnwrapOptions(), **changes)
    stages = Stages(progress)
    results = _unwrapped(meshes, options, stages, threads)
    with stages.stage("measure"):
        measured = [_measured(mesh, options, threads) for mesh, _ in results]
    return [
        (
            mesh,
            UnwrapReport(
                mesh=mesh.name,
                n_faces=mesh.n_faces,
                options=options,
                tallies=mapped.tallies,
                notes=mapped.notes,
                distortion=figures,
                stages=stages.records,
            ),
        )
        for (mesh, mapped), figures in zip(results, measured, strict=True)
    ]


def _measured(mesh: Mesh, options: UnwrapOptions, threads: int | None) -> Distortion | None:
    """Figures of the coordinates; None where they leave no face any area."""
    try:
        return distortion(mesh, (options.width_px, options.height_px), threads=threads)
    except UvError:
        return None


def _unwrapped(
    meshes: Sequence[Mesh], options: UnwrapOptions, stages: Stages, threads: int | None
) -> list[tuple[Mesh, _Mapped]]:
    """Choose faces, map them, and put their coordinates back into the meshes."""
    if len(meshes) == 0:
        raise OptionError("meshes: there is none to unwrap")
    for mesh in meshes:
        check_measurable(mesh)
    if options.only is None:
        chosen = [np.ones(mesh.n_faces, dtype=bool) for mesh in meshes]
        parts = list(meshes)
    else:
        chosen = [faces_of_group(mesh, options.only) for mesh in meshes]
        parts = [selected(mesh, faces) for mesh, faces in zip(meshes, chosen, strict=True)]
    if options.method == "atlas":
        mapped = _mapped_by_atlas(parts, options, stages, threads)
    elif len(meshes) > 1:
        raise OptionError(f"method: {options.method} maps one mesh at a time; several need atlas")
    else:
        with stages.stage(f"map ({options.method})"):
            mapped = [_mapped_classically(parts[0], options)]
    results = []
    for mesh, faces, part in zip(meshes, chosen, mapped, strict=True):
        corners = part.corners + np.array(options.offset, dtype=np.float64)
        _check_reach(corners)
        corners, n_without = with_selected_corners(mesh, faces, corners)
        if n_without:
            part.tallies["faces of other groups without coordinates"] = n_without
        results.append((with_coordinates(mesh, corners), part))
    return results


def _check_reach(corners: FloatArray) -> None:
    """Raise where coordinates are so far away that nothing could be found in a texture."""
    farthest = float(np.abs(corners).max())
    if not farthest <= _FARTHEST:
        raise OptionError(
            f"scale, warp, offset: coordinates would lie up to {farthest:.3g} tiles away; "
            f"keep them within {_FARTHEST:.0e}"
        )


def _mapped_by_atlas(
    parts: Sequence[Mesh], options: UnwrapOptions, stages: Stages, threads: int | None
) -> list[_Mapped]:
    """Coordinates in one atlas; its texel density is that of the packing."""
    from texbake.mapping.atlas.atlas import make_atlas

    mapped = []
    for atlas in make_atlas(parts, options, stages, threads=threads):
        charts = atlas.charts
        tallies = {
            "faces without area, which get one point each": charts.n_ignored,
            "mirrored charts, turned over": charts.n_mirrored,
            "charts made by taking apart others that lay on themselves": charts.n_split,
        }
        mapped.append(
            _Mapped(
                corners=transformed(atlas.corners, options),
                tallies={name: count for name, count in tallies.items() if count},
                notes=charts.notes,
            )
        )
    return mapped


def _mapped_classically(part: Mesh, options: UnwrapOptions) -> _Mapped:
    """Coordinates by a closed formula, moved on as the options ask."""
    name = options.method.replace("-", "_")  # of the module and of the function in it
    projected: Projected = getattr(import_module(f"texbake.mapping.classical.{name}"), name)(
        part, options
    )
    corners = at_density(part, transformed(projected.corners, options), options)
    return _Mapped(corners=corners, tallies=dict(projected.tallies))


@dataclass(frozen=True, kw_only=True)
class UnwrapReport:
    """Figures of one unwrap.

    Attributes
    ----------
    mesh : str
        Its name.
    n_faces : int
    options : UnwrapOptions
        As asked for.
    tallies : dict of str to int
        What was met on the way, by its name, as in "faces at a pole": how many.
    notes : tuple of str
        Steps that failed and what was done instead; charts that miss a bound, and why.
    distortion : Distortion or None
        None where the coordinates leave no face any area.
    stages : list of StageRecord
    """

    mesh: str
    n_faces: int
    options: UnwrapOptions
    tallies: Mapping[str, int]
    notes: tuple[str, ...]
    distortion: Distortion | None
    stages: list[StageRecord]

    @property
    def n_charts(self) -> int:
        """Pieces of the surface that the texture shows."""
        return 0 if self.distortion is None else self.distortion.n_charts

    @property
    def fill(self) -> float:
        """Share of the tiles in use that faces cover; what is covered twice counts twice."""
        return 0.0 if self.distortion is None else self.distortion.packing_efficiency

    @property
    def seconds(self) -> float:
        """Time of all stages."""
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
    """Fields that the method reads; a function by its name."""
    shared = ("method", "size", "only", *TransformOptions.__dataclass_fields__)
    names = [*shared, *METHOD_OPTIONS[options.method]]
    values = {name: getattr(options, name) for name in names}
    if callable(options.warp):
        values["warp"] = getattr(options.warp, "__name__", "a function")
    return values
