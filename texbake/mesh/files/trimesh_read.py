"""Formats that only trimesh reads: COLLADA (.dae, .zae), 3MF, 3DXML and XAML.

The meshes of the file are placed as its scene says and joined into one, a group for each node, in
the file's own axes and units. Vertices at one position, bit for bit, become one, because trimesh
splits them at every corner; texture coordinates and normals keep their own indices. A process of
its own reads the file, as for USD: nested node instances can be far more than it holds.
"""

from __future__ import annotations

import re
import warnings
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import iterparse
from zipfile import ZipFile, is_zipfile

import numpy as np

from texbake.child import LIMITS
from texbake.errors import FileFormatError, MeshError, counted, one_line, require_library, warn_of
from texbake.files import PathLike
from texbake.mesh.files.conversion import finite_rows, rows_not_finite, warn_unused
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.source import damaged, read_array
from texbake.mesh.interchange import from_trimesh
from texbake.mesh.mesh import Mesh, UvSet
from texbake.mesh.weld import unique_corners, unique_rows

# Libraries of trimesh that it leaves to its users to install.
_LIBRARIES = {".3mf": ("lxml", "networkx"), ".3dxml": ("lxml", "networkx"), ".xaml": ("lxml",)}
_PACKED = 20  # times that the XML of an archive may be larger than the archive
_NAN = re.compile(r"[-+]?\bnan\b", re.IGNORECASE)
_NO_INDEX = re.compile(r"-|\d{11}")


def read_with_trimesh(path: PathLike) -> Mesh:
    """Read a .dae, .zae, .3mf, .3dxml or .xaml file, scenes as the module describes."""
    read_array(path)  # raises where it is missing or empty
    mesh: Mesh = read_in_child(path, "trimesh", {"Mesh": Mesh, "UvSet": UvSet})
    return mesh


def mesh_of_trimesh(path: PathLike) -> Mesh:
    """Answer for `read_with_trimesh`."""
    suffix = Path(path).suffix.lower()
    if is_zipfile(path):
        LIMITS.allow(_PACKED * Path(path).stat().st_size)
    primitives: list[Any] = []
    broken = _record_geometries(path, primitives) if suffix in (".dae", ".zae") else []
    scene = _load(path, suffix)
    if broken:
        n_broken = counted(len(broken), "damaged geometry", "damaged geometries")
        warn_of(path, f"left out {n_broken}: {one_line(broken[0])}")
    _check_positions(path, primitives)
    if suffix == ".3mf":
        _require_all_objects(path, scene)
    _replace_unknown(path, scene)
    # Its warnings and errors are about the file.
    return _welded(from_trimesh(scene, name=str(path))).replace(name=Path(path).name)


def _load(path: PathLike, suffix: str) -> Any:
    """Return the scene of a file, whatever trimesh and its parsers raise as one error."""
    trimesh = require_library("trimesh", path)
    for library in _LIBRARIES.get(suffix, ()):
        require_library(library, path)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), Path(path).open("rb") as file:
            warnings.simplefilter("ignore")
            # numpy only warns where a list of numbers ends early; the rest would be lost.
            warnings.filterwarnings("error", message="string or file could not be read to its end")
            return trimesh.load_scene(file, file_type=suffix[1:], process=False)
    except MemoryError:
        raise
    except SystemError as error:  # there was no memory for an exception
        raise MemoryError from error
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


def _record_geometries(path: PathLike, primitives: list[Any]) -> list[Exception]:
    """Make pycollada keep numbers that are not finite; return a list of what it drops."""
    collada = require_library("collada", path)
    broken: list[Exception] = []
    load = collada.Collada._loadGeometry

    def heard(reader: Any) -> None:
        for numbers in reader.xmlnode.iter(collada.tag("float_array")):
            # pycollada reads NaN as 0, but keeps infinities.
            numbers.text = _NAN.sub("inf", numbers.text or "")
        for indices in reader.xmlnode.iter(collada.tag("p")):
            if _NO_INDEX.search(indices.text or ""):  # it would take another vertex
                raise ValueError("an index of its faces is out of range")
        n_before = len(reader.errors)
        load(reader)
        broken.extend(reader.errors[n_before:])
        primitives.extend(part for item in reader.geometries for part in item.primitives)

    collada.Collada._loadGeometry = heard
    return broken


def _check_positions(path: PathLike, primitives: list[Any]) -> None:
    """Raise if a face uses a position that is not finite; trimesh leaves such faces out."""
    found = {}
    for part in primitives:
        if type(part).__name__ == "LineSet" or part.vertex is None:
            continue
        found[id(part.vertex)] = is_bad = rows_not_finite(part.vertex)
        if is_bad[part.vertex_index].any():
            raise MeshError(f"{path}: a position of a face is not finite; export the mesh again")
    if n_bad := sum(map(np.count_nonzero, found.values())):
        warn_unused(path, f"{n_bad:,} of {sum(map(len, found.values())):,}")


def _require_all_objects(path: PathLike, scene: Any) -> None:
    """Raise `FileFormatError` where trimesh has silently left out objects of a 3MF file.

    It stops at a number of steps that two levels of objects can exceed, and keeps one object of a
    part number.
    """
    try:
        n_built = _count_objects(path)
    except (SyntaxError, ValueError, LookupError, RecursionError) as error:
        raise damaged(path, error) from error
    shown = [scene.graph[node][1] for node in scene.graph.nodes_geometry]
    if sum(len(scene.geometry[name].faces) > 0 for name in shown) != n_built:
        raise FileFormatError(
            f"{path}: trimesh cannot read all of its nested objects, so some would be lost; "
            "export it as a .glb file"
        )


def _count_objects(path: PathLike) -> int:
    """Count the objects of triangles that a 3MF file builds, each as often as it is placed."""
    components: dict[str, list[str]] = defaultdict(list)
    meshes: set[str] = set()
    items: list[str] = []
    index = ""
    with ZipFile(path) as archive:
        # As trimesh chooses it.
        main = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        with archive.open(main) as file:
            for event, element in iterparse(file, events=("start", "end")):
                tag, name = element.tag.rpartition("}")[2], element.get("objectid", "")
                if event == "end":
                    element.clear()
                elif tag == "object":
                    index = element.get("id", "")
                elif tag == "triangle":
                    meshes.add(index)
                elif tag == "component":
                    components[index].append(name)
                    if any(key.endswith("path") for key in element.attrib):
                        meshes.add(name)  # in another part of the archive
                elif tag == "item":
                    items.append(name)

    @cache
    def count(name: str) -> int:
        return (name in meshes) + sum(map(count, components[name]))

    return sum(map(count, items))


def _welded(mesh: Mesh) -> Mesh:
    """Join vertices at one position, and values of a vertex that are equal."""
    if mesh.colors is not None:
        return mesh  # vertices at one position may differ in color
    kept, vertices = unique_rows(mesh.positions)
    faces = vertices[mesh.faces]
    changes: dict[str, Any] = {"positions": mesh.positions[kept], "faces": faces}
    for values, corners in (("uvs", "uv_faces"), ("normals", "normal_faces")):
        array, indices = getattr(mesh, values), getattr(mesh, corners)
        if array is not None:
            changes[values], changes[corners] = unique_corners(faces, array[indices.ravel()])
    return mesh.replace(**changes)
