"""Mesh files: `read_mesh` and `write_mesh` choose the format by the suffix of the file name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from texbake.errors import FileFormatError, MeshError, OptionError, quoted
from texbake.files import PathLike
from texbake.progress import Progress, Stages

if TYPE_CHECKING:
    from texbake.mesh.interchange import MeshLike
    from texbake.mesh.mesh import Mesh


class _Format(NamedTuple):
    """Module and name of a format's reader and writer, and the options of the writer."""

    reader: tuple[str, str]
    writer: tuple[str, str] | None = None
    options: tuple[str, ...] = ()


_MATERIAL = ("normal_map", "base_color", "orm", "emissive", "name")
_USD = _Format(("usd", "read_usd"), ("usd_write", "write_usd"), (*_MATERIAL, "materialx"))
_THROUGH_TRIMESH = _Format(("trimesh_read", "read_with_trimesh"))
_FORMATS = {
    ".obj": _Format(("obj", "read_obj"), ("obj_write", "write_obj")),
    ".ply": _Format(("ply", "read_ply"), ("ply", "write_ply")),
    ".stl": _Format(("stl", "read_stl"), ("stl", "write_stl")),
    ".off": _Format(("off", "read_off"), ("off", "write_off")),
    ".glb": _Format(
        ("gltf", "read_gltf"),
        ("gltf_write", "write_glb"),
        (*_MATERIAL, "materials", "levels", "coverages", "compress", "quantize", "rig"),
    ),
    ".gltf": _Format(("gltf", "read_gltf")),
    ".fbx": _Format(("fbx", "read_fbx")),
    ".usd": _USD,
    ".usda": _USD,
    ".usdc": _USD,
    ".usdz": _USD,
    ".dae": _THROUGH_TRIMESH,
    ".zae": _THROUGH_TRIMESH,
    ".3mf": _THROUGH_TRIMESH,
    ".3dxml": _THROUGH_TRIMESH,
    ".xaml": _THROUGH_TRIMESH,
}
MESH_SUFFIXES = tuple(_FORMATS)
"""Suffixes of the files that `read_mesh` reads."""
WRITABLE_MESH_SUFFIXES = tuple(
    suffix for suffix, kind in _FORMATS.items() if kind.writer is not None
)
"""Suffixes of the files that `write_mesh` writes."""


def read_mesh(path: PathLike, *, progress: Progress = None) -> Mesh:
    """Read a mesh from an OBJ, PLY, STL, OFF, glTF, FBX, USD, COLLADA, 3MF, 3DXML or XAML file.

    Parameters
    ----------
    path
        The format follows from the suffix, in upper or lower case.
    progress
        True shows a bar; a listener is called with the one stage, ``read NAME``.

    Returns
    -------
    Mesh
        Its name is the file's, without the folder.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        The suffix is not known, or the file breaks the rules of its format.
    MeshError
        There are no faces, a coordinate of a face is not finite, or an index is out of range.
    DependencyError
        The format needs an optional package that is not installed: USD needs ``texbake[usd]``.
    """
    from texbake.files import require_file

    require_file(path)
    name = Path(path).name
    read = _function(_format_of(path).reader)
    with Stages(progress).stage(f"read {name}"):
        try:
            mesh: Mesh = read(path)
        except MeshError as error:
            # The message of a mesh begins with its name; the user knows the file by its path.
            message = str(error)
            if message.startswith(f"{name}: "):
                message = f"{path}{message[len(name) :]}"
            raise type(error)(message) from error
    return mesh


def write_mesh(mesh: MeshLike, path: PathLike, **options: Any) -> None:
    """Write a mesh to an OBJ, PLY, STL, OFF, GLB or USD file, whole or not at all.

    Parameters
    ----------
    path
        The format follows from the suffix, in upper or lower case. OBJ and PLY keep positions,
        faces, texture coordinates and normals bit for bit; see each format's writer for what it
        keeps.
    **options
        For GLB and USD: `normal_map`, `base_color`, `orm` and `emissive`, the images of the
        material, and its `name`. For GLB also `materials`, `levels`, `coverages`, `compress`,
        `quantize` and `rig`; see `texbake.mesh.files.gltf_write.write_glb`. An option that is None
        counts as not given.

    Raises
    ------
    OptionError
        The format does not have one of the options.
    FileFormatError
        The suffix is not known, or the format can only be read.
    FileError
        The file cannot be written; one that stood there is left as it was.
    """
    suffix = Path(path).suffix.lower()
    kind = _format_of(path)
    if kind.writer is None:
        raise FileFormatError(f"{path}: {suffix} files can only be read; write a .glb file")
    write_options = {option: value for option, value in options.items() if value is not None}
    for option in write_options:
        if option not in kind.options:
            raise OptionError(f"{path}: a {suffix} file has no {option}; write a .glb file")
    as_mesh = import_module("texbake.mesh.interchange").as_mesh  # itself reads files
    _function(kind.writer)(as_mesh(mesh), path, **write_options)


def _format_of(path: PathLike) -> _Format:
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise FileFormatError(
            f"{path}: {quoted(suffix)} is not the suffix of a mesh file; give one of "
            f"{', '.join(MESH_SUFFIXES)}"
        )
    return _FORMATS[suffix]


def _function(place: tuple[str, str]) -> Callable[..., Any]:
    module, name = place
    function: Callable[..., Any] = getattr(import_module(f"{__name__}.{module}"), name)
    return function
