"""Further sets of texture coordinates of an OBJ file, in a file beside it.

The format has one set. The others of `rock.obj` are in `rock.uvs.npz`, a NumPy archive of plain
arrays: `names`, and for the set of number i `uvs_i` (T, 2) float64 and `faces_i` (F, 3) int32.
`of_faces` is a checksum of the faces that they belong to. Other programs leave the file as it is,
so that it no longer fits once one of them has changed the faces.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.arrays import DAMAGE, read_arrays, write_arrays
from texbake.errors import FileFormatError, one_line
from texbake.files import PathLike, is_file, remove_file
from texbake.mesh.mesh import IntArray, Mesh, UvSet
from texbake.mesh.polygons import Outlines, triangulated


def uv_sets_path(path: PathLike) -> Path:
    """Return the path of the file with the further sets of an OBJ file."""
    return Path(path).with_suffix(".uvs.npz")


def write_uv_sets(mesh: Mesh, path: PathLike, polygons: Outlines) -> None:
    """Write the further sets of a mesh beside its OBJ file; without any, remove that of before.

    Corners are listed as they will be when the polygons of the file have become triangles again.
    """
    beside = uv_sets_path(path)
    if not mesh.uv_sets:
        if is_file(beside):  # False if the name is too long for a file
            remove_file(beside)
        return
    vertices = mesh.faces.ravel()[polygons.slots]
    corners = triangulated(path, mesh.positions, vertices, polygons.sizes)[0]
    slots = polygons.slots[corners]
    arrays: dict[str, npt.NDArray[np.generic]] = {"of_faces": _checksum(mesh.faces.ravel()[slots])}
    arrays["names"] = np.array(list(mesh.uv_sets), dtype=np.str_)
    for i, item in enumerate(mesh.uv_sets.values()):
        arrays |= {f"uvs_{i}": item.uvs, f"faces_{i}": item.faces.ravel()[slots]}
    write_arrays(beside, arrays)


def read_uv_sets(path: PathLike, faces: IntArray) -> dict[str, UvSet]:
    """Read the further sets of an OBJ file with these faces; none where there is no such file."""
    beside = uv_sets_path(path)
    if not is_file(beside):
        return {}
    try:
        arrays = read_arrays(beside)
        fits = np.array_equal(arrays["of_faces"], _checksum(faces))
        sets = {
            str(name): UvSet(arrays[f"uvs_{i}"], arrays[f"faces_{i}"])
            for i, name in enumerate(arrays["names"])
        }
    except (OSError, *DAMAGE) as error:
        raise FileFormatError(
            f"{beside}: it is not a file of UV sets: {one_line(error, 120)}"
        ) from error
    if not fits:
        raise FileFormatError(
            f"{beside}: it belongs to other faces than those of {path}; delete it, and make the "
            "sets again with: texbake unwrap --set"
        )
    return sets


def _checksum(faces: IntArray) -> npt.NDArray[np.uint8]:
    return np.frombuffer(hashlib.sha256(faces.tobytes()).digest(), np.uint8)


def uv_set_names_beside(path: PathLike) -> tuple[str, ...]:
    """Return the names of the further sets of an OBJ file; none where the file is damaged."""
    try:
        return tuple(str(name) for name in read_arrays(uv_sets_path(path))["names"])
    except (OSError, *DAMAGE):
        return ()
