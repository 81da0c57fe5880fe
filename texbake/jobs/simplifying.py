"""Mesh files with fewer triangles: one, or several levels of detail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from texbake.files import PathLike, appearing_together
from texbake.jobs.outputs import (
    JobResult,
    check_distinct,
    check_mesh,
    check_report,
    write_report,
)
from texbake.jobs.written import MaterialBorders, SourceMaterials, write_with_materials
from texbake.mesh.files import read_mesh
from texbake.mesh.files.source import parsed_once
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.objects import joined_objects
from texbake.mesh.options import DEFAULT_ANGLE, DEFAULT_ORIENTATION
from texbake.mesh.simplify import SimplifyReport, check_count, simplify_with_report
from texbake.mesh.simplify_options import (
    DEFAULT_QUALITY,
    DEFAULT_SEAMS,
    DEFAULT_TOPOLOGY,
    check_target,
)
from texbake.mesh.wrapping import wrapped
from texbake.progress import ProgressSink

_CLOSED = "the result was made from a closed surface around the mesh, with few tunnels"
_MORE = "request more, or use `topology` simplify, which closes holes and tunnels"


@appearing_together()
def simplify_file(
    mesh: PathLike,
    output: PathLike,
    n_faces: int | None = None,
    *,
    error: str | float | None = None,
    quality: str = DEFAULT_QUALITY,
    seams: str = DEFAULT_SEAMS,
    topology: str = DEFAULT_TOPOLOGY,
    orientation: str = DEFAULT_ORIENTATION,
    join_objects: bool = False,
    normals: str = "keep",
    angle: float = DEFAULT_ANGLE,
    report: PathLike | None = None,
    mtl: bool = True,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[SimplifyReport]:
    """Reduce the triangles of a mesh file, and write the result.

    Parameters
    ----------
    mesh
    output
        The low-poly mesh; it may replace `mesh`.
    n_faces, error, quality, seams, threads, progress
        As for `simplify`.
    topology : {"keep", "simplify"}
        Where the mesh needs more triangles for its holes, tunnels and parts, an error, or the
        result is made from a closed surface around the mesh, without texture coordinates.
    orientation
        `auto` flips parts of the mesh that face inwards; `keep` leaves all as they are.
    join_objects
        Whether objects that touch become one surface.
    normals, angle
        As for `with_normals`; normals that are kept are those that `simplify` leaves.
    report
        File for the figures as JSON.
    mtl
        Whether an OBJ file gets a .mtl file with its materials, and their images, beside it.

    Returns
    -------
    JobResult of SimplifyReport
        A warning names what the output cannot hold of the materials of `mesh`.
    """
    check_distinct([output, report])
    check_distinct([report], [mesh])  # the output may replace the mesh
    check_report(report)
    (done,) = simplify_levels(
        mesh,
        [(n_faces, output)],
        error=error,
        quality=quality,
        seams=seams,
        topology=topology,
        orientation=orientation,
        join_objects=join_objects,
        normals=normals,
        angle=angle,
        mtl=mtl,
        threads=threads,
        progress=progress,
    )
    if report is None:
        return done
    write_report(report, done.report.to_json())
    return replace(done, files=(*done.files, Path(report)))


@appearing_together()
def simplify_levels(
    mesh: PathLike,
    levels: Sequence[tuple[int | None, PathLike]],
    *,
    error: str | float | None = None,
    quality: str = DEFAULT_QUALITY,
    seams: str = DEFAULT_SEAMS,
    topology: str = DEFAULT_TOPOLOGY,
    orientation: str = DEFAULT_ORIENTATION,
    join_objects: bool = False,
    normals: str = "keep",
    angle: float = DEFAULT_ANGLE,
    mtl: bool = True,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> list[JobResult[SimplifyReport]]:
    """Write several levels of detail of a mesh file.

    Levels of an unwrapped mesh share its texture coordinates, so that the maps baked for it fit
    all of them; `seams="keep"` lets no level lose them.

    Parameters
    ----------
    mesh
    levels
        Number of triangles and file of each level; without a number, as few as `error` allows.
    error, quality, seams, topology, orientation, join_objects, normals, angle, mtl
        As for `simplify_file`.
    threads, progress
        As for `simplify_file`.
    """
    from texbake.raycast.orientation import oriented

    for n_faces, output in levels:
        check_target(n_faces, error)
        check_mesh(output)
    with parsed_once():
        read = read_mesh(mesh, progress=progress)
        materials = SourceMaterials.read(mesh, read)
    if join_objects:
        read = joined_objects(read)
    high, turned = oriented(read, orientation, threads=threads)
    done = []
    for n_faces, output in levels:
        # Each from the mesh itself: the errors of levels made from one another add up.
        bordered = None
        if materials.fit(output, mtl=mtl):
            bordered = MaterialBorders.of(high, materials)
        low, figures = simplify_with_report(
            high if bordered is None else bordered.mesh,
            n_faces,
            error=error,
            quality=quality,
            seams=seams,
            threads=threads,
            progress=progress,
        )
        if error is None and seams != "keep":
            if topology == "simplify" and n_faces is not None and not figures.is_whole:
                wrap, _ = wrapped(high, n_faces, has_tunnels=True, threads=threads)
                low, figures = simplify_with_report(
                    wrap, n_faces, quality="best", threads=threads, progress=progress
                )
                figures, bordered = replace(figures, notes=(_CLOSED, *figures.notes)), None
            check_count(figures, high.name, _MORE)
        of_low = materials
        if bordered is not None:
            low, of_low = bordered.taken_from(low, high)
        low = with_normals(low, normals, angle=angle)
        files, warnings = write_with_materials(low, output, of_low, mtl=mtl)
        figures = replace(figures, notes=(*turned.notes, *figures.notes))
        done.append(JobResult(files=files, report=figures, warnings=(*figures.notes, *warnings)))
    return done
