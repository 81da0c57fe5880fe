"""Streams of vertices with one index for all attributes; collapsed edges and parts left out.

Where corners at one position differ in texture coordinates, hard normals or group, the stream has a
vertex for each; the kernels take the edges between several vertices at one position for a seam and
keep it. Vertices of two objects never share a position, however close they are. Kernel, which names
the sources: `core/quadric_simplification.c`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from texbake.core import core
from texbake.mesh.compose import used_rows
from texbake.mesh.frame import UnitGrid
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.objects import has_borders, object_groups, weld_vertices
from texbake.mesh.topology import find_edges, repeated_vertices
from texbake.mesh.weld import later_copies, weld_rows
from texbake.records import dataclass

_FACES_OF_A_VERTEX = 4  # of a surface there are about two

# Distance, as a share of the longest side of a model, that counts as much as a radian between
# normals. With far less, pictures of five models are 0.4 dB closer to 0.4 dB less close.
_SHADING = 0.016

_MIRRORED_SHARE = 0.05  # of the texture; less is mirrored by accident, in folds

# A boundary is simplified like the rest where keeping all of it would take up more than this part
# of the faces, or this part more than simplifying it.
_BOUNDARY_SHARE, _BOUNDARY_COST = 0.25, 0.05


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
    poses: FloatArray | None = None  # (P, S, 3) float64: positions on the grid in other poses
    importance: FloatArray | None = None  # (S,) float64: what errors count by, beside their area
    normals: FloatArray | None = None  # (N, 3) float64: of the mesh, where their errors count
    shading: float = 0.0  # distance on the grid that counts as much as a radian between them
    is_smooth: bool = False  # whether there is one normal at each position
    is_apart: bool = False  # there may be several vertices at a position, without seams
    keeps_topology: bool = True  # of surfaces; where it does not, they are apart

    @property
    def has_seams(self) -> bool:
        """Whether vertices differ in more than their positions."""
        return any(ids is not None for ids in (self.uv_ids, self.normal_ids, self.group_ids))

    @property
    def has_hard_edges(self) -> bool:
        """Whether vertices differ in normals at one position."""
        return self.normal_ids is not None and not self.is_smooth

    @cached_property
    def vertices(self) -> tuple[IntArray, FloatArray]:
        """(S,) int32 number of each stream vertex's position among those used, and their points."""
        if not self.has_seams:
            return np.arange(len(self.points), dtype=np.int32), self.points
        _, firsts, numbers = np.unique(self.position_ids, return_index=True, return_inverse=True)
        return numbers.ravel().astype(np.int32), self.points[firsts]

    @cached_property
    def posed(self) -> FloatArray | None:
        """(n, 3) float64: points of the vertices in each pose, one pose after the other."""
        if self.poses is None:
            return None
        poses = self.poses
        if self.has_seams:
            poses = poses[:, np.unique(self.position_ids, return_index=True)[1]]
        return np.ascontiguousarray(poses.reshape(-1, 3))

    @property
    def importance_of_vertices(self) -> FloatArray | None:
        """(n,) float64: a copy of what errors at the vertices count by."""
        if self.importance is None:
            return None
        values = np.empty(len(self.vertices[1]))
        values[self.vertices[0]] = self.importance
        return values

    @cached_property
    def has_bad_edges(self) -> bool:
        """Whether edges of more than two faces hinder collapses, and could be taken apart."""
        if self.has_seams or self.is_apart:
            return False
        return bool(find_edges(self.position_ids[self.faces]).non_manifold.any())

    def without_copies(self) -> VertexStream:
        """Stream without faces that repeat an earlier one, wound alike."""
        is_kept = _is_first_of_its_kind(self.faces)
        return self if is_kept.all() else self.restricted(self.faces[is_kept])

    def of_positions(self) -> VertexStream:
        """Stream of the positions alone, each a vertex once, without repeated faces."""
        vertex_of, points = self.vertices
        faces = vertex_of[self.faces]
        faces = faces[~repeated_vertices(faces) & _is_first_of_its_kind(faces)]
        firsts = np.unique(self.position_ids, return_index=True)[1]
        return replace(
            self,
            faces=faces,
            points=points,
            position_ids=self.position_ids[firsts],
            group_ids=None,
            object_ids=None if self.object_ids is None else self.object_ids[firsts],
            importance=self.importance_of_vertices,
            poses=None if self.poses is None else self.poses[:, firsts],
        ).restricted(faces)

    def restricted(self, faces: IntArray) -> VertexStream:
        """Stream of other faces over these vertices, without the vertices they do not use."""
        used, faces = used_rows(faces, len(self.points))
        names = ("uv_ids", "normal_ids", "group_ids", "object_ids", "importance")
        ids = {name: getattr(self, name) for name in names}
        kept = {name: None if values is None else values[used] for name, values in ids.items()}
        if self.poses is not None:
            kept["poses"] = self.poses[:, used]
        return VertexStream(
            faces, self.points[used], self.position_ids[used], normals=self.normals,
            shading=self.shading, is_smooth=self.is_smooth, is_apart=self.is_apart,
            keeps_topology=self.keeps_topology, **kept,
        )  # fmt: skip


