"""`convert`: change the format of a mesh file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.files import PathLike
from texbake.mesh.options import TransformOptions
from texbake.verbs.transform import size_table, transform_file
from texbake.verbs.verb import Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult
    from texbake.mesh.mesh import Mesh
    from texbake.progress import ProgressSink


@verb(
    Reads("mesh", metavar="SOURCE"),
    Writes("output", "mesh", "The file to write; its suffix sets the format.", over="mesh"),
    Options(TransformOptions, "scale", "units", "up", "subdivide", "normals", "angle"),
    examples="""
      texbake convert statue.fbx statue.glb
      texbake convert part.stl -o part.obj --units mm --up z
    """,
    table=size_table,
)
def convert_file(
    mesh: PathLike, output: PathLike, options: TransformOptions, *, progress: ProgressSink | None
) -> JobResult[Mesh]:
    """Write the mesh in SOURCE in the format of OUTPUT.

    Keeps texture coordinates, normals, groups and vertex colors where the format has them. A GLB
    file keeps the materials of a glTF, OBJ, FBX or USD file with their images. An OBJ file keeps
    those channels that .mtl files have; that file and the images stand beside it. A warning names
    what is lost.
    """
    return transform_file(mesh, output, options, progress=progress)
