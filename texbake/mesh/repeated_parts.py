"""Parts of a mesh that are copies of one another: moved, turned, mirrored or scaled alike.

A part is what hangs together of an object. Copies have the same faces in the same order, as the
files of instances and of duplicated parts have them, and look alike: in their materials, texture
coordinates, colors, normals and tangents. A mirrored copy has the corners of each face in reverse.
Instances of a mesh are copies as a whole, and need not be scaled alike along all axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.compose import excerpt, join_parts
from texbake.mesh.instances import instances
from texbake.mesh.materials import ChannelImage, ChannelSource, Materials
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    FloatArray,
    IndexArray,
    Int64Array,
    IntArray,
    Mesh,
)
from texbake.mesh.objects import one_group_a_node, weld_vertices
from texbake.mesh.rig import Rig
from texbake.mesh.topology import face_components
from texbake.records import dataclass

# How far a point may lie from that of its copy, as a share of its part's greatest distance from the
# center: less than a texel of a chart 1,000 texels wide.
_APART = 1e-3
# Difference of directions of length 1, 1.1 degrees: files round normals to 8 bits, by up to 0.007
# in either copy.
_TURNED = 0.02
_SAME = 2.0**-16  # difference of texture coordinates and colors that is rounding
_SIZES = 2.001  # of the largest of a kind over its smallest: others need other triangles
_N_COMPARED = 8  # faces of each part that are compared at first


@dataclass(frozen=True, eq=False)
class Looks:
    """What faces look like, apart from their shape."""

    materials: IntArray  # (F,); faces of different ones look different
    uvs: FloatArray  # (F, 3, 2m); of m sets
    colors: FloatArray  # (F, 3, c)
    tangents: FloatArray  # (F, 3, 4), or (F, 3, 0) without
    has_tiles: BoolArray  # (F,); whether faces look the same if their uvs move by whole numbers

    @classmethod
    def of(cls, mesh: Mesh, materials: Materials) -> Looks:
        """Return what shows of a mesh: coordinates and tangents only where images need them."""
        items, of_any = materials.materials, bool(materials.variants)
        ids = materials.face_materials
        has_images = np.array([of_any or bool(each.images) for each in items])[ids]
        has_normals = np.array([of_any or _bends(each.channels.get("normal")) for each in items])
        tiles = np.array([all(map(_repeats, each.images)) for each in items])
        uvs = colors = tangents = np.zeros((mesh.n_faces, 3, 0))
        if mesh.uvs is not None and mesh.uv_faces is not None:
            sets = [
                materials.uv_sets.get(number, mesh.uvs)[mesh.uv_faces]
                for number in sorted(materials.image_uv_sets)
            ]
            uvs = np.concatenate([uvs, *sets], axis=2) * has_images[:, None, None]
        if materials.has_vertex_colors and mesh.colors is not None:
            colors = mesh.colors[mesh.faces].astype(np.float64)
        if mesh.tangents is not None and has_normals.any():
            tangents = mesh.tangents.astype(np.float64) * has_normals[ids][:, None, None]
        if of_any:
            tiles[:] = tiles.all()
        return cls(ids, uvs, colors, tangents, tiles[ids])


def _bends(source: ChannelSource | None) -> bool:
    return source is not None and source.image is not None


def _repeats(image: ChannelImage) -> bool:
    """Whether an image looks the same a whole number of texture coordinates away."""
    linear = np.array(image.placing)[:, :2]
    return image.wraps == ("repeat", "repeat") and bool((linear == np.rint(linear)).all())


class _Copies(NamedTuple):
    """Parts that are copies of one another, the largest first."""

    numbers: list[int]  # of their groups
    matrices: FloatArray  # (n, 4, 4); from the first to each


@dataclass(frozen=True, eq=False)
class RepeatedParts:
    """A mesh in which each part that has copies is an object of its own."""

    mesh: Mesh  # whose first groups are those of `source`
    source: Mesh
    nodes: IntArray  # group of `source` of each group of `mesh`
    copies: tuple[_Copies, ...]

    @classmethod
    def of(cls, mesh: Mesh, looks: Looks) -> RepeatedParts:
        """Find the copies in a mesh whose groups are its nodes."""
        part_of, _ = face_components(weld_vertices(mesh)[mesh.faces], mesh.n_vertices)
        order = np.argsort(part_of, kind="stable")
        alike: dict[bytes, list[IndexArray]] = {}
        for faces in np.split(order, np.flatnonzero(np.diff(part_of[order])) + 1):
            alike.setdefault(looks.materials[faces].tobytes(), []).append(faces)
        _, exponent = np.frexp(np.abs(mesh.positions).max(initial=0.0))
        points = np.ldexp(mesh.positions, -exponent)  # of moderate size
        found = []
        for parts in alike.values():
            if parts[1:]:
                listed = np.array(parts)
                kinds = _Parts.of(mesh, points, listed, looks).kinds()
                found += [(listed[chosen], matrices) for chosen, matrices in kinds]
        for _, matrices in found:
            matrices[:, :3, 3] = np.ldexp(matrices[:, :3, 3], exponent)
        return cls._apart(mesh, found)

    @classmethod
    def among(cls, mesh: Mesh, materials: Materials) -> RepeatedParts | None:
        """Return the copies in a mesh; None without any, or if its parts bend."""
        if mesh.deformation is not None:
            return None
        found = cls.of(one_group_a_node(mesh), Looks.of(mesh, materials))
        return found if found.copies else None

    @classmethod
    def instances(
        cls, mesh: Mesh, materials: Materials | None, rig: Rig | None
    ) -> RepeatedParts | None:
        """Return the objects that are the same in the spaces of their nodes; None without any."""
        ids = np.zeros(mesh.n_faces, np.int32) if materials is None else materials.face_materials
        kinds = [] if rig is None else instances(mesh, rig, ids)
        if rig is None or not kinds:
            return None
        mesh = one_group_a_node(mesh)
        found = []
        for kind in kinds:
            places = np.array([rig.objects[number].matrix for number in kind])
            matrices = pm.matmul(places, pm.inv(places[0]))
            found.append(_Copies(np.searchsorted(mesh.group_objects, kind).tolist(), matrices))
        nodes = np.arange(len(mesh.group_names), dtype=np.int32)
        return cls(mesh, mesh, nodes, tuple(found))

    @classmethod
    def _apart(cls, source: Mesh, found: Sequence[tuple[IndexArray, FloatArray]]) -> RepeatedParts:
        """Make groups of parts, given by the faces of each kind (n, k) and their matrices."""
        names, objects = source.group_names or (source.name,), source.group_objects
        groups = np.zeros(source.n_faces, np.int32)
        groups = groups if source.face_groups is None else source.face_groups.copy()
        nodes, copies = list(range(len(names))), []
        for parts, matrices in found:
            numbers = np.arange(len(nodes), len(nodes) + len(parts), dtype=np.int32)
            nodes += groups[parts[:, 0]].tolist()
            groups[parts] = numbers[:, None]
            copies.append(_Copies(numbers.tolist(), matrices))
        n_new = len(nodes) - len(names)
        first = max(objects, default=0) + 1
        mesh = source.replace(
            face_groups=groups,
            group_names=(*names, *(f"{names[n]} {i}" for i, n in enumerate(nodes[len(names) :]))),
            group_objects=(*(objects or (0,) * len(names)), *range(first, first + n_new)),
        )
        return cls(mesh, source, np.array(nodes, np.int32), tuple(copies))

    @property
    def n_shared(self) -> int:
        """Number of parts that share the texels of another."""
        return sum(len(each.numbers) - 1 for each in self.copies)

    @cached_property
    def is_first(self) -> BoolArray:
        """(F,) bool: faces of `mesh` without those of all but the first of each kind of part."""
        others = [number for each in self.copies for number in each.numbers[1:]]
        return ~np.isin(_groups(self.mesh), others)

    def left_in(self, low: Mesh) -> RepeatedParts:
        """Return only the kinds of parts that a simplified mesh still has."""
        counts = np.bincount(_groups(low), minlength=len(self.nodes))
        return replace(self, copies=tuple(e for e in self.copies if counts[e.numbers].any()))

    @property
    def counts(self) -> Int64Array:
        """(n,) int64: how many copies stand for each group of `mesh` in `is_first`."""
        counts = np.ones(len(self.nodes), np.int64)
        for each in self.copies:
            counts[each.numbers[0]] = len(each.numbers)
        return counts

    def restored(self, low: Mesh) -> tuple[Mesh, IndexArray]:
        """Return a mesh of one part of each kind with all copies, grouped as the source; and faces.

        The (n,) faces are those of `low`.
        """
        pieces = [
            (each.numbers[0], number, matrix)
            for each in self.left_in(low).copies
            for number, matrix in zip(*each, strict=True)
        ]
        whole, faces = self._placed(low, pieces)
        has_groups = self.source.face_groups is not None
        return whole.replace(
            face_groups=self.nodes[_groups(whole)] if has_groups else None,
            group_names=self.source.group_names if has_groups else (),
            group_objects=self.source.group_objects,
        ), faces

    def _placed(
        self, low: Mesh, pieces: Sequence[tuple[int, int, FloatArray]]
    ) -> tuple[Mesh, IndexArray]:
        """Join what has no copies and pieces: a group to take, one to put it in, and its matrix."""
        groups = _groups(low)
        repeated = [number for each in self.copies for number in each.numbers]
        rest = np.flatnonzero(~np.isin(groups, repeated))
        order = np.argsort(groups, kind="stable")
        numbers, starts = np.unique(groups[order], return_index=True)
        faces_of = dict(zip(numbers.tolist(), np.split(order, starts[1:]), strict=True))
        of_group = {take: faces_of[take] for take, *_ in pieces}
        of_parts = [rest, *(of_group[take] for take, *_ in pieces)]
        excerpts = {take: excerpt(low, faces) for take, faces in of_group.items()}
        parts = [self._bound_as(to, excerpts[take]) for take, to, _ in pieces]
        matrices = [matrix for *_, matrix in pieces]
        if len(rest):
            parts.insert(0, excerpt(low, rest))
            matrices.insert(0, np.eye(4))
        joined = join_parts(
            parts, low.name, np.array(matrices), groups=[("", i) for i in range(len(parts))]
        )
        put = [groups[rest], *(np.full(len(of_group[take]), to) for take, to, _ in pieces)]
        joined = joined.replace(
            face_groups=np.concatenate(put).astype(np.int32),
            group_names=self.mesh.group_names,
            group_objects=self.mesh.group_objects,
        )
        return joined, np.concatenate(of_parts)

    def _bound_as(self, group: int, part: Mesh) -> Mesh:
        """Return a part that moves as a rigid group of `mesh` does."""
        if self.mesh.deformation is None:
            return part
        vertex = self._first_vertices[group]
        bound = self.mesh.deformation.of(np.full(part.n_vertices, vertex))
        return part.replace(deformation=bound)

    @cached_property
    def _first_vertices(self) -> dict[int, int]:
        """A vertex of each group."""
        numbers, faces = np.unique(_groups(self.mesh), return_index=True)
        return dict(zip(numbers.tolist(), self.mesh.faces[faces, 0].tolist(), strict=True))


def _groups(mesh: Mesh) -> IntArray:
    return np.zeros(mesh.n_faces, np.int32) if mesh.face_groups is None else mesh.face_groups


@dataclass(frozen=True, eq=False)
class _Parts:
    """n parts of k faces, of the same materials in the same order."""

    mesh: Mesh
    looks: Looks
    faces: IndexArray  # (n, k)
    centers: FloatArray  # (n, 3)
    sizes: FloatArray  # (n,); greatest distances from the centers; 0 where there is no shape
    arms: FloatArray  # (n, k, 3, 3); of the corners, from the centers, over the sizes

    @classmethod
    def of(cls, mesh: Mesh, points: FloatArray, faces: IndexArray, looks: Looks) -> _Parts:
        """Measure parts in a mesh whose vertices lie at `points`, of moderate size."""
        arms = points[mesh.faces[faces]].reshape(len(faces), -1, 3)
        n_points = arms.shape[1]
        centers = pm.matmul(np.full((1, n_points), 1.0 / n_points), arms)[:, 0]
        arms -= centers[:, None]
        sizes = pm.norm(arms, axis=2).max(axis=1)
        arms /= np.where(sizes > 0.0, sizes, 1.0)[:, None, None]
        return cls(mesh, looks, faces, centers, sizes, arms.reshape(*faces.shape, 3, 3))

    def kinds(self) -> list[tuple[IndexArray, FloatArray]]:
        """Return numbers of parts that are copies of one another, largest first, with matrices."""
        keys, slack = self._keys()
        order = np.argsort(keys, axis=0, kind="stable")
        listed = np.take_along_axis(keys, order, axis=0)
        ends = [
            (np.searchsorted(row, row - step), np.searchsorted(row, row + step, "right"))
            for row, step in zip(listed.T, slack, strict=True)
        ]
        best = int(np.argmin([(stop - start).sum() for start, stop in ends]))
        order, (starts, stops) = order[:, best], ends[best]  # which leaves the fewest to compare
        rank, is_free, found = np.argsort(order, kind="stable"), self.sizes > 0.0, []
        for first in np.argsort(-self.sizes, kind="stable").tolist():
            if not is_free[first]:
                continue
            is_free[first] = False
            near = order[starts[rank[first]] : stops[rank[first]]]
            near = near[is_free[near] & (self.sizes[near] * _SIZES >= self.sizes[first])]
            near = near[(np.abs(keys[near] - keys[first]) <= slack).all(axis=1)]
            copies, matrices = [np.array([first])], [np.eye(4)[None]]
            for step in (1, -1):
                if len(near):
                    alike, ways = self._copies(first, np.sort(near), step)
                    is_free[alike] = False
                    near = near[is_free[near]]
                    copies.append(alike)
                    matrices.append(ways)
            if sum(map(len, copies)) > 1:
                found.append((np.concatenate(copies), np.concatenate(matrices)))
        return found

    def _keys(self) -> tuple[FloatArray, FloatArray]:
        """(n, m) numbers of each part that copies share, and (m,) by how much they may differ."""
        n_parts, n_faces = self.faces.shape
        rows = np.linspace(0, n_faces - 1, min(n_faces, _N_COMPARED)).astype(np.intp)
        chosen = self.faces[:, rows]
        arms = self.arms[:, rows]
        uvs, colors = (each[chosen, 1] for each in (self.looks.uvs, self.looks.colors))
        if self._has_tiles:
            uvs = np.abs(uvs - np.rint(uvs))
        # The middle corner stays in the middle, and the edge across from it across.
        columns = [
            (pm.norm(arms[:, :, 1], axis=2), _APART),
            (pm.norm(arms[:, :, 2] - arms[:, :, 0], axis=2), 2.0 * _APART),
            (uvs.reshape(n_parts, -1), 2.0 * _SAME),
            (colors.reshape(n_parts, -1), 2.0 * _SAME),
        ]
        slack = [np.full(column.shape[1], step) for column, step in columns]
        return np.concatenate([column for column, _ in columns], axis=1), np.concatenate(slack)

    @property
    def _has_tiles(self) -> bool:
        return bool(self.looks.has_tiles[self.faces[0]].all())

    def _copies(self, first: int, near: IndexArray, step: int) -> tuple[IndexArray, FloatArray]:
        """Return parts that are copies of a part, mirrored for `step` -1, and (n, 4, 4) motions."""

        def of_both(rows: AnyArray) -> tuple[AnyArray, AnyArray]:
            return rows[self.faces[first]], rows[self.faces[near]][:, :, ::step]

        (uvs, others), (colors, of_near) = map(of_both, (self.looks.uvs, self.looks.colors))
        others = others - uvs
        if self._has_tiles:
            others -= np.rint(others[:, :1, :1])
        near = near[(_most(others) <= _SAME) & (_most(of_near - colors) <= _SAME)]
        one = self.arms[first].reshape(-1, 3)
        arms = self.arms[near][:, :, ::step].reshape(len(near), *one.shape)
        far = int(pm.norm(one, axis=1).argmax())
        across = pm.norm(np.cross(one, one[far]), axis=1)
        wide = int(across.argmax())
        if across[wide] <= _APART:
            near, arms = near[:0], arms[:0]  # a line, which may be turned about itself
        ahead = _frames(arms[:, far], arms[:, wide], step)
        turns = pm.matmul(ahead, _frames(one[None, far], one[None, wide], 1).swapaxes(1, 2))
        scales = pm.norm(arms[:, far], axis=1) / pm.norm(one[far])
        moved = pm.matmul(one, turns.swapaxes(1, 2)) * scales[:, None, None]
        is_alike = pm.norm(moved - arms, axis=2).max(axis=1) <= _APART
        near, turns, scales = near[is_alike], turns[is_alike], scales[is_alike]
        maps = np.zeros((len(near), 4, 4))
        maps[:, :3, :3], maps[:, 3, 3] = turns, step
        is_alike = np.ones(len(near), np.bool_)
        if self.mesh.normals is not None and self.mesh.normal_faces is not None:
            normals = [self.mesh.normals[each] for each in of_both(self.mesh.normal_faces)]
            is_alike &= _are_turned(normals[0], normals[1], turns)
        if self.looks.tangents.shape[2]:
            is_alike &= _are_turned(*of_both(self.looks.tangents), maps)
        near, maps = near[is_alike], maps[is_alike]
        maps[:, :3, :3] *= (scales[is_alike] * self.sizes[near] / self.sizes[first])[:, None, None]
        maps[:, :3, 3] = self.centers[near] - pm.matvec(maps[:, :3, :3], self.centers[first])
        maps[:, 3, 3] = 1.0
        return near, maps


def _most(rows: AnyArray) -> FloatArray:
    return np.asarray(np.abs(rows).max(axis=(1, 2, 3), initial=0.0))


def _frames(far: FloatArray, wide: FloatArray, sign: int) -> FloatArray:
    """(n, 3, 3) orthonormal frames: the first axis along `far`, the second towards `wide`."""
    axes = _units(far)
    normals = _units(np.cross(axes, wide))
    return np.stack([axes, np.cross(normals, axes), sign * normals], axis=2)


def _are_turned(one: AnyArray, others: AnyArray, maps: FloatArray) -> BoolArray:
    """(n,) bool: whether maps (n, m, m) take directions (k, 3, m) to others (n, k, 3, m)."""
    moved = pm.matmul(_units(one).reshape(-1, one.shape[-1]), maps.swapaxes(1, 2))
    apart = pm.norm(moved - _units(others).reshape(moved.shape), axis=2)
    return np.asarray(apart.max(axis=1, initial=0.0) <= _TURNED)


def _units(vectors: AnyArray) -> FloatArray:
    lengths = pm.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0))
