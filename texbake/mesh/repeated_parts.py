"""Parts of a mesh that are copies of one another: moved, turned, mirrored or scaled alike.

A part is what hangs together of an object. Copies have the same faces in the same order, as the
files of instances and of duplicated parts have them, and look alike: in their materials, texture
coordinates but for whole tiles, colors and normals. A mirrored copy has the corners of each face in
reverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mesh.compose import excerpt, join_parts, normal_map
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.objects import one_group_a_node, weld_vertices
from texbake.mesh.topology import face_components
from texbake.records import dataclass

# How far a point may lie from that of its copy, as a share of its part's greatest distance from the
# center; and differences of normals, and of texture coordinates and colors, that are rounding.
_APART, _TURNED, _SAME = 1e-3, 0.02, 2.0**-16
_SIZES = 2.0  # of a copy over the size of the first of its kind: others need other triangles
_MOST_TRIED = 8  # shapes of the same faces that a part is compared with


@dataclass(frozen=True, eq=False)
class Looks:
    """What faces look like, beside their shape."""

    materials: IntArray  # (F,); faces of different ones look different
    uvs: FloatArray  # (F, 3, 2m); of m sets
    colors: FloatArray  # (F, 3, c)

    @classmethod
    def of(cls, mesh: Mesh, materials: Materials) -> Looks:
        """Return what shows of a mesh: coordinates only where images lie on them."""
        of_any = bool(materials.variants)
        shown = np.array([of_any or bool(each.images) for each in materials.materials])
        has_images = shown[materials.face_materials][:, None, None]
        uvs, colors = np.zeros((2, mesh.n_faces, 3, 0))
        if mesh.uvs is not None and mesh.uv_faces is not None:
            sets = [
                materials.uv_sets.get(number, mesh.uvs)[mesh.uv_faces]
                for number in sorted(materials.image_uv_sets)
            ]
            uvs = np.concatenate([uvs, *sets], axis=2) * has_images
        if materials.has_vertex_colors and mesh.colors is not None:
            colors = mesh.colors[mesh.faces].astype(np.float64)
        return cls(materials.face_materials, uvs, colors)


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
        alike: dict[_Key, list[list[_Part]]] = {}
        for faces in np.split(order, np.flatnonzero(np.diff(part_of[order])) + 1):
            _add(alike, mesh, faces, looks)
        return cls._apart(mesh, [found for each in alike.values() for found in each if found[1:]])

    @classmethod
    def among(cls, mesh: Mesh, materials: Materials) -> RepeatedParts | None:
        """Return the copies in a mesh; None without any, or if its parts bend."""
        if mesh.deformation is not None:
            return None
        found = cls.of(one_group_a_node(mesh), Looks.of(mesh, materials))
        return found if found.copies else None

    @classmethod
    def _apart(cls, source: Mesh, found: list[list[_Part]]) -> RepeatedParts:
        names, objects = source.group_names or (source.name,), source.group_objects
        groups = np.zeros(source.n_faces, np.int32)
        groups = groups if source.face_groups is None else source.face_groups.copy()
        nodes, copies = list(range(len(names))), []
        for parts in found:
            numbers = list(range(len(nodes), len(nodes) + len(parts)))
            for number, part in zip(numbers, parts, strict=True):
                nodes.append(int(groups[part.faces[0]]))
                groups[part.faces] = number
            scales = [float(pm.norm(part.matrix[:3, 0])) for part in parts]
            by_size = np.argsort(-np.array(scales), kind="stable")
            matrices = np.array([parts[i].matrix for i in by_size])
            matrices = pm.matmul(matrices, pm.inv(matrices[0]))
            copies.append(_Copies([numbers[i] for i in by_size], matrices))
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

    @property
    def is_first(self) -> BoolArray:
        """(F,) bool: faces of `mesh` without those of all but the first of each kind of part."""
        others = [number for each in self.copies for number in each.numbers[1:]]
        return ~np.isin(_groups(self.mesh), others)

    def one_each(self, low: Mesh) -> Mesh:
        """Return a simplified mesh with one part of each kind, at the place of the first.

        It has the most triangles that one of them has, up to their mean.
        """
        counts = np.bincount(_groups(low), minlength=len(self.nodes))
        pieces = []
        for each in self.copies:
            of_each = counts[each.numbers]
            few = np.where(of_each <= of_each.mean(), of_each, 0)
            chosen = int(few.argmax())
            if few[chosen]:
                matrix = pm.inv(each.matrices[chosen])
                pieces.append((each.numbers[chosen], each.numbers[0], matrix))
        return self._placed(low, pieces)[0]

    def restored(self, low: Mesh, materials: Materials) -> tuple[Mesh, Materials]:
        """Return a mesh of one part of each kind with all copies, and the groups of the source."""
        pieces = [
            (each.numbers[0], number, matrix)
            for each in self.copies
            for number, matrix in zip(*each, strict=True)
        ]
        whole, faces = self._placed(low, pieces)
        materials = replace(materials, face_materials=materials.face_materials[faces])
        has_groups = self.source.face_groups is not None
        return whole.replace(
            face_groups=self.nodes[_groups(whole)] if has_groups else None,
            group_names=self.source.group_names if has_groups else (),
            group_objects=self.source.group_objects,
        ), materials

    def _placed(
        self, low: Mesh, pieces: Sequence[tuple[int, int, FloatArray]]
    ) -> tuple[Mesh, npt.NDArray[np.intp]]:
        """Join what has no copies and pieces: a group to take, one to put it in, and its matrix."""
        groups = _groups(low)
        repeated = [number for each in self.copies for number in each.numbers]
        rest = np.flatnonzero(~np.isin(groups, repeated))
        of_group = {take: np.flatnonzero(groups == take) for take in {take for take, *_ in pieces}}
        of_parts = [rest, *(of_group[take] for take, *_ in pieces)]
        excerpts = {take: excerpt(low, groups == take) for take in of_group}
        parts = [excerpts[take] for take, *_ in pieces]
        matrices = [matrix for *_, matrix in pieces]
        if len(rest):
            parts.insert(0, excerpt(low, np.isin(np.arange(low.n_faces), rest)))
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


class _Part(NamedTuple):
    """A part, and where it is from the first of its kind."""

    faces: npt.NDArray[np.intp]
    matrix: FloatArray  # (4, 4)
    step: int  # -1 for the corners of each face in reverse

    def at_corners(self, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """(n, 3, k) rows of its faces."""
        return np.asarray(rows[self.faces][:, :: self.step])


def _groups(mesh: Mesh) -> IntArray:
    return np.zeros(mesh.n_faces, np.int32) if mesh.face_groups is None else mesh.face_groups


def _add(
    alike: dict[_Key, list[list[_Part]]],
    mesh: Mesh,
    faces: npt.NDArray[np.intp],
    looks: Looks,
) -> None:
    """Add a part to those that it is a copy of, or as the first of its kind."""
    materials = bytes(looks.materials[faces].astype(np.int32))
    cell = _roundness(mesh.positions[mesh.faces[faces].ravel()])
    for near in (cell, cell - 1, cell + 1):
        for kind in alike.get((materials, near), [])[:_MOST_TRIED]:
            for step in (1, -1):
                part = _copy(mesh, kind[0], _Part(faces, np.eye(4), step), looks)
                if part is not None:
                    kind.append(part)
                    return
    first = _Part(faces, np.eye(4), 1)
    alike.setdefault((materials, cell), []).append([first])


_Key = tuple[bytes, int]  # materials of the faces, and how round a part is


def _roundness(points: FloatArray) -> int:
    """Mean distance from the center over the greatest, in steps that copies hardly differ by."""
    lengths = pm.norm(points - points.mean(axis=0), axis=1)
    return int(lengths.mean() / (float(lengths.max()) or 1.0) / (4.0 * _APART))


def _copy(mesh: Mesh, first: _Part, part: _Part, looks: Looks) -> _Part | None:
    """Return a part with its matrix if it is a copy of another in shape and look."""
    tiles, colors = (
        part.at_corners(rows) - first.at_corners(rows) for rows in (looks.uvs, looks.colors)
    )
    tiles -= np.rint(tiles[:1, :1])
    if max(np.abs(each).max(initial=0.0) for each in (tiles, colors)) > _SAME:
        return None
    both = first, part
    points = [mesh.positions[each.at_corners(mesh.faces).ravel()] for each in both]
    matrix = _motion(*points, is_mirrored=part.step < 0)
    if matrix is None or mesh.normals is None or mesh.normal_faces is None:
        return None if matrix is None else part._replace(matrix=matrix)
    normals = [mesh.normals[each.at_corners(mesh.normal_faces).ravel()] for each in both]
    turned = pm.matmul(normals[0], normal_map(matrix[:3, :3]).T)
    turned /= np.maximum(pm.norm(turned, axis=1, keepdims=True), 1e-300)
    is_alike = pm.norm(turned - normals[1], axis=1).max() <= _TURNED
    return part._replace(matrix=matrix) if is_alike else None


def _motion(one: FloatArray, other: FloatArray, *, is_mirrored: bool) -> FloatArray | None:
    """(4, 4) matrix that takes points to others; None if none does."""
    centers = [each.mean(axis=0) for each in (one, other)]
    arms = one - centers[0], other - centers[1]
    lengths = [pm.norm(each, axis=1) for each in arms]
    far = int(lengths[0].argmax())
    sizes = [float(each[far]) for each in lengths]
    across = pm.norm(np.cross(arms[0], arms[0][far]), axis=1)
    wide = int(across.argmax())
    if not sizes[0] <= _SIZES * sizes[1] <= _SIZES**2 * sizes[0]:
        return None
    if sizes[0] == 0.0 or across[wide] <= _APART * sizes[0] ** 2:
        return None  # a line, which may be turned about itself
    if np.abs(lengths[0] / sizes[0] - lengths[1] / sizes[1]).max() > _APART:
        return None
    frames = []
    for each, size, sign in zip(arms, sizes, (1.0, -1.0 if is_mirrored else 1.0), strict=True):
        axis = each[far] / size
        normal = np.cross(axis, each[wide])
        normal /= float(pm.norm(normal)) or 1.0
        frames.append(np.stack([axis, np.cross(normal, axis), sign * normal], axis=1))
    matrix = np.eye(4)
    matrix[:3, :3] = sizes[1] / sizes[0] * pm.matmul(frames[1], frames[0].T)
    matrix[:3, 3] = centers[1] - pm.matmul(matrix[:3, :3], centers[0][:, None])[:, 0]
    apart = pm.norm(pm.matmul(arms[0], matrix[:3, :3].T) - arms[1], axis=1)
    return matrix if apart.max() <= _APART * sizes[1] else None
