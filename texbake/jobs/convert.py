"""Mesh files written again: in another format, moved or repaired, with their materials.

GLB files keep materials whole, OBJ files what .mtl files have of them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from texbake.errors import TexbakeError
from texbake.files import PathLike
from texbake.jobs.outputs import BARE_MESH_SUFFIXES, JobResult, check_mesh, given
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.mtl_write import write_obj_materials
from texbake.mesh.files.passed_over import passed_over
from texbake.mesh.materials import Materials, read_materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.repair import RepairReport, repair
from texbake.mesh.repair_options import RepairOptions
from texbake.mesh.transform import transform
from texbake.mesh.transform_options import TransformOptions
from texbake.progress import ProgressSink
from texbake.texture.gltf_images import gltf_images
from texbake.texture.mtl_images import mtl_images


def repair_file(
    mesh: PathLike,
    output: PathLike,
    options: RepairOptions | None = None,
    *,
    mtl: bool = True,
    progress: ProgressSink | None = None,
) -> JobResult[RepairReport]:
    """Repair a mesh file without moving its surface, and write the result.

    Parameters
    ----------
    mesh
    output
        It may replace `mesh`.
    options
        Which repairs; None for all of them.
    mtl
        Whether an OBJ file gets a .mtl file with its materials, and their images, beside it.
    progress
        Receives the stages.

    Returns
    -------
    JobResult of RepairReport
        A warning names what the output cannot hold. Materials are lost if faces were removed.
    """
    check_mesh(output)
    read = read_mesh(mesh, progress=progress)
    repaired, report = repair(read, options)
    files, warnings = _written(mesh, read, repaired, output, mtl=mtl)
    return JobResult(files=files, report=report, warnings=warnings)


def transform_file(
    mesh: PathLike,
    output: PathLike,
    options: TransformOptions | None = None,
    *,
    mtl: bool = True,
    progress: ProgressSink | None = None,
) -> JobResult[Mesh]:
    """Scale, turn and move a mesh file, and write the result in the format of the output.

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
    read = read_mesh(mesh, progress=progress)
    moved = transform(read, options)
    files, warnings = _written(mesh, read, moved, output, mtl=mtl)
    return JobResult(files=files, report=moved, warnings=warnings)


_TITLES = {"uvs": "texture coordinates", "normals": "normals", "colors": "vertex colors"}


def _written(
    source: PathLike, read: Mesh, mesh: Mesh, output: PathLike, *, mtl: bool
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write a mesh with the materials of the file that it comes from; return files and warnings."""
    suffix = Path(output).suffix.lower()
    lost = []
    if suffix in BARE_MESH_SUFFIXES:
        lost = [title for name, title in _TITLES.items() if getattr(read, name) is not None]
    try:
        materials = read_materials(source, read)
    except TexbakeError:  # it is damaged
        materials = None
        lost.append("materials")
    files, notes = given(output), []
    if materials is None or not any(item.channels for item in materials.materials):
        if materials is not None and materials.missing:
            lost.append("materials")
        write_mesh(mesh, output)
    elif suffix not in ((".glb", ".obj") if mtl else (".glb",)) or mesh.n_faces != read.n_faces:
        lost.append("materials")
        write_mesh(mesh, output)
    elif suffix == ".glb":
        materials = gltf_images(_of_colors(mesh, _of_uvs(mesh, materials, lost), lost))
        notes += [line for _, line in materials.missing]
        write_mesh(mesh, output, materials=materials)
    else:
        notes += [line for _, line in materials.missing]
        materials, without = mtl_images(_of_uvs(mesh, materials, lost))
        lost += without
        files = write_obj_materials(mesh, output, materials)
    lost += passed_over(source)
    if lost:
        notes.append(f"{output}: written without {', '.join(lost)}")
    return files, tuple(notes)


def _of_uvs(mesh: Mesh, materials: Materials, lost: list[str]) -> Materials:
    """Materials without images, if a mesh has no texture coordinates."""
    if mesh.uvs is not None or not materials.has_images:
        return materials
    lost.append("images, for which there are no texture coordinates")
    return materials.without_images()


def _of_colors(mesh: Mesh, materials: Materials, lost: list[str]) -> Materials:
    """Materials that are multiplied by vertex colors, if they have no colors of their own."""
    if mesh.colors is None or materials.has_vertex_colors:
        return materials
    if not any(materials.sources("base-color")):
        return replace(materials, has_vertex_colors=True)
    lost.append("vertex colors")
    return materials
