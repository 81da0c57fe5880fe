"""`info`: print what is in a mesh file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, field
from typing import TYPE_CHECKING, Any

from texbake.errors import FileFormatError, OptionError, counted
from texbake.files import PathLike
from texbake.records import dataclass
from texbake.schema import Size, option
from texbake.verbs.verb import Extra, Options, Reads, Rows, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mapping.distortion import Distortion
    from texbake.mesh.files.contents import FileContents
    from texbake.mesh.info import MeshInfo
    from texbake.mesh.mesh import Mesh
    from texbake.progress import Progress

Table = list[tuple[str, ...]]
_GROUPS_SHOWN = 12
_CHARTS_SHOWN = 10


@dataclass(frozen=True)
class _TextureSize:
    """The texture that distortion is measured for."""

    size: Size | None = option(
        None, "Width and height in texels of the texture that --uv assumes.", default="1024"
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFileInfo:
    """What `info_file` measured."""

    mesh: MeshInfo
    distortion: Distortion | None = None  # of the texture coordinates, where it was to be measured
    # what a glTF, FBX, OBJ or USD file says besides its surface
    contents: FileContents | None = None
    # width, height and channels of its images by name; None for one that cannot be read
    image_shapes: dict[str, tuple[int, int, int] | None] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        figures: dict[str, Any] = json.loads(self.mesh.to_json())
        if self.contents is not None:
            figures |= {
                "materials": [asdict(material) for material in self.contents.materials],
                "images": self.image_shapes,
                "uv_sets": self.contents.uv_sets,
                "meters_per_unit": self.contents.meters_per_unit,
                "up": self.contents.up,
                "passed_over": self.contents.passed_over,
            }
        if self.distortion is not None:
            figures["distortion"] = self.distortion.to_json()
        return figures

    def tables(self) -> list[Table]:
        """Return tables of the mesh and its file, of the distortion, and of the worst of it.

        Each has rows of a label and a figure, or of more cells below a heading.
        """
        tables: list[Table] = [[*_rows(self.mesh), *_content_rows(self)]]
        if self.distortion is not None:
            tables.append([("Distortion", ""), *self.distortion.table()])
            tables += _worst_tables(self.distortion)
        return tables


@verb(
    Reads("mesh"),
    Extra("--uv", "Measure the texture coordinates as well.", is_flag=True),
    Options(_TextureSize, apart=True),
    Extra("--json as_json", "Print JSON and nothing else.", is_flag=True),
    examples="""
      texbake info scan.ply
      texbake info scan.ply --json
      texbake info low_uv.obj --uv --size 2048
    """,
)
def info_file(
    mesh: PathLike, *, uv: bool = False, size: Size | None = None, progress: Progress = None
) -> JobResult[MeshFileInfo]:
    """Print what is in MESH.

    Prints counts, bounds, texture coordinates, normals, components, boundary and non-manifold
    edges, and degenerate faces; of glTF, FBX, OBJ and USD files also materials, images, UV sets,
    the unit and the up axis. With --uv it also measures how the texture coordinates stretch,
    mirror, overlap and cut the mesh, and lists the charts and faces with the most stretch.
    """
    if size is not None and not uv:
        raise OptionError("size: it is for measuring texture coordinates; give `uv` as well")
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.files import read_mesh
    from texbake.mesh.files.contents import read_contents
    from texbake.mesh.files.source import parsed_once
    from texbake.mesh.info import mesh_info

    with parsed_once():
        read = read_mesh(mesh, progress=progress)
        contents = read_contents(mesh)
    images = {} if contents is None else contents.images
    info = MeshFileInfo(
        mesh=mesh_info(read),
        distortion=_distortion(read, size) if uv else None,
        contents=contents,
        image_shapes={name: _shape(data, name) for name, data in images.items()},
    )
    return JobResult(files=(), report=info)


def _distortion(mesh: Mesh, size: Size | None) -> Distortion:
    from texbake.mapping.distortion import distortion
    from texbake.mapping.options import UnwrapOptions

    return distortion(mesh, (UnwrapOptions() if size is None else UnwrapOptions(size=size)).size)


def _shape(data: bytes | None, name: str) -> tuple[int, int, int] | None:
    """Width, height and channels of an image; None where it is missing or cannot be read."""
    from texbake.texture.image import image_shape

    try:
        return None if data is None else image_shape(data, name)
    except FileFormatError:
        return None


def _rows(info: MeshInfo) -> Rows:
    low, high = info.bounds
    normals = "none" if info.n_normals is None else f"{info.n_normals:,}"
    genus = "" if info.genus is None else f", genus {info.genus:,}"
    extras = [
        name
        for name, there in (("tangents", info.has_tangents), ("colors", info.has_colors))
        if there
    ]
    rows = [
        ("name", info.name),
        ("faces", f"{info.n_faces:,}"),
        *([("triangles", f"{info.n_triangles:,}")] if info.n_triangles > info.n_faces else []),
        ("vertices", f"{info.n_vertices:,}"),
        ("bounds", f"{_point(low)} to {_point(high)}"),
        ("size", f"{_point([b - a for a, b in zip(low, high, strict=True)])}"),
        ("diagonal", f"{info.diagonal:.6g}"),
        ("area", f"{info.area:.6g}"),
        ("texture coordinates", _uvs(info)),
        ("normals", normals),
        ("tangents, colors", ", ".join(extras) or "none"),
        ("components", f"{info.n_components:,}"),
        ("closed", f"yes{genus}" if info.closed else f"no{genus}"),
        ("boundary edges", f"{info.n_boundary_edges:,}"),
        ("non-manifold edges", f"{info.n_non_manifold_edges:,}"),
        ("misoriented edges", f"{info.n_misoriented_edges:,}"),
        ("degenerate faces", f"{info.n_degenerate_faces:,}"),
        ("duplicate faces", f"{info.n_duplicate_faces:,}"),
        ("unused vertices", f"{info.n_unused_vertices:,}"),
        ("vertices at one place", f"{info.n_split_vertices:,}"),
    ]
    groups = [(f"group {group.name}", counted(group.n_faces, "face")) for group in info.groups]
    rows += groups[:_GROUPS_SHOWN]
    if len(groups) > _GROUPS_SHOWN:
        rows.append(("more groups", f"{len(groups) - _GROUPS_SHOWN:,}; --json lists them all"))
    return rows


def _content_rows(info: MeshFileInfo) -> Rows:
    """What the file says besides its surface: materials, images, UV sets, unit and up axis."""
    contents = info.contents
    if contents is None:
        return []
    unit = contents.meters_per_unit
    rows = [
        ("UV sets", ", ".join(contents.uv_sets) or "none"),
        ("unit", "not in the file" if unit is None else f"{unit:g} m"),
        ("up axis", contents.up or "not in the file"),
    ]
    materials = [
        (f"material {material.name}", _channels(material.channels))
        for material in contents.materials
    ]
    images = [(f"image {name}", _image(shape)) for name, shape in info.image_shapes.items()]
    if contents.passed_over:
        rows.append(("also in file", ", ".join(contents.passed_over)))
    for listed, what in ((materials, "materials"), (images, "images")):
        rows += listed[:_GROUPS_SHOWN]
        if len(listed) > _GROUPS_SHOWN:
            rows.append((f"more {what}", f"{len(listed) - _GROUPS_SHOWN:,}; --json lists them all"))
    return rows


def _channels(channels: Mapping[str, str | None]) -> str:
    return (
        ", ".join(
            channel if image is None else f"{channel} ({image})"
            for channel, image in channels.items()
        )
        or "no channels"
    )


def _image(shape: tuple[int, int, int] | None) -> str:
    if shape is None:
        return "missing or not readable"
    width, height, n_channels = shape
    return f"{width} x {height}, {counted(n_channels, 'channel')}"


def _point(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.6g}' for value in values)})"


def _uvs(found: MeshInfo) -> str:
    if found.uvs is None:
        return "none"
    low, high = found.uvs.bounds
    parts = [f"{found.uvs.n_uvs:,}, {_point(low)} to {_point(high)}"]
    for count, what in (
        (found.uvs.n_out_of_tile, "outside the unit square"),
        (found.uvs.n_without_area, "without area"),
        (found.uvs.n_mirrored, "mirrored"),
    ):
        if count:
            parts.append(f"{counted(count, 'face')} {what}")
    return "; ".join(parts)


def _worst_tables(distortion: Distortion) -> list[Table]:
    """Return tables of the charts, then of the faces, with the greatest stretch."""
    charts = sorted(distortion.charts, key=lambda chart: -chart.stretch.l2)[:_CHARTS_SHOWN]
    of = f" of {distortion.n_charts:,}" if distortion.n_charts > len(charts) else ""
    surface = sum(chart.area for chart in distortion.charts)
    heads = ("chart", "L2", "L2 alone", "L∞", "Dirichlet", "faces", "mirrored", "surface", "texels")
    of_charts: Table = [
        (
            f"{chart.chart}",
            f"{chart.stretch.l2:.4f}",
            f"{chart.l2_alone:.4f}",
            f"{chart.stretch.linf:.4f}",
            f"{chart.stretch.symmetric_dirichlet:.4f}",
            f"{chart.n_faces:,}",
            f"{chart.n_mirrored:,}",
            f"{100.0 * chart.area / surface:.2f} %",
            f"{chart.texel_density:.5g}",
        )
        for chart in charts
    ]
    of_faces: Table = [
        (
            f"{face.face}",
            f"{face.chart}",
            f"{face.l2:.4f}",
            f"{face.linf:.4f}",
            "mirrored" if face.mirrored else "",
        )
        for face in distortion.worst_faces
    ]
    return [
        [(f"Charts of greatest stretch{of}", "")],
        [heads, *of_charts],
        [("Faces of greatest stretch", "")],
        [("face", "chart", "L2", "L∞", ""), *of_faces],
    ]
