"""Formats that only trimesh reads: COLLADA (.dae, .zae), 3MF, 3DXML and XAML.

The meshes of the file are placed as its scene says and joined into one, a group for each node, in
the file's own axes and units. Vertices at one position, bit for bit, become one, because trimesh
splits them at every corner; texture coordinates and normals keep their own indices.
"""

from __future__ import annotations

import re
import threading
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, is_zipfile

import numpy as np

from texbake.errors import FileFormatError, MeshError, one_line, warn_of
from texbake.files import PathLike
from texbake.mesh.files.collada_instances import require_few_instances
from texbake.mesh.files.conversion import finite_rows, rows_not_finite, warn_unused
from texbake.mesh.files.source import damaged, read_array
from texbake.mesh.files.threemf_instances import require_few_objects
from texbake.mesh.interchange import from_trimesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows

# Bytes that the parts of an archive may have; trees of XML take 30 times as many in memory.
_LEAST_UNPACKED = 1 << 26
_MOST_TIMES = 20
_PIECE = 1 << 20  # bytes unpacked at once
_COLLADA = threading.Lock()
_NAN = re.compile(r"[-+]?\bnan\b", re.IGNORECASE)


def read_with_trimesh(path: PathLike) -> Mesh:
    """Read a .dae, .zae, .3mf, .3dxml or .xaml file, scenes as the module describes."""
    suffix = Path(path).suffix.lower()
    read_array(path)  # raises where it is missing or empty
    _require_small_archive(path)
    is_collada = suffix in (".dae", ".zae")
    if is_collada:
        require_few_instances(path)
    elif suffix == ".3mf":
        require_few_objects(path)
    with _warned_of_geometries(path) if is_collada else nullcontext():
        scene = _load(path, suffix)
    _replace_unknown(path, scene)
    return _welded(from_trimesh(scene, name=Path(path).name))


def _require_small_archive(path: PathLike) -> None:
    """Raise `FileFormatError` if what an archive holds is far larger than the archive.

    The sizes are those of its directory. Each part is then unpacked a piece at a time, because one
    that is larger than it says there would be unpacked whole before that shows.
    """
    try:
        with ZipFile(path) as archive:
            parts = archive.infolist()
            # Others, which none of these formats needs, cannot be unpacked a piece at a time.
            if any(part.compress_type not in (ZIP_STORED, ZIP_DEFLATED) for part in parts):
                raise FileFormatError(
                    f"{path}: a part of its archive is neither stored nor deflated; export it again"
                )
            _require_few_bytes(path, sum(part.file_size for part in parts))
            for part in parts:
                with archive.open(part) as content:
                    while content.read(_PIECE):
                        pass
    except FileFormatError:
        raise
    except (BadZipFile, OSError, ValueError, RuntimeError, EOFError, zlib.error) as error:
        if not is_zipfile(path):
            return  # trimesh says what is wrong with it
        raise FileFormatError(
            f"{path}: a part of its archive is damaged or cannot be unpacked: "
            f"{one_line(error)}; export it again"
        ) from error


def _require_few_bytes(path: PathLike, n_bytes: int) -> None:
    most = max(_LEAST_UNPACKED, _MOST_TIMES * Path(path).stat().st_size)
    if n_bytes > most:
        raise FileFormatError(
            f"{path}: its parts are {n_bytes:,} bytes when they are unpacked, more than {most:,}; "
            "export it again, as a .glb file"
        )


def _load(path: PathLike, suffix: str) -> Any:
    """Return the scene of a file, whatever trimesh and its parsers raise as one error."""
    import trimesh

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), Path(path).open("rb") as file:
            warnings.simplefilter("ignore")
            # numpy only warns where a list of numbers ends early; the rest would be lost.
            warnings.filterwarnings("error", message="string or file could not be read to its end")
            return trimesh.load_scene(file, file_type=suffix[1:], process=False)
    except MemoryError:
        raise
    except Exception as error:
        raise damaged(path, error) from error


def _replace_unknown(path: PathLike, scene: Any) -> None:
    """Replace texture coordinates and normals that are not finite, with a warning."""
    for mesh in scene.geometry.values():
        if getattr(getattr(mesh, "visual", None), "uv", None) is not None:
            mesh.visual.uv = finite_rows(path, mesh.visual.uv, "uvs")
        normals = mesh._cache.cache.get("vertex_normals")
        if normals is not None:
            mesh._cache.cache["vertex_normals"] = finite_rows(path, normals, "normals")


@contextmanager
def _warned_of_geometries(path: PathLike) -> Iterator[None]:
    """Warn of geometries that pycollada leaves out, and keep numbers that are not finite."""
    import collada

    broken: list[Exception] = []
    primitives: list[Any] = []

    def heard(reader: Any) -> None:
        for numbers in reader.xmlnode.iter(collada.tag("float_array")):
            # pycollada reads NaN as 0, but keeps infinities.
            numbers.text = _NAN.sub("inf", numbers.text or "")
        n_before = len(reader.errors)
        load(reader)
        broken.extend(reader.errors[n_before:])
        primitives.extend(part for item in reader.geometries for part in item.primitives)

    with _COLLADA:
        load = collada.Collada._loadGeometry
        collada.Collada._loadGeometry = heard
        try:
            yield
        finally:
            collada.Collada._loadGeometry = load
    if broken:
        noun = "geometry" if len(broken) == 1 else "geometries"
        warn_of(path, f"left out {len(broken):,} damaged {noun}: {one_line(broken[0])}")
    _check_positions(path, primitives)


def _check_positions(path: PathLike, primitives: list[Any]) -> None:
    """Raise if a face uses a position that is not finite; trimesh leaves such faces out."""
    from collada.lineset import LineSet

    found = {}
    for part in primitives:
        if isinstance(part, LineSet) or part.vertex is None:
            continue
        found[id(part.vertex)] = is_bad = rows_not_finite(part.vertex)
        if is_bad[part.vertex_index].any():
            raise MeshError(f"{path}: a position of a face is not finite; export the mesh again")
    if n_bad := sum(map(np.count_nonzero, found.values())):
        warn_unused(path, f"{n_bad:,} of {sum(map(len, found.values())):,}")


def _welded(mesh: Mesh) -> Mesh:
    """Join vertices at one position, and values of a vertex that are equal."""
    if mesh.colors is not None:
        return mesh  # vertices at one position may differ in color
    firsts = weld_rows(mesh.positions)
    kept, vertices = np.unique(firsts, return_inverse=True)
    faces = vertices.astype(np.int32)[mesh.faces]
    changes: dict[str, Any] = {"positions": mesh.positions[kept], "faces": faces}
    for values, corners in (("uvs", "uv_faces"), ("normals", "normal_faces")):
        array, indices = getattr(mesh, values), getattr(mesh, corners)
        if array is not None:
            changes[values], changes[corners] = _welded_values(faces, array, indices)
    return mesh.replace(**changes)


def _welded_values(
    faces: IntArray, values: FloatArray, corners: IntArray
) -> tuple[FloatArray, IntArray]:
    """Values of which a vertex has no two equal ones, and the corners as indices into them."""
    rows = np.concatenate([faces.reshape(-1, 1), values[corners.ravel()]], axis=1)
    kept, ids = np.unique(weld_rows(rows), return_inverse=True)
    return rows[kept, 1:], ids.astype(np.int32).reshape(-1, 3)
