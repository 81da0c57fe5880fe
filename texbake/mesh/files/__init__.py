"""Mesh files, one module a format, chosen by the suffix of the name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from texbake.errors import FileFormatError, MeshError, OptionError
from texbake.files import PathLike
from texbake.mesh.files.source import require_file
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages


class _Format(NamedTuple):
    """Module and name of a format's two functions, which are loaded when they are first used.

    `options` are the keywords of the writer.
    """

    reader: tuple[str, str]
    writer: tuple[str, str] | None
    options: tuple[str, ...] = ()


_MATERIAL = ("normal_map", "base_color", "orm", "emissive", "name")
_USD = _Format(("usd", "read_usd"), ("usd_write", "write_usd"), _MATERIAL)
_FORMATS = {
    ".obj": _Format(("obj", "read_obj"), ("obj_write", "write_obj")),
    ".ply": _Format(("ply", "read_ply"), ("ply_write", "write_ply")),
    ".stl": _Format(("stl", "read_stl"), ("stl", "write_stl")),
    ".off": _Format(("off", "read_off"), ("off", "write_off")),
    ".glb": _Format(
        ("gltf", "read_gltf"),
        ("gltf_write", "write_glb"),
        (*_MATERIAL, "levels", "coverages", "compress"),
    ),
    ".gltf": _Format(("gltf", "read_gltf"), None),
    ".usd": _USD,
    ".usda": _USD,
    ".usdc": _USD,
    ".usdz": _USD,
}


def read_mesh(path: PathLike, *, progress: ProgressSink | None = None) -> Mesh:
    """Read a mesh from an OBJ, PLY, STL, OFF, GLB, glTF or USD file.

    Parameters
    ----------
    path
        The suffix, in upper or lower case, tells the format.
    progress
        Told of the one stage, ``read NAME``.

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
        There are no faces, a coordinate is not finite, or an index is out of range.
    DependencyError
        It is a USD file, and usd-core is not installed.
    """
    require_file(path)
    name = Path(path).name
    read = _function(_format_of(path).reader)
    with Stages(progress).stage(f"read {name}"):
        try:
            mesh: Mesh = read(path)
        except MeshError as error:
            # A mesh calls itself by its name; the user knows the file by its path.
            message = str(error)
            if message.startswith(f"{name}: "):
                message = f"{path}{message[len(name) :]}"
            raise type(error)(message) from error
    return mesh


def write_mesh(mesh: Mesh, path: PathLike, **options: Any) -> None:
    """Write a mesh to an OBJ, PLY, STL, OFF, GLB or USD file, whole or not at all.

    Parameters
    ----------
    path
        The suffix, in upper or lower case, tells the format. OBJ and PLY keep positions, faces,
        texture coordinates and normals bit for bit; see each format's writer for what it keeps.
    **options
        Of GLB and USD: `normal_map`, `base_color`, `orm` and `emissive`, the images of the
        material, and its `name`. Of GLB: `levels`, `coverages` and `compress`; see
        `texbake.mesh.files.gltf_write.write_glb`. None is as if it were not given.

    Raises
    ------
    OptionError
        An option is given that the format does not have.
    FileFormatError
        The suffix is not known, or the format can only be read.
    FileError
        The file cannot be written; one that stood there is left as it was.
    """
    suffix = Path(path).suffix.lower()
    kind = _format_of(path)
    if kind.writer is None:
        raise FileFormatError(f"{path}: {suffix} files are only read; write a .glb file")
    given = {option: value for option, value in options.items() if value is not None}
    for option in given:
        if option not in kind.options:
            raise OptionError(f"{path}: a {suffix} file has no {option}; write a .glb file")
    _function(kind.writer)(mesh, path, **given)


def _format_of(path: PathLike) -> _Format:
    suffix = Path(path).suffix.lower()
    if suffix == ".fbx":
        raise FileFormatError(
            f"{path}: FBX is not read; export a .glb file, as docs/export.md tells for Blender"
        )
    if suffix not in _FORMATS:
        known = ", ".join(_FORMATS)
        raise FileFormatError(
            f"{path}: {suffix!r} is no suffix of a mesh file; the known ones are {known}"
        )
    return _FORMATS[suffix]


def _function(place: tuple[str, str]) -> Callable[..., Any]:
    module, name = place
    function: Callable[..., Any] = getattr(import_module(f"{__name__}.{module}"), name)
    return function
