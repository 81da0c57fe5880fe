"""Mesh files written again: in another format, moved, with their materials.

GLB files keep materials whole, OBJ files what .mtl files have of them.
"""

from __future__ import annotations

from texbake.files import PathLike, appearing_together
from texbake.jobs.outputs import JobResult, check_mesh
from texbake.jobs.written import MaterialBorders, SourceMaterials, write_with_materials
from texbake.mesh.files import read_mesh
from texbake.mesh.files.source import parsed_once
from texbake.mesh.mesh import Mesh
from texbake.mesh.options import TransformOptions
from texbake.mesh.transform import transform
from texbake.progress import ProgressSink


@appearing_together()
def transform_file(
    mesh: PathLike,
    output: PathLike,
    options: TransformOptions | None = None,
    *,
    mtl: bool = True,
    progress: ProgressSink | None = None,
) -> JobResult[Mesh]:
    """Scale, rotate and move a mesh file, and write the result in the format of the output.

    Parameters
    ----------
    mesh
    output
        It may replace `mesh`.
    options
        None leaves the mesh as it is, so that only the format changes.
    mtl
        Whether an OBJ file gets a .mtl file with its materials, and their images, beside it.
    progress
        Receives the stages.

    Returns
    -------
    JobResult of Mesh
        The report is the mesh that was written. A warning names what the output cannot hold.
    """
    check_mesh(output)
    with parsed_once():
        read = read_mesh(mesh, progress=progress)
        materials = SourceMaterials.read(mesh, read)
    if options is not None and options.subdivide:
        borders = MaterialBorders.of(read, materials)
        moved, materials = borders.taken_from(transform(borders.mesh, options), read)
    else:
        moved = transform(read, options)
    files, warnings = write_with_materials(moved, output, materials, mtl=mtl)
    return JobResult(files=files, report=moved, warnings=warnings)
