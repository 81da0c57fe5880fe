"""Closest points on triangles, found with a tree of bounding boxes, and what they carry over.

Kernel: `core/triangle_tree.c`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.mesh.frame import LocalFrame
from texbake.mesh.hard_edges import hardened, inner_edges
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import angles_between, face_normals, shading_normals
from texbake.mesh.objects import face_objects, object_groups
from texbake.mesh.topology import next_half_edges
from texbake.mesh.weld import row_sums, without_copies
from texbake.parallel import run_bands
from texbake.records import dataclass

_BAND = 1 << 13
_LEAF = 4  # faces
# Where points are so few that building a tree takes longer than searching it, its leaves are runs
# of this many faces as the mesh lists them. They must mostly lie together: a search may look at no
# more than this many boxes.
_RUN, _FEW_POINTS, _MOST_BOXES = 32, 64, 1_000
_THIN = 1e-3  # extent of a flat box, as a share of that of the whole along its axis


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles in a tree of bounding boxes, made by `TriangleTree.build`."""

    positions: FloatArray  # (V, 3) float64
    faces: IntArray  # (F, 3) int32
    # (n,) int32; face ids, so that those below a node are contiguous. Most copies of faces are left
    # out.
    order: IntArray
    # (N, 6) float32; least x, y, z, then greatest of each node, rounded outward.
    boxes: Float32Array
    # (N, 2) int32; of a leaf the first of its faces in `order` and their number; of an inner node
    # the first of its two children, which are neighbors, and 0.
    nodes: IntArray

    @classmethod
    def build(
        cls, positions: npt.ArrayLike, faces: npt.ArrayLike, *, threads: int | None = None
    ) -> TriangleTree:
        """Build the tree of (V, 3) positions and (F, 3) faces."""
        positions = np.ascontiguousarray(positions, dtype=np.float64)
        faces = np.ascontiguousarray(faces, dtype=np.int32)
        ids, codes = morton_order(positions, faces, threads)
        kept = without_copies(positions, faces, ids, codes)
        if not kept.all():
            ids, codes = ids[kept], codes[kept]
        return cls._of_order(positions, faces, ids, codes, _LEAF)

    @classmethod
    def for_points(
        cls, n_points: int, positions: FloatArray, faces: IntArray, *, threads: int | None = None
    ) -> TriangleTree:
        """Build the tree that serves this number of points fastest; distances are the same."""
        if len(faces) > _FEW_POINTS * n_points:
            runs, codes = morton_order(positions, faces[::_RUN].copy(), threads)
            ids = np.arange(len(runs) * _RUN, dtype=np.int32).reshape(-1, _RUN)[runs].ravel()
            exist = ids < len(faces)
            codes = np.repeat(codes, _RUN)
            tree = cls._of_order(positions, faces, ids[exist], codes[exist], _RUN)
            if tree.boxes_at_a_point() <= _MOST_BOXES:
                return tree
        return cls.build(positions, faces, threads=threads)

    @classmethod
    def _of_order(
        cls,
        positions: FloatArray,
        faces: IntArray,
        ids: IntArray,
        codes: npt.NDArray[np.uint64],
        leaf_size: int,
    ) -> TriangleTree:
        """Build the tree of faces in the order of their codes."""
        boxes = np.empty((2 * len(faces), 6), dtype=np.float32)
        nodes = np.empty((2 * len(faces), 2), dtype=np.int32)
        n_nodes = core.build_triangle_tree(positions, faces, ids, codes, leaf_size, boxes, nodes)
        return cls(positions, faces, ids, boxes[:n_nodes], nodes[:n_nodes])

    def boxes_at_a_point(self) -> float:
        """Mean number of boxes that hold a point of the whole: of nodes, and of faces in leaves."""
        extents = (self.boxes[:, 3:] - self.boxes[:, :3]).astype(np.float64)
        thin = np.maximum(_THIN * extents[0], 1e-300)
        extents += thin
        extents /= extents[0].copy()
        shares = np.prod(extents, axis=1)
        return float((shares * (1 + self.nodes[:, 1])).sum())

    def closest_points(
        self,
        points: npt.ArrayLike,
        *,
        facing: npt.ArrayLike | None = None,
        max_distance: float = float("inf"),
        enough: float = 0.0,
        threads: int | None = None,
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Closest point of the triangles to each point, or any that is at most `enough` away.

        Points that are near each other in the list are found faster: each search starts from the
        face found before.

        `points` (n, 3) float64, in the frame of the positions; `facing` (n, 3) float64. Returns
        `distances` (n,) float64: inf where no face that counts lies within `max_distance`;
        `face_ids` (n,) int32: -1 there. Where several faces are equally close, one of them, the
        same on every run; `barycentrics` (n, 3) float64: weights of the face's corners, none
        negative, their sum 1 to rounding; 0 there.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        if facing is not None:
            facing = np.ascontiguousarray(facing, dtype=np.float64)
        tree = (self.positions, self.faces, self.order, self.boxes, self.nodes)
        limit = float(max_distance)
        distances = np.empty(len(points))
        face_ids = np.empty(len(points), dtype=np.int32)
        barycentrics = np.empty((len(points), 3))
        if not len(self.order):
            distances[:], face_ids[:], barycentrics[:] = np.inf, -1, 0.0
            return distances, face_ids, barycentrics

        def work(start: int, stop: int) -> None:
            core.closest_points(
                *tree, points, facing, limit, enough, start, stop, distances, face_ids, barycentrics
            )

        run_bands(work, len(points), band=_BAND, threads=threads)
        return distances, face_ids, barycentrics


def morton_order(
    positions: FloatArray,
    faces: IntArray,
    threads: int | None,
    *,
    most_bits: int = 64,
    shift: float = 0.0,
    span: float = 1.0,
) -> tuple[IntArray, npt.NDArray[np.uint64]]:
    """Face ids along a Morton curve, and codes, in a cube of `span` times the mesh's size."""
    # The id fills the low bits of the sorted key, the code all others: sorting plain integers is
    # several times faster than finding the permutation that sorts them.
    id_bits = max(1, int(len(faces) - 1).bit_length())
    axis_bits = min((64 - id_bits) // 3, most_bits)
    low = positions.min(axis=0)
    extent = float((positions.max(axis=0) - low).max())
    low -= extent * shift
    cells_a_unit = (2**axis_bits - 1.0) / (span * extent) if extent > 0.0 else 0.0
    keys = np.empty(len(faces), dtype=np.uint64)

    def work(start: int, stop: int) -> None:
        core.morton_keys(positions, faces, low, cells_a_unit, axis_bits, id_bits, start, stop, keys)

    run_bands(work, len(faces), band=1 << 17, threads=threads)
    keys.sort()
    ids = (keys & np.uint64((1 << id_bits) - 1)).astype(np.int32)
    keys >>= np.uint64(id_bits)
    return ids, keys


def with_nearest_groups(mesh: Mesh, source: Mesh, threads: int | None = None) -> Mesh:
    """Give each face the group that another mesh has at the closest point of the same object."""
    apart, groups_of_objects = face_objects(source), object_groups(source)
    if apart is None or groups_of_objects is None or mesh.face_groups is None:
        return mesh
    assert source.face_groups is not None
    if not np.isin(mesh.face_groups, groups_of_objects).all():
        return mesh
    object_of = np.zeros(len(source.group_names), np.int32)
    object_of[source.face_groups] = apart
    of_faces = object_of[mesh.face_groups]
    frame = LocalFrame.around(source)
    points = frame.to_local(source.positions)
    centers = frame.to_local(mesh.positions)[mesh.faces].mean(axis=1)
    groups = mesh.face_groups.copy()
    for number in np.unique(of_faces).tolist():
        own, chosen = np.flatnonzero(apart == number), of_faces == number
        tree = TriangleTree.build(points, source.faces[own], threads=threads)
        _, nearest, _ = tree.closest_points(centers[chosen], threads=threads)
        groups[chosen] = source.face_groups[own[nearest]]
    return mesh.replace(face_groups=groups)


def with_nearest_attributes(mesh: Mesh, source: Mesh, threads: int | None = None) -> Mesh:
    """Give a mesh the groups, colors and deformation of `source` that it lacks, in one space."""
    mesh = with_nearest_motion(mesh, source, threads)
    lacks_groups = mesh.face_groups is None and source.face_groups is not None
    colors = source.colors if mesh.colors is None else None
    names = {"group_names": source.group_names, "group_objects": source.group_objects}
    if lacks_groups and len(source.group_names) == 1:
        mesh = mesh.replace(face_groups=np.zeros(mesh.n_faces, np.int32), **names)
        lacks_groups = False
    if not lacks_groups and colors is None:
        return mesh
    frame = LocalFrame.around(source)
    tree = TriangleTree.build(frame.to_local(source.positions), source.faces, threads=threads)
    points = frame.to_local(mesh.positions)
    if source.face_groups is not None and lacks_groups:
        nearest = tree.closest_points(points[mesh.faces].mean(axis=1), threads=threads)[1]
        mesh = mesh.replace(face_groups=source.face_groups[nearest], **names)
    if colors is not None:
        _, nearest, weights = tree.closest_points(points, threads=threads)
        mesh = mesh.replace(colors=pm.vecmat(weights, colors[source.faces[nearest]]))
    return mesh


def with_nearest_motion(mesh: Mesh, source: Mesh, threads: int | None = None) -> Mesh:
    """Give a mesh without deformation that of the closest points of `source`."""
    if mesh.deformation is not None or source.deformation is None:
        return mesh
    frame = LocalFrame.around(source)
    tree = TriangleTree.build(frame.to_local(source.positions), source.faces, threads=threads)
    _, nearest, weights = tree.closest_points(frame.to_local(mesh.positions), threads=threads)
    return mesh.replace(deformation=source.deformation.mixed(source.faces[nearest], weights))


# Points at which corners take their normals lie this far towards the middle of their face, so that
# the two sides of a hard edge stay apart; farther to find hard edges, which have moved a little.
_INWARDS, _FAR_INWARDS = 1.0 / 64.0, 0.25
# Least cosine between a face and a normal of the source; others belong to another layer.
_ALIKE = 0.2
# Normals of the source jump by at least this many radians at a hard edge, and by this share of the
# angle between the faces; on a curve, they turn by less from one point to the other.
_LEAST_JUMP, _JUMP_SHARE = 0.1, 0.6


def with_source_normals(mesh: Mesh, source: Mesh, *, threads: int | None = None) -> Mesh:
    """Give a simplified mesh the normals of its source, shared as before, where they fit."""
    normals, rows = shading_normals(mesh, threads=threads)
    found = _normals_at_corners(mesh, source, _INWARDS, threads)
    sides = np.repeat(face_normals(mesh, threads=threads), 3, axis=0)
    fits = pm.vecdot(found, sides) > _ALIKE
    sums = row_sums(rows.ravel()[fits], found[fits], len(normals))
    lengths = pm.norm(sums, axis=1, keepdims=True)
    # 0.5: shorter sums have no normal that fits, or normals that cancel each other out.
    new = np.where(lengths > 0.5, sums / np.maximum(lengths, 1e-12), normals)
    return mesh.replace(normals=new, normal_faces=rows, tangents=None)


def with_source_hard_edges(mesh: Mesh, source: Mesh, *, threads: int | None = None) -> Mesh:
    """Give a simplified mesh new normals that are hard where those of its source jump."""
    found = _normals_at_corners(mesh, source, _FAR_INWARDS, threads)
    sides = face_normals(mesh, threads=threads)
    of_corners = np.repeat(sides, 3, axis=0)
    found = np.where(pm.vecdot(found, of_corners)[:, None] > _ALIKE, found, of_corners)
    one, other = inner_edges(mesh)
    ends = (one, next_half_edges(other)), (next_half_edges(one), other)
    jumps = np.minimum(*(angles_between(found[a], found[b]) for a, b in ends))
    turns = angles_between(sides[one // 3], sides[other // 3])
    is_hard = (jumps > _LEAST_JUMP) & (jumps > _JUMP_SHARE * turns)
    return hardened(mesh, one, other, is_hard)


def _normals_at_corners(
    mesh: Mesh, source: Mesh, inwards: float, threads: int | None
) -> FloatArray:
    """(3 F, 3) unit normals of the closest points of a source to the corners of a mesh."""
    of_source, source_rows = shading_normals(source, threads=threads)
    frame = LocalFrame.around(source)
    tree = TriangleTree.build(frame.to_local(source.positions), source.faces, threads=threads)
    corners = frame.to_local(mesh.positions)[mesh.faces]
    points = corners + (corners.mean(axis=1, keepdims=True) - corners) * inwards
    _, nearest, weights = tree.closest_points(points.reshape(-1, 3), threads=threads)
    found = pm.vecmat(weights, of_source[source_rows[nearest]])
    return np.asarray(found / np.maximum(pm.norm(found, axis=1, keepdims=True), 1e-12))
