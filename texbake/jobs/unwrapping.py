"""Texture coordinates for mesh files, with pictures of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike, appearing_together, check_folder, make_folder
from texbake.jobs.outputs import (
    BARE_MESH_SUFFIXES,
    JobResult,
    check_distinct,
    check_mesh,
    check_picture,
    check_report,
    check_uv_set,
    given,
    write_report,
)
from texbake.jobs.written import SourceMaterials, write_with_materials
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.unwrap import UnwrapReport, unwrap_together
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink
from texbake.texture.image import write_image


@dataclass(frozen=True, kw_only=True, eq=False)
class UnwrapFiles(JobResult[tuple[UnwrapReport, ...]]):
    """What `unwrap_files` wrote; `report` has a report for each mesh."""

    def to_json(self) -> dict[str, Any]:
        """Return the report of the one mesh, or those of several as `meshes`."""
        reports = [report.to_json() for report in self.report]
        return reports[0] if len(reports) == 1 else {"meshes": reports}


@appearing_together()
def unwrap_files(
    meshes: PathLike | Sequence[PathLike],
    output: PathLike,
    options: UnwrapOptions | None = None,
    *,
    layout: PathLike | None = None,
    heat: bool = False,
    checker: PathLike | None = None,
    report: PathLike | None = None,
    mtl: bool = True,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> UnwrapFiles:
    """Give mesh files texture coordinates in one atlas, and write them.

    Parameters
    ----------
    meshes
        One mesh file, or several.
    output
        A file for one mesh, which may replace it; for several a folder, made if it is missing, in
        which they keep their names.
    options
        None for the defaults.
    layout, heat
        A PNG or SVG file for a picture of the charts; whether it is colored by their stretch.
    checker
        A picture file: the meshes under a numbered checker, from four sides.
    report
        File for the figures as JSON.
    mtl
        Whether an OBJ file gets a .mtl file with its materials beside it.
    threads, progress
        As for `unwrap`.

    Returns
    -------
    UnwrapFiles
        Materials without images are kept. A warning names what is lost: images do not fit the new
        texture coordinates.
    """
    if layout is not None or checker is not None:  # they import the renderer
        from texbake.jobs.uv_pictures import check_layout, render_checker, write_layout

    options = options or UnwrapOptions()
    paths = [Path(meshes)] if isinstance(meshes, str | os.PathLike) else list(map(Path, meshes))
    outputs = _unwrap_outputs(paths, Path(output))
    if heat and layout is None:
        raise OptionError("heat: it colors the layout; give a file for the layout as well")
    check_distinct([*outputs, layout, checker, report])
    check_distinct([layout, checker, report], paths)  # an output may replace its mesh
    check_picture(checker)
    if options.uv_set is not None:
        check_uv_set(outputs)
    check_report(report)
    if layout is not None:
        check_layout(layout)
    read = [read_mesh(path, progress=progress) for path in paths]
    results = unwrap_together(read, options, threads=threads, progress=progress)
    if len(paths) > 1:
        make_folder(output)
    written = [
        _written(source, high, mesh, path, mtl=mtl, is_further=options.uv_set is not None)
        for source, high, (mesh, _), path in zip(paths, read, results, outputs, strict=True)
    ]
    unwrapped = [mesh.on_uv_set(options.uv_set) for mesh, _ in results]
    if layout is not None:
        write_layout(join_meshes(unwrapped), layout, options.size, heat=heat, threads=threads)
    if checker is not None:
        picture = render_checker(join_meshes(unwrapped), threads=threads)
        write_image(picture, checker, color=True)
    reports = tuple(figures for _, figures in results)
    done = UnwrapFiles(
        files=(*(file for files, _ in written for file in files), *given(layout, checker, report)),
        report=reports,
        warnings=(
            *(f"{made.mesh}: {note}" for made in reports for note in made.notes),
            *(line for _, lines in written for line in lines),
        ),
    )
    if report is not None:
        write_report(report, done.to_json())
    return done


def _written(
    source: Path, read: Mesh, mesh: Mesh, output: Path, *, mtl: bool, is_further: bool
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write a mesh with new texture coordinates and its materials.

    These lose their images, unless the coordinates are a further set.
    """
    found = SourceMaterials.read(source, read)
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


def _unwrap_outputs(meshes: Sequence[Path], output: Path) -> list[Path]:
    """Return a file for each mesh; raise if one could not be written."""
    if len(meshes) == 1:
        _check_format(output)
        check_mesh(output)
        return [output]
    check_folder(output)
    files = [output / path.name for path in meshes]
    check_distinct(files)
    for file in files:
        _check_format(file)
        check_mesh(file, folder_is_made=True)
    return files


def _check_format(path: Path) -> None:
    """Raise if a format holds no texture coordinates."""
    if path.suffix.lower() in BARE_MESH_SUFFIXES:
        raise FileFormatError(
            f"{path}: {path.suffix} files hold no texture coordinates; write .obj, .ply or .glb"
        )