def with_surfaces_apart(stream: VertexStream, *, opens: bool = False) -> VertexStream:
    """The stream, if it has no seams, with a vertex for each surface at one position.

    Edges with a face that has no partner of the other winding stay, unless it `opens` them.
    Kernel: `core/surface_surgery.c`.
    """
    for level in (1, 2) if opens else (0,):
        copies = np.empty_like(stream.faces)
        if stream.has_seams or not core.separate_surfaces(
            stream.faces, stream.points, level, copies
        ):
            continue
        rows = np.stack([copies, stream.faces], axis=-1).reshape(-1, 2)
        pairs, numbers = np.unique(rows, axis=0, return_inverse=True)
        kept = pairs[:, 1]
        objects, poses, importance = stream.object_ids, stream.poses, stream.importance
        stream = replace(
            stream,
            faces=numbers.astype(np.int32).reshape(-1, 3),
            points=stream.points[kept],
            position_ids=stream.position_ids[kept],
            object_ids=None if objects is None else objects[kept],
            importance=None if importance is None else importance[kept],
            poses=None if poses is None else poses[:, kept],
            is_apart=True,
        )
    return stream


def shading_length(mesh: Mesh) -> float:
    """Length that counts as much as a radian between normals, in units of the model."""
    low, high = mesh.bounds
    return _SHADING * float((high - low).max())


def weld_corners(
    mesh: Mesh,
    *,
    shades: float = 0.0,
    importance: FloatArray | None = None,
    threads: int | None = None,
) -> VertexStream:
    """Stream with a vertex for each combination of uv, hard normal and group at a position.

    If `shades`, a length that counts as much as a radian, is not 0, it has the mesh's normals.
    `importance` (V,) float64 is what errors at vertices count by.
    """
    grid = UnitGrid.around(mesh)  # where vertices that differ by rounding are one
    firsts = weld_vertices(mesh.replace(positions=grid.to_grid(mesh.positions)), threads=threads)
    places = firsts[mesh.faces]
    columns, is_smooth = {}, False
    if mesh.uvs is not None:
        # The lowest bit tells the two sides of a mirror line apart: their coordinates are equal.
        uv_ids = weld_rows(mesh.uvs, threads=threads)[mesh.uv_faces]
        columns["uv_ids"] = 2 * uv_ids + _mirrored(mesh)[:, None].astype(np.int32)
    if mesh.normals is not None:
        normals = weld_rows(mesh.normals, threads=threads)[mesh.normal_faces]
        normal_of = np.empty(mesh.n_vertices, dtype=np.int32)
        normal_of[places] = normals  # of several, any one
        is_smooth = bool((normal_of[places] == normals).all())
        if shades or not is_smooth:
            columns["normal_ids"] = normals
    if mesh.face_groups is not None and has_borders(mesh):
        columns["group_ids"] = np.repeat(mesh.face_groups[:, None], 3, axis=1)
    stream = _weld(mesh, places, columns, threads)
    if stream.uv_ids is not None:
        stream = replace(stream, uv_ids=stream.uv_ids >> 1)
    if importance is not None:
        stream = replace(stream, importance=importance[stream.position_ids])
    if not shades:
        return stream
    shading = float(grid.length_to_grid(shades))
    return replace(stream, normals=mesh.normals, shading=shading, is_smooth=is_smooth)


