"""Texture coordinates for any mesh: cut into charts, flattened, packed into one texture.

The mesh is taken as it comes and only gains coordinates: positions stay bit-equal and faces keep
their order. Its size and place change nothing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cut import cut_charts
from texbake.mapping.atlas.pack import pack_charts
from texbake.mapping.distortion import Distortion, distortion
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, StageRecord, Stages


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
    n_charts : int
        Pieces of the surface that the texture shows.
    n_ignored : int
        Faces that lie in no chart because they have no area; each has one point for coordinates.
    n_mirrored_charts : int
        Charts that came out mirrored and were turned over; none is left so.
    n_split_charts : int
        Charts made by taking apart those that lay on themselves; none is left so.
    fill : float
        Share of the texture that charts cover.
    distortion : Distortion
    stages : list of StageRecord
    """

    mesh: str
    n_faces: int
    options: UnwrapOptions
    n_charts: int
    n_ignored: int
    n_mirrored_charts: int
    n_split_charts: int
    fill: float
    distortion: Distortion
    stages: list[StageRecord]

    @property
    def seconds(self) -> float:
        """Time of all stages."""
        return sum(stage.seconds for stage in self.stages)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain dicts, lists, numbers and strings."""
        return {
            "mesh": self.mesh,
            "faces": self.n_faces,
            "options": asdict(self.options),
            "charts": self.n_charts,
            "ignored_faces": self.n_ignored,
            "mirrored_charts_mended": self.n_mirrored_charts,
            "charts_split_off": self.n_split_charts,
            "fill": self.fill,
            "distortion": self.distortion.to_json(),
            "seconds": self.seconds,
            "stages": [asdict(stage) for stage in self.stages],
        }


def unwrap(
    mesh: Mesh,
    options: UnwrapOptions | None = None,
    *,
    progress: ProgressSink | None = None,
    **changes: Any,
) -> Mesh:
    """Give a mesh texture coordinates in which no two faces overlap.

    Parameters
    ----------
    mesh : Mesh
        May have texture coordinates, which are not used.
    options : UnwrapOptions, optional
        None for `UnwrapOptions()`.
    progress
        Told of the stages.
    **changes
        Fields of `UnwrapOptions` that differ from `options`: ``unwrap(mesh, size=2048)``.

    Returns
    -------
    Mesh
        The same mesh with `uvs` and `uv_faces`; tangents that came with it, made for other
        coordinates, are gone. A face without area gets the same point for its three corners.

    Raises
    ------
    UnwrapError
        No face has area, xatlas crashed or took too long, or the charts do not fit.
    OptionError
        A field has a value that it cannot have.
    """
    _, result, _ = _unwrapped(
        mesh, replace(options or UnwrapOptions(), **changes), Stages(progress)
    )
    return result


def unwrap_with_report(
    mesh: Mesh,
    options: UnwrapOptions | None = None,
    *,
    progress: ProgressSink | None = None,
    **changes: Any,
) -> tuple[Mesh, UnwrapReport]:
    """Give a mesh texture coordinates, as `unwrap`, and measure them."""
    options = replace(options or UnwrapOptions(), **changes)
    stages = Stages(progress)
    charts, result, fill = _unwrapped(mesh, options, stages)
    with stages.stage("measure"):
        measured = distortion(result, (options.width_px, options.height_px))
    return result, UnwrapReport(
        mesh=mesh.name,
        n_faces=mesh.n_faces,
        options=options,
        n_charts=charts.n_charts,
        n_ignored=charts.n_ignored,
        n_mirrored_charts=charts.n_mirrored,
        n_split_charts=charts.n_split,
        fill=fill,
        distortion=measured,
        stages=stages.records,
    )


def _unwrapped(mesh: Mesh, options: UnwrapOptions, stages: Stages) -> tuple[Charts, Mesh, float]:
    """Return the charts, the mesh with its coordinates, and how full the texture is."""
    with stages.stage("cut charts"):
        charts = cut_charts(mesh, timeout=options.timeout)
    with stages.stage("pack charts"):
        packing = pack_charts(
            charts.uvs,
            charts.faces,
            charts.chart_ids,
            size=(options.width_px, options.height_px),
            padding=options.padding,
            name=mesh.name,
        )
    result = mesh.replace(uvs=packing.uvs, uv_faces=charts.faces, tangents=None)
    return charts, result, packing.fill
