"""`unwrap`: create texture coordinates for a mesh."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import PROCESS
from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike, make_folder
from texbake.jobs.outputs import BARE_MESH_SUFFIXES, JobResult, check_uv_set, present_paths
from texbake.mapping.options import UnwrapOptions
from texbake.records import dataclass
from texbake.schema import option_of
from texbake.verbs.step import FORMAT_OF_MESH, n_faces, stage_seconds, step_of
from texbake.verbs.verb import (
    REPORT,
    THREADS,
    Extra,
    Options,
    Reads,
    Rows,
    Writes,
    outputs_like,
    paths_of,
    verb,
)

if TYPE_CHECKING:
    from texbake.mapping.unwrap import UnwrapReport
    from texbake.mesh.mesh import Mesh
    from texbake.progress import Progress

# Headings of the help, with the options below them.
SECTIONS = {
    "Method": ("method", "size", "only", "uv_set"),
    "Atlas": (
        *("padding", "quality", "max_stretch", "seams", "protect", "importance"),
        *("keep_seams", "seams_at_hard_edges", "seam_angle", "hide_seams", "symmetry"),
        *("straighten", "tiles", "by_group", "keep", "charts", "timeout"),
    ),
    "Classical mappings": (
        *("axis", "center", "normal", "fit", "sides", "theta", "height", "caps", "overlap"),
        *("surface", "via", "eye", "camera", "fov", "matrix", "unseen", "linear"),
    ),
    "Normals": ("normals", "angle"),
    "Afterwards, in this order": ("warp", "flip", "rotate", "scale", "texel_density", "offset"),
}
_NAMES = tuple(name for names in SECTIONS.values() for name in names)
_SEAMS, _MATRIX = _NAMES.index("seams"), _NAMES.index("matrix")


@dataclass(frozen=True, kw_only=True, eq=False)
class UnwrapFiles(JobResult[tuple["UnwrapReport", ...]]):
    """What `unwrap_files` wrote; `report` has a report for each mesh."""

    def to_json(self) -> dict[str, Any]:
        """Return the report of the one mesh, or those of several as `meshes`."""
        reports = [report.to_json() for report in self.report]
        return reports[0] if len(reports) == 1 else {"meshes": reports}


def _table(result: JobResult[tuple[UnwrapReport, ...]]) -> Rows:
    return _rows(result.report)


def _rows(reports: Sequence[UnwrapReport]) -> Rows:
    rows: Rows = []
    for report in reports:
        if len(reports) > 1:
            rows.append((report.mesh, ""))
        rows.append(("faces", f"{report.n_faces:,}"))
        if report.distortion is None:
            rows.append(("stretch", "none to measure: no face has an area in the texture"))
        else:
            rows += report.distortion.table()
        rows += [(name, f"{count:,}") for name, count in report.tallies.items()]
    return rows


def _with_matrix(values: dict[str, Any]) -> dict[str, Any]:
    from texbake.mapping.classical.projector import read_matrix

    matrix = values["matrix"]
    return {**values, "matrix": None if matrix is None else read_matrix(matrix)}


@verb(
    Reads("meshes", many=True, role="mesh", metavar="MESH... [OUTPUT]"),
    Writes(
        "output",
        "mesh",
        "The mesh with texture coordinates, or a folder for several meshes.",
        over="meshes",
        like="meshes",
    ),
    Options(UnwrapOptions, *_NAMES[:_SEAMS]),
    Reads(
        "seams", "seams",
        "Cut charts along the lines of this OBJ file, whose points are vertices of MESH, and "
        "nowhere else.",
        required=False, role=None, suffixes=(".obj",), metavar="FILE",
    ),
    Reads(
        "protect", "mesh",
        "Cut no seam through these faces of MESH: a mesh of them alone, or an image over the "
        "present texture coordinates that is white on them.",
        required=False, role=None, metavar="FILE",
    ),
    Reads(
        "importance", "image",
        "Give charts up to four times as many texels per unit of length where this image, over the "
        "present texture coordinates, is white; the word `colors` means the vertex colors.",
        required=False, role=None, metavar="IMAGE|colors",
    ),
    Options(UnwrapOptions, *_NAMES[_SEAMS + 3 : _MATRIX]),
    Reads(
        "matrix", "matrix", option_of(UnwrapOptions, "matrix").help, required=False, role=None,
        suffixes=(".txt",), metavar="FILE",
    ),
    Options(UnwrapOptions, *_NAMES[_MATRIX + 1 :]),
    Writes("layout", "drawing", "Also draw the charts, as PNG or SVG."),
    Extra("--heat", "Color the layout by stretch.", is_flag=True),
    Writes("checker", "picture", "Also draw the mesh with a checker texture."),
    Writes("html", "page", "Also write an HTML page with the layout beside the mesh in 3D."),
    REPORT,
    THREADS,
    sections=SECTIONS,
    common=("method", "size", "padding", "quality", "seams_at_hard_edges", "normals"),
    examples="""
      texbake unwrap low.obj -o low_uv.obj --size 2048 --padding 8
      texbake unwrap low.obj -o low_uv.glb --quality best --layout layout.png --heat
      texbake unwrap body.obj wheels.obj -o car --tiles 2 --texel-density 512
      texbake unwrap bottle.obj -o bottle_uv.obj --method cylindrical --caps --checker look.png
      texbake unwrap bunny.obj -o b.obj --method two-part --surface sphere --via object-normal
    """,
    table=_table,
    prepare=_with_matrix,
)  # fmt: skip
def unwrap_files(
    meshes: PathLike | Sequence[PathLike],
    output: PathLike,
    options: UnwrapOptions | None = None,
    *,
    seams: PathLike | None = None,
    protect: PathLike | None = None,
    importance: PathLike | None = None,
    layout: PathLike | None = None,
    heat: bool = False,
    checker: PathLike | None = None,
    html: PathLike | None = None,
    report: PathLike | None = None,
    mtl: bool = True,
    threads: int | None = None,
    progress: Progress = None,
) -> UnwrapFiles:
    """Give MESH texture coordinates.

    In an atlas, no two faces overlap and none is mirrored. Positions and the order of faces stay as
    they are. Several meshes share one atlas.
    """
    from texbake.jobs.painted_faces import importance_at, protected_at
    from texbake.mapping.marked_seams import read_seams
    from texbake.mapping.unwrap import unwrap_together
    from texbake.mesh.files import read_mesh

    options = options or UnwrapOptions()
    sources, outputs = paths_of(meshes), outputs_like(meshes, output)
    for path in outputs:
        if path.suffix.lower() in BARE_MESH_SUFFIXES:
            raise FileFormatError(
                f"{path}: {path.suffix} files hold no texture coordinates; write .obj, .ply or .glb"
            )
    if heat and layout is None:
        raise OptionError("heat: it colors the layout; give a file for the layout as well")
    if options.uv_set is not None:
        check_uv_set(outputs)
    read = [read_mesh(path, progress=progress) for path in sources]
    marked = None if seams is None else [read_seams(seams, mesh) for mesh in read]
    kept = None if protect is None else protected_at(protect, read)
    results = unwrap_together(
        read,
        options,
        seams=marked,
        protect=kept,
        importance=None if importance is None else importance_at(importance, read),
        threads=threads,
        progress=progress,
    )
    if len(sources) > 1:
        make_folder(output)
    is_further = options.uv_set is not None
    written = [
        _written(source, high, mesh, path, mtl=mtl, is_further=is_further)
        for source, high, (mesh, _), path in zip(sources, read, results, outputs, strict=True)
    ]
    layout_of = [mesh.on_uv_set(options.uv_set) for mesh, _ in results]
    reports = tuple(figures for _, figures in results)
    shares = options.symmetry == "overlap"
    _draw(layout_of, layout, options.size, checker, heat=heat, shares=shares, threads=threads)
    if html is not None:
        from texbake.mesh.compose import join_meshes
        from texbake.pages.layout_page import write_layout_page

        write_layout_page(
            html, join_meshes(layout_of), options.size, figures=_rows(reports), shares=shares
        )
    notes = [f"{made.mesh}: {note}" for made in reports for note in made.notes]
    return UnwrapFiles(
        files=(
            *(file for files, _ in written for file in files),
            *present_paths(layout, checker, html),
        ),
        report=reports,
        warnings=(*notes, *(line for _, lines in written for line in lines)),
    )


def _draw(
    meshes: Sequence[Mesh],
    layout: PathLike | None,
    size: int | tuple[int, int],
    checker: PathLike | None,
    *,
    heat: bool,
    shares: bool,
    threads: int | None,
) -> None:
    """Draw the charts and the checker, where they are asked for; both import the renderer."""
    if layout is None and checker is None:
        return
    from texbake.jobs.side_pictures import render_checker, write_layout
    from texbake.mapping.corner_uvs import selected
    from texbake.mapping.overlap import StackedIslands
    from texbake.mesh.compose import join_meshes
    from texbake.texture.image import write_image

    mesh = join_meshes(meshes)
    if checker is not None:
        write_image(render_checker(mesh, threads=threads), checker, color=True)
    if layout is not None:
        if shares:  # draw one of the two halves, which is not mirrored
            mesh = selected(mesh, ~StackedIslands.of(mesh).mirrored(mesh))
        write_layout(mesh, layout, size, heat=heat, threads=threads)


def _written(
    source: Path, read: Mesh, mesh: Mesh, output: Path, *, mtl: bool, is_further: bool
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write a mesh with new uvs and its materials, without images unless `is_further`."""
    from texbake.jobs.mesh_output import MeshFileMaterials, write_with_materials

    found = MeshFileMaterials.read(source, read)
    if is_further or found.materials is None or not found.materials.has_images:
        return write_with_materials(mesh, output, found, mtl=mtl)
    # A .mtl file that names images is not written over by one without them.
    is_over = os.path.realpath(output.with_suffix("")) == os.path.realpath(source.with_suffix(""))
    files, lines = write_with_materials(
        mesh, output, found.without_images(), mtl=mtl and not is_over
    )
    line = (
        f"{output}: written without the images of {source}, which do not fit its new texture "
        f"coordinates; to bake them onto new ones: texbake lighten {source} -o OUT.glb"
    )
    return files, (*lines, line)


@dataclass(frozen=True, kw_only=True)
class UnwrapStep(UnwrapOptions):
    """How a mesh is unwrapped; further options are those of `UnwrapOptions`."""

    format: Annotated[str, FORMAT_OF_MESH] = "obj"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.uv_set is not None and self.format != "glb":
            raise OptionError("uv_set: a product has no file beside it; set format = 'glb'")


def _figures(result: JobResult[tuple[UnwrapReport, ...]]) -> dict[str, Any]:
    (report,) = result.report
    measured = report.distortion
    return {
        "faces": report.n_faces,
        "charts": report.n_charts,
        "fill": report.fill,
        "stretch_l2": None if measured is None else measured.turned_stretch.l2,
        "notes": list(report.notes),
        "stages": stage_seconds(report.stages),
    }


STEP = step_of(
    unwrap_files,
    does="gives a mesh texture coordinates",
    options=UnwrapStep,
    inputs=(Reads("mesh"),),
    without=("matrix",),
    outputs=lambda settings: {"mesh": f"unwrapped.{settings['format']}"},
    memory=lambda settings, sizes: PROCESS + 6_000 * n_faces(sizes, "mesh"),
    figures=_figures,
    revision=4,
)
