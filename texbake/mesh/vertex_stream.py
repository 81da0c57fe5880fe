"""Vertices with one index for all attributes, as decimation libraries and graphics cards take them.

Where corners at one position differ in texture coordinates, hard normals or group, the stream has a
vertex for each; a library that sees several vertices at one position takes the edges between them
for a seam and keeps it. Vertices of two objects never share a position, however close they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.compose import used_rows
from texbake.mesh.frame import UnitGrid
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.objects import has_borders, object_groups, weld_vertices
from texbake.mesh.topology import repeated_vertices
from texbake.mesh.weld import weld_rows

_FACES_OF_A_VERTEX = 4  # of a surface there are about two


@dataclass(frozen=True, eq=False)
class VertexStream:
    """Vertices of a stream as rows of a mesh's lists; None for one that separates no vertices."""

    # (F', 3) int32: indices of stream vertices, three distinct ones each. Two of them may lie at
    # one position, as at the poles of many spheres: such faces tie the sides of a seam together.
    faces: IntArray
    points: FloatArray  # (S, 3) float64: positions on the mesh's `UnitGrid`
    position_ids: IntArray  # (S,) int32
    uv_ids: IntArray | None = None  # (S,) int32
    normal_ids: IntArray | None = None
    group_ids: IntArray | None = None
    # (S,) int32: first group of the object of each vertex, if the mesh has several objects
    object_ids: IntArray | None = None

    @property
    def has_seams(self) -> bool:
        """Whether vertices differ in more than their positions."""
        return any(ids is not None for ids in (self.uv_ids, self.normal_ids, self.group_ids))

    @cached_property
    def vertices(self) -> tuple[IntArray, FloatArray]:
        """(S,) int32 number of each stream vertex's position among those used, and their points."""
        if not self.has_seams:
            return np.arange(len(self.points), dtype=np.int32), self.points
        _, firsts, numbers = np.unique(self.position_ids, return_index=True, return_inverse=True)
        return numbers.ravel().astype(np.int32), self.points[firsts]

    def restricted(self, faces: IntArray) -> VertexStream:
        """Stream of other faces over these vertices, without the vertices they do not use."""
        used, faces = used_rows(faces, len(self.points))
        ids = (self.uv_ids, self.normal_ids, self.group_ids, self.object_ids)
        return VertexStream(
            faces,
            self.points[used],
            self.position_ids[used],
            *(None if values is None else values[used] for values in ids),
        )


def weld_positions(mesh: Mesh, *, threads: int | None = None) -> VertexStream:
    """Stream of the positions alone, each a vertex once, however often the file repeats it."""
    return _welded(mesh, weld_vertices(mesh, threads=threads)[mesh.faces], {}, threads)


def weld_corners(mesh: Mesh, *, threads: int | None = None) -> VertexStream:
    """Stream with a vertex for each combination of texture coordinate, hard normal and group.

    Normals count where they differ at one position, and groups where an object has more than one.
    """
    places = weld_vertices(mesh, threads=threads)[mesh.faces]
    columns = {}
    if mesh.uvs is not None:
        columns["uv_ids"] = weld_rows(mesh.uvs, threads=threads)[mesh.uv_faces]
    if mesh.normals is not None:
        normals = weld_rows(mesh.normals, threads=threads)[mesh.normal_faces]
        normal_of = np.empty(mesh.n_vertices, dtype=np.int32)
        normal_of[places] = normals  # of several, any one
        if (normal_of[places] != normals).any():
            columns["normal_ids"] = normals
    if mesh.face_groups is not None and has_borders(mesh):
        columns["group_ids"] = np.repeat(mesh.face_groups[:, None], 3, axis=1)
    return _welded(mesh, places, columns, threads)


def _welded(
    mesh: Mesh, places: IntArray, columns: dict[str, IntArray], threads: int | None
) -> VertexStream:
    """Stream with a vertex for each place and its values in columns, all (F, 3)."""
    if columns:
        rows = np.stack([ids.ravel() for ids in (places, *columns.values())], axis=1)
        corners = weld_rows(rows, threads=threads).reshape(-1, 3)
    else:
        rows, corners = np.arange(mesh.n_vertices, dtype=np.int32)[:, None], places
    corners = corners[~repeated_vertices(corners)]
    corners = _without_stacks(corners, rows[:, 0][corners], mesh.n_vertices)
    vertices, faces = used_rows(corners, len(rows))
    position_ids, *others = rows[vertices].T
    object_ids = None
    groups = object_groups(mesh)
    if groups is not None:
        of_vertices = np.zeros(mesh.n_vertices, np.int32)
        of_vertices[mesh.faces] = groups[:, np.newaxis]
        object_ids = of_vertices[position_ids]
    return VertexStream(
        faces,
        UnitGrid.around(mesh).to_grid(mesh.positions[position_ids]),
        position_ids,
        **dict(zip(columns, others, strict=True)),
        object_ids=object_ids,
    )


def gather(mesh: Mesh, stream: VertexStream, faces: IntArray) -> Mesh | None:
    """Mesh of faces over stream vertices, with the attributes that separate those.

    None where no face has three distinct positions. Positions keep their bits. What no corner uses
    is left out; so are duplicate faces (of one winding) and faces with fewer than three distinct
    positions. Colors and group names stay. Tangents go, because they belong to corners of faces
    that are no longer there, and so do normals without hard edges, because smooth normals are
    those of the surface that is left.
    """
    corners = stream.position_ids[faces]
    faces = faces[~repeated_vertices(corners) & _is_first_of_its_kind(corners)]
    if len(faces) == 0:
        return None
    position_ids, position_faces = used_rows(stream.position_ids[faces], mesh.n_vertices)
    fields: dict[str, Any] = {"positions": mesh.positions[position_ids], "faces": position_faces}
    if mesh.colors is not None:
        fields["colors"] = mesh.colors[position_ids]
    for values, corners_of, ids in (
        ("uvs", "uv_faces", stream.uv_ids),
        ("normals", "normal_faces", stream.normal_ids),
    ):
        rows = getattr(mesh, values)
        if rows is not None and ids is not None:
            used, fields[corners_of] = used_rows(ids[faces], len(rows))
            fields[values] = rows[used]
    groups = stream.object_ids if stream.group_ids is None else stream.group_ids
    if groups is not None:
        names = {"group_names": mesh.group_names, "group_objects": mesh.group_objects}
        fields |= {"face_groups": groups[faces[:, 0]], **names}
    return Mesh(**fields, name=mesh.name)


def _is_first_of_its_kind(faces: IntArray) -> npt.NDArray[np.bool_]:
    """False for a face that repeats one before it, its corners in the same cyclic order."""
    turns = np.argmin(faces, axis=1)
    rows = np.arange(len(faces))
    turned = np.stack([faces[rows, (turns + step) % 3] for step in range(3)], axis=1)
    return np.asarray(weld_rows(turned) == rows)


def _without_stacks(faces: IntArray, places: IntArray, n_vertices: int) -> IntArray:
    """Drop copies of faces if there are more faces than a surface has with so few vertices.

    Nothing could collapse at an edge that thousands of them share.
    """
    used = np.zeros(n_vertices, dtype=np.bool_)
    used[places.ravel()] = True
    if len(faces) <= _FACES_OF_A_VERTEX * np.count_nonzero(used):
        return faces
    return faces[_is_first_of_its_kind(places)]
