"""Writing Wavefront OBJ, which `texbake.mesh.files.obj` reads, and a file of UV sets beside it.

docs/reference/formats.md describes the archive of UV sets. `of_faces` in it is a checksum of the
faces that its sets belong to, so that it no longer fits once another program has changed them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.arrays import DAMAGE, read_arrays, write_arrays
from texbake.errors import FileFormatError, one_line
from texbake.files import PathLike, appearing_together, is_file, remove_file, replacing
from texbake.mesh.files.conversion import linear_colors, srgb_colors
from texbake.mesh.files.source import write_lists, write_rows
from texbake.mesh.mesh import ByteArray, Int64Array, IntArray, Mesh, UvSet
from texbake.mesh.polygons import Outlines, outlines, triangulated


@appearing_together()
def write_obj(
    mesh: Mesh,
    path: PathLike,
    *,
    library: str = "",
    face_materials: IntArray | None = None,
    material_names: Sequence[str] = (),
) -> None:
    """Write a mesh as OBJ without tangents, further uvs beside it; `face_materials` (F,) int32."""
    polygons = outlines(mesh)
    polygons.warn(path)
    ends = np.cumsum(polygons.sizes)
    with replacing(path) as temporary, temporary.open("wb") as file:
        if library:
            file.write(f"mtllib {library}\n".encode("utf-8", "replace"))
        points = mesh.positions
        if mesh.colors is not None:
            colors = srgb_colors(mesh.colors)
            short = np.round(colors, 6)  # as most programs write them
            is_same = linear_colors(short) == mesh.colors
            points = np.concatenate([points, np.where(is_same, short, colors)], axis=1)
        write_rows(file, "v" + " %r" * points.shape[1] + "\n", points)
        if mesh.uvs is not None:
            write_rows(file, "vt %r %r\n", mesh.uvs)
        if mesh.normals is not None:
            write_rows(file, "vn %r %r %r\n", mesh.normals)
        corners = _corner_indices(mesh, polygons.slots)
        corner_format = {
            (False, False): " %d",
            (True, False): " %d/%d",
            (False, True): " %d//%d",
            (True, True): " %d/%d/%d",
        }[mesh.uvs is not None, mesh.normals is not None]
        groups, group, material = _group_statements(mesh), None, None
        is_marked_smooth = False
        for start, stop in _runs(mesh, face_materials, polygons):
            face = polygons.firsts[start]
            if mesh.face_groups is not None and mesh.face_groups[face] != group:
                is_same = (
                    group is not None and groups[group][0] == groups[mesh.face_groups[face]][0]
                )
                group = mesh.face_groups[face]
                text = groups[group][1] or "g\n" if is_same else "".join(groups[group])
                file.write(text.encode("utf-8", "replace"))
                is_marked_smooth = False
            if face_materials is not None and face_materials[face] != material:
                material = face_materials[face]
                file.write(f"usemtl {material_names[material]}\n".encode("utf-8", "replace"))
            if mesh.normals is None and not is_marked_smooth:
                file.write(b"s 1\n")  # without it, other programs show each object faceted
                is_marked_smooth = True
            sizes = polygons.sizes[start:stop]
            rows = corners[ends[start] - sizes[0] : ends[stop - 1]]
            write_lists(file, lambda size: f"f{size * corner_format}\n", sizes, rows)
    write_uv_sets(mesh, path, polygons)


def _corner_indices(mesh: Mesh, slots: Int64Array) -> IntArray:
    """(C, n) indices from 1 of corners: position, and those that the mesh has."""
    indices = [mesh.faces]
    if mesh.uv_faces is not None:
        indices.append(mesh.uv_faces)
    if mesh.normal_faces is not None:
        indices.append(mesh.normal_faces)
    return np.stack([corners.ravel()[slots] for corners in indices], axis=1) + np.int32(1)


def _group_statements(mesh: Mesh) -> list[tuple[str, str]]:
    """Statements of the object and of the group in it, for each group."""
    names = [plain_name(name) for name in mesh.group_names]
    if mesh.face_groups is None:
        return []
    pairs = []
    for name in names:
        head, _, tail = name.partition("/")
        is_pair = head and tail and head != tail and name == f"{head.strip()}/{tail.strip()}"
        pairs.append((head, tail) if is_pair else (name, ""))
    numbers = {head: number for number, (head, _) in enumerate(pairs)}
    objects = np.array([numbers[head] for head, _ in pairs])[mesh.face_groups, None]
    of_vertices = np.empty(mesh.n_vertices, np.int64)
    of_vertices[mesh.faces] = objects
    if (of_vertices[mesh.faces] != objects).any():
        return [("", f"g {name}\n") for name in names]
    return [(f"o {head}\n", f"g {tail}\n" if tail else "") for head, tail in pairs]


def _runs(
    mesh: Mesh, face_materials: IntArray | None, polygons: Outlines
) -> Iterator[tuple[int, int]]:
    """First and last + 1 of each run of polygons of one group and one material."""
    begins = np.zeros(len(polygons.sizes), np.bool_)
    begins[0] = True
    for ids in (mesh.face_groups, face_materials):
        if ids is not None:
            begins[1:] |= np.diff(ids[polygons.firsts]) != 0
    starts = np.flatnonzero(begins).tolist()
    yield from zip(starts, [*starts[1:], len(begins)], strict=True)


def plain_name(name: str) -> str:
    """Return a name for one line of a file, without control characters."""
    return "".join(" " if ord(sign) < 32 else sign for sign in name).strip()


def uv_sets_path(path: PathLike) -> Path:
    """Return the path of the file with the further sets of an OBJ file."""
    return Path(path).with_suffix(".uvs.npz")


def write_uv_sets(mesh: Mesh, path: PathLike, polygons: Outlines) -> None:
    """Write further sets beside an OBJ file, in the order of its triangles, or remove them."""
    beside = uv_sets_path(path)
    if not mesh.uv_sets:
        if is_file(beside):  # False if the name is too long for a file
            remove_file(beside)
        return
    vertices = mesh.faces.ravel()[polygons.slots]
    slots = polygons.slots[triangulated(path, mesh.positions, vertices, polygons.sizes)[0]]
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
            "sets again with: texbake unwrap --uv-set"
        )
    return sets


def _checksum(faces: IntArray) -> ByteArray:
    import hashlib  # few files need it

    return np.frombuffer(hashlib.sha256(faces.tobytes()).digest(), np.uint8)


def uv_set_names_beside(path: PathLike) -> tuple[str, ...]:
    """Return the names of the further sets of an OBJ file; none where the file is damaged."""
    try:
        return tuple(str(name) for name in read_arrays(uv_sets_path(path))["names"])
    except (OSError, *DAMAGE):
        return ()