def _mirrored(mesh: Mesh) -> BoolArray:
    """(F,) faces that are mirrored in the texture, if these and the others cover much of it."""
    uvs = mesh.corner_uvs()
    sides = np.diff(uvs / (np.abs(uvs).max() or 1.0), axis=1)  # of any size without overflow
    areas = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    share = -float(areas[areas < 0.0].sum()) / (float(np.abs(areas).sum()) or 1.0)
    return np.asarray(areas < 0.0) & (_MIRRORED_SHARE <= share <= 1.0 - _MIRRORED_SHARE)


def _weld(
    mesh: Mesh, places: IntArray, columns: dict[str, IntArray], threads: int | None
) -> VertexStream:
    """Stream with a vertex for each place and its values in columns, all (F, 3)."""
    if columns:
        rows = np.stack([ids.ravel() for ids in (places, *columns.values())], axis=1)
        corners = weld_rows(rows, threads=threads).reshape(-1, 3)
    else:
        rows, corners = np.arange(mesh.n_vertices, dtype=np.int32)[:, None], places
    corners = corners[~repeated_vertices(corners)]
    places = rows[:, 0][corners] if columns else corners
    corners = _without_stacks(corners, places, mesh.n_vertices)
    vertices, faces = used_rows(corners, len(rows))
    position_ids, *others = rows[vertices].T
    object_ids = None
    groups = object_groups(mesh)
    if groups is not None:
        of_vertices = np.zeros(mesh.n_vertices, np.int32)
        of_vertices[mesh.faces] = groups[:, np.newaxis]
        object_ids = of_vertices[position_ids]
    grid, poses = UnitGrid.around(mesh), None
    if mesh.deformation is not None and len(mesh.deformation.poses):
        poses = np.stack([grid.to_grid(pose[position_ids]) for pose in mesh.deformation.poses])
    return VertexStream(
        faces,
        grid.to_grid(mesh.positions[position_ids]),
        position_ids,
        **dict(zip(columns, others, strict=True)),
        object_ids=object_ids,
        poses=poses,
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
    if mesh.deformation is not None:
        fields["deformation"] = mesh.deformation.of(position_ids)
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


def _is_first_of_its_kind(faces: IntArray) -> BoolArray:
    """False for a face that repeats one before it, its corners in the same cyclic order."""
    turns = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.asarray(~later_copies(np.take_along_axis(faces, turns, axis=1)))


def _without_stacks(faces: IntArray, places: IntArray, n_vertices: int) -> IntArray:
    """Drop copies of faces, at whose edges nothing could collapse, if there are many."""
    used = np.zeros(n_vertices, dtype=np.bool_)
    used[places.ravel()] = True
    if len(faces) <= _FACES_OF_A_VERTEX * np.count_nonzero(used):
        return faces
    return faces[_is_first_of_its_kind(places)]


def boundary_fits(stream: VertexStream, n_faces: int) -> bool:
    """Whether there is a boundary, and keeping all of it takes few of `n_faces` from the rest."""
    n_boundary = int(np.count_nonzero(open_vertices(stream)))
    # Edges are about as long at the boundary as elsewhere.
    n_more = n_boundary * (1.0 - min(math.sqrt(n_faces / len(stream.faces)), 1.0))
    return 0 < n_boundary <= _BOUNDARY_SHARE * n_faces and n_more <= _BOUNDARY_COST * n_faces


def open_vertices(stream: VertexStream) -> BoolArray:
    """(V,) bool: where a surface is open or wound in different ways; `core/closed_surfaces.c`."""
    vertex_of, points = stream.vertices
    is_open = np.empty(len(points), dtype=bool)
    core.mark_open_vertices(vertex_of, stream.faces, is_open)
    return is_open


def collapse_stream(stream: VertexStream, n_faces: int, *, lock_boundary: bool = False) -> IntArray:
    """(F, 3) faces once edges are collapsed onto their ends, down to `n_faces` if possible."""
    vertex_of, points = stream.vertices
    faces = with_three_places(stream, stream.faces)
    normal_rows, normals = _rows_of_vertices(vertex_of, stream.normal_ids, stream.normals)
    copy_of = _first_at_each_place(stream)
    n_left = core.collapse_edges(
        vertex_of, points.copy(), faces, None, None, normal_rows, normals, _copied(stream.posed),
        copy_of, stream.importance_of_vertices, stream.shading * stream.shading, n_faces, False,
        lock_boundary, not stream.keeps_topology,
    )  # fmt: skip
    return faces[:n_left] if copy_of is None else copy_of[faces[:n_left]]


def _first_at_each_place(stream: VertexStream) -> IntArray | None:
    """(S,) int32 first vertex at the position of each, where there may be several."""
    if not stream.is_apart:
        return None
    _, firsts, numbers = np.unique(stream.position_ids, return_index=True, return_inverse=True)
    return firsts[numbers.ravel()].astype(np.int32)


def _copied(posed: FloatArray | None) -> FloatArray | None:
    return None if posed is None else posed.copy()


def move_and_collapse(
    mesh: Mesh, stream: VertexStream, n_faces: int, *, lock_boundary: bool = False
) -> Mesh | None:
    """Mesh whose edges were collapsed, each to the place where the error is least; as `gather`.

    Seams keep together. Texture coordinates and hard normals follow their vertices: each is that of
    the closest point of the faces around the collapse, and no face flips in texture space.
    Kernels: `core/quadric_simplification.c`, `core/carried_attributes.c`.
    """
    vertex_of, before = stream.vertices
    points = before.copy()
    faces = with_three_places(stream, stream.faces)
    uv_rows, uvs = _rows_of_vertices(vertex_of, stream.uv_ids, mesh.uvs)
    normal_rows, normals = _rows_of_vertices(vertex_of, stream.normal_ids, mesh.normals)
    n_left = core.collapse_edges(
        vertex_of, points, faces, uv_rows, uvs, normal_rows, normals, _copied(stream.posed),
        _first_at_each_place(stream), stream.importance_of_vertices, 0.0, n_faces, True,
        lock_boundary, not stream.keeps_topology,
    )  # fmt: skip
    faces = faces[:n_left]
    positions = np.empty_like(points)
    positions[vertex_of] = mesh.positions[stream.position_ids]
    moved = Mesh(
        positions=positions + UnitGrid.around(mesh).length_to_model(points - before),
        faces=vertex_of[faces],
        uvs=uvs,
        uv_faces=None if uv_rows is None else uv_rows[faces],
        normals=normals,
        normal_faces=None if normal_rows is None else normal_rows[faces],
        group_names=mesh.group_names,
        group_objects=mesh.group_objects,
        name=mesh.name,
    )
    by_vertex = (uv_rows, normal_rows, stream.group_ids, stream.object_ids)
    return gather(moved, VertexStream(faces, points[vertex_of], vertex_of, *by_vertex), faces)


def _rows_of_vertices(
    vertex_of: IntArray, ids: IntArray | None, values: FloatArray | None
) -> tuple[IntArray | None, FloatArray | None]:
    """A row for each value of each vertex, so that no two vertices share one, and the values."""
    if ids is None or values is None:
        return None, None
    rows = weld_rows(np.stack([vertex_of, ids], axis=1))
    return rows.astype(np.int32), np.ascontiguousarray(values[ids])


def with_three_places(stream: VertexStream, faces: IntArray) -> IntArray:
    """Those of some faces whose corners lie at three places, as a copy."""
    return faces[~repeated_vertices(stream.position_ids[faces] if stream.has_seams else faces)]
