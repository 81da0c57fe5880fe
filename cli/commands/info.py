"""`texbake info`: print the properties of a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from texbake import OptionError, UnwrapOptions
from texbake.errors import counted

from ..options import mesh_argument
from ..terminal import Terminal, say, table, terminal_options
from ..types import Size

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from texbake.jobs.meshes import MeshFileInfo
    from texbake.mapping.distortion import Distortion
    from texbake.mesh.info import MeshInfo

_GROUPS_SHOWN = 12
_CHARTS_SHOWN = 10


@click.command(
    epilog="""
    \b
    Example:
      texbake info scan.ply
      texbake info scan.ply --json
      texbake info low_uv.obj --uv --size 2048
    """
)
@mesh_argument("mesh")
@click.option("--uv", is_flag=True, help="Measure the texture coordinates as well.")
@click.option(
    "--size",
    type=Size(),
    help="Width and height in texels of the texture that --uv assumes.  [default: 1024]",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else.")
@terminal_options
def info(
    mesh: Path, uv: bool, size: int | tuple[int, int] | None, as_json: bool, terminal: Terminal
) -> None:
    """Print what is in MESH.

    Prints counts, bounds, texture coordinates, normals, components, boundary and non-manifold
    edges, and degenerate faces; of glTF, FBX, OBJ and USD files also materials, images, UV sets,
    the unit and the up axis. With --uv it also measures how the texture coordinates stretch,
    mirror, overlap and cut the mesh, and lists the charts and faces with the most stretch.
    """
    if size is not None and not uv:
        raise OptionError("size: it is for measuring texture coordinates; give --uv as well")
    options = UnwrapOptions() if size is None else UnwrapOptions(size=size)
    uv_size = options.size if uv else None
    from texbake.jobs.meshes import info_file

    with terminal.progress() as progress:
        found = info_file(mesh, uv_size=uv_size, progress=progress)
    if as_json:
        say(found.to_json())
        return
    table([*_rows(found.mesh), *_content_rows(found)])
    if found.distortion is not None:
        table([("Distortion", ""), *found.distortion.table()])
        table(_worst_rows(found.distortion))


def _rows(found: MeshInfo) -> list[tuple[str, str]]:
    low, high = found.bounds
    normals = "none" if found.n_normals is None else f"{found.n_normals:,}"
    genus = "" if found.genus is None else f", genus {found.genus:,}"
    extras = [
        name
        for name, there in (("tangents", found.has_tangents), ("colors", found.has_colors))
        if there
    ]
    rows = [
        ("name", found.name),
        ("faces", f"{found.n_faces:,}"),
        *([("triangles", f"{found.n_triangles:,}")] if found.n_triangles > found.n_faces else []),
        ("vertices", f"{found.n_vertices:,}"),
        ("bounds", f"{_point(low)} to {_point(high)}"),
        ("size", f"{_point([b - a for a, b in zip(low, high, strict=True)])}"),
        ("diagonal", f"{found.diagonal:.6g}"),
        ("area", f"{found.area:.6g}"),
        ("texture coordinates", _uvs(found)),
        ("normals", normals),
        ("tangents, colors", ", ".join(extras) or "none"),
        ("components", f"{found.n_components:,}"),
        ("closed", f"yes{genus}" if found.closed else f"no{genus}"),
        ("boundary edges", f"{found.n_boundary_edges:,}"),
        ("non-manifold edges", f"{found.n_non_manifold_edges:,}"),
        ("misoriented edges", f"{found.n_misoriented_edges:,}"),
        ("degenerate faces", f"{found.n_degenerate_faces:,}"),
        ("duplicate faces", f"{found.n_duplicate_faces:,}"),
        ("unused vertices", f"{found.n_unused_vertices:,}"),
        ("vertices at one place", f"{found.n_split_vertices:,}"),
    ]
    groups = [(f"group {group.name}", counted(group.n_faces, "face")) for group in found.groups]
    rows += groups[:_GROUPS_SHOWN]
    if len(groups) > _GROUPS_SHOWN:
        rows.append(("more groups", f"{len(groups) - _GROUPS_SHOWN:,}; --json lists them all"))
    return rows


def _content_rows(found: MeshFileInfo) -> list[tuple[str, str]]:
    """What the file says besides its surface: materials, images, UV sets, unit and up axis."""
    contents = found.contents
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
    images = [(f"image {name}", _image(shape)) for name, shape in found.image_shapes.items()]
    if contents.passed_over:
        rows.append(("not read", ", ".join(contents.passed_over)))
    for listed, what in ((materials, "materials"), (images, "images")):
        rows += listed[:_GROUPS_SHOWN]
        if len(listed) > _GROUPS_SHOWN:
            more = f"{len(listed) - _GROUPS_SHOWN:,}; --json lists them all"
            rows.append((f"more {what}", more))
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


def _worst_rows(found: Distortion) -> list[tuple[str, str]]:
    """Return rows of the charts, then of the faces, with the greatest stretch."""
    charts = sorted(found.charts, key=lambda chart: -chart.stretch.l2)[:_CHARTS_SHOWN]
    of = f" of {found.n_charts:,}" if found.n_charts > len(charts) else ""
    surface = sum(chart.area for chart in found.charts)
    rows = [(f"Charts of greatest stretch{of}", "")]
    rows += _columns(
        ("chart", "L2", "L2 alone", "L∞", "Dirichlet", "faces", "mirrored", "surface", "texels"),
        [
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
        ],
    )
    rows.append(("Faces of greatest stretch", ""))
    rows += _columns(
        ("face", "chart", "L2", "L∞", ""),
        [
            (
                f"{face.face}",
                f"{face.chart}",
                f"{face.l2:.4f}",
                f"{face.linf:.4f}",
                "mirrored" if face.mirrored else "",
            )
            for face in found.worst_faces
        ],
    )
    return rows


def _columns(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> list[tuple[str, str]]:
    """Return rows of aligned columns with headings; the first column is the label."""
    table = [heads, *lines]
    widths = [max(len(line[i]) for line in table) for i in range(len(heads))]
    return [
        (
            f"  {line[0]:>{widths[0]}}",
            "  ".join(
                f"{word:>{width}}" for word, width in zip(line[1:], widths[1:], strict=True)
            ).rstrip(),
        )
        for line in table
    ]
