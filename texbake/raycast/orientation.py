"""Which side of a surface is outside, part by part, and the mesh with its faces turned outwards.

The faces of a part, which edges of two faces connect, are first wound alike, as most of their area
is. Rays then leave both sides of sampled points of a part. Outside is the side from which more of
them get away from the whole mesh. A part that no ray leaves, such as the wall of a cavity, is
flipped if the part that its rays hit from their outer side is.

Based on: K. Takayama, A. Jacobson, L. Kavan, O. Sorkine-Hornung, "A Simple Method for Correcting
Facet Orientations in Polygon Meshes Based on Ray Casting", Journal of Computer Graphics Techniques
3(4), 2014.
"""

from __future__ import annotations

import itertools
import math
from functools import cached_property

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import counted
from texbake.mesh.compose import turned_over
from texbake.mesh.distance import face_areas, unit_normals
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.topology import (
    EdgeNeighbors,
    against_most,
    edge_neighbors,
    face_components,
    find_edges,
    two_sided_faces,
    wind_alike,
)
from texbake.mesh.weld import weld_rows
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.scene import RayScene
from texbake.records import dataclass

_SEED = 20140912
_LOOKS_ACROSS = 24  # parallel rays along either side of a view
_MOST_RAYS = 400_000  # from both sides of all parts together
_MOST_OF_PART, _LEAST_OF_PART = 512, 16  # points of one part
# A ray through triangles that overlap meets many of them. These bound all rays of a mesh together:
# the largest parts get theirs first, and parts that get none are unclear.
_RAYS_ALLOWED, _BOXES_ALLOWED = 1_000_000, 100_000_000
_FACES_LOOKED_AT = 50_000  # of all, evenly spread: the boxes that rays meet are estimated from them
# Rays start this far from the surface, in local units.
_OFFSET = 1e-6
# How many standard deviations of chance the votes for one side must be ahead.
_CLEAR = 3.0


@dataclass(frozen=True, kw_only=True)
class OrientationReport:
    """What `oriented` did."""

    mesh: str  # name of the mesh
    n_parts: int = 0  # parts that faced inwards as a whole, and faces that were flipped
    n_faces: int = 0
    n_unclear: int = 0  # parts that are seen alike from both sides, and were left as they are

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        notes = []
        if self.n_faces:
            notes.append(
                f"{self.mesh}: flipped {counted(self.n_faces, 'triangle')}, which faced inwards; "
                "`orientation` keep leaves them as they are"
            )
        if self.n_unclear:
            notes.append(
                f"{self.mesh}: left {counted(self.n_unclear, 'part')} as in the file, because "
                "which side is outside is not clear; look at the mesh, and flip faces if need be"
            )
        return tuple(notes)


def oriented(
    mesh: Mesh, orientation: str, *, keep_open: bool = False, threads: int | None = None
) -> tuple[Mesh, OrientationReport]:
    """Flip the parts of a mesh that face inwards; if `keep_open`, only shells without boundary."""
    if orientation == "keep" or mesh.n_faces == 0 or not mesh.diagonal > 0.0:
        return mesh, OrientationReport(mesh=mesh.name)
    scene = RayScene.build(mesh, LocalFrame.around(mesh), threads=threads)
    if not _is_seen_from_behind(scene):
        return mesh, OrientationReport(mesh=mesh.name)
    return oriented_in(mesh, scene, keep_open=keep_open)


def oriented_in(
    mesh: Mesh, scene: RayScene, *, keep_open: bool = False
) -> tuple[Mesh, OrientationReport]:
    """Flip the parts of a mesh that face inwards, using a scene of it that was built before."""
    welded = weld_rows(mesh.positions)[mesh.faces]
    pairs = edge_neighbors(welded)
    areas = face_areas(_centered(mesh), mesh.faces, threads=scene.threads)
    parts, turned = _parts_wound_alike(pairs, areas)
    n_parts = int(parts.max(initial=-1)) + 1
    points = _points(mesh, areas, parts, turned, n_parts)
    votes = _Votes.of(points, parts, n_parts, scene)
    one_sided = ~_two_sided(welded, pairs)
    if keep_open:
        one_sided &= ~_open_faces(welded, mesh.n_vertices)
    matters = np.bincount(parts, one_sided, n_parts) > 0.0
    inwards = votes.inwards() & matters
    unclear = ((votes.seen & ~votes.clear) | points.left_out) & matters
    turned = (turned ^ inwards[parts]) & ~unclear[parts] & one_sided
    counts = (int(np.count_nonzero(which)) for which in (inwards, turned, unclear))
    n_inwards, n_turned, n_unclear = counts
    report = OrientationReport(
        mesh=mesh.name, n_parts=n_inwards, n_faces=n_turned, n_unclear=n_unclear
    )
    return turned_over(mesh, turned), report


def _is_seen_from_behind(scene: RayScene) -> bool:
    """Whether any ray from all around a mesh meets it from behind first."""
    low, high = scene.frame.to_local(scene.mesh.bounds)
    middle, radius = (low + high) / 2.0, 0.5 * float(pm.norm(high - low))
    steps = (np.arange(_LOOKS_ACROSS) + 0.5) / _LOOKS_ACROSS * 2.0 - 1.0
    grid = radius * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    starts = [middle - 2.0 * radius * axes[2] + pm.matmul(grid, axes[:2]) for axes in _VIEWS]
    directions = np.repeat([axes[2] for axes in _VIEWS], len(grid), axis=0)
    hits = _cast(scene, np.concatenate(starts), directions, 4.0 * radius)
    # Without culling, what is met first is the hit, and `passed_back` says that it is a back face.
    return bool((hits.passed_back & (hits.faces != NO_HIT)).any())


def _open_faces(welded: IntArray, n_vertices: int) -> BoolArray:
    """(F,) bool: faces of shells that have a boundary."""
    shells, n_shells = face_components(welded, n_vertices)
    edges = find_edges(welded)
    at_boundary = np.zeros(n_vertices, dtype=np.bool_)
    at_boundary[edges.vertices[edges.boundary]] = True
    is_open = np.bincount(shells, at_boundary[welded].any(axis=1), n_shells) > 0.0
    return np.asarray(is_open[shells])


def _two_sided(welded: IntArray, pairs: EdgeNeighbors) -> BoolArray:
    """(F,) bool: faces that occur in both windings; such a pair shares all its edges."""
    sums = welded.sum(axis=1, dtype=np.int64)  # equal where the third vertex is
    alike = sums[pairs.first] == sums[pairs.second]
    maybe = np.zeros(len(welded), dtype=np.bool_)
    for some in (pairs.first[alike], pairs.second[alike], pairs.at_other_edges):
        maybe[some] = True
    maybe[maybe] = two_sided_faces(welded[maybe])
    return maybe


def _parts_wound_alike(pairs: EdgeNeighbors, areas: FloatArray) -> tuple[IntArray, BoolArray]:
    """(F,) parts by their first faces, and (F,) whether wound against most of their area."""
    roots, flips = wind_alike(len(areas), (pairs.first, pairs.second), pairs.agree)
    turned = against_most(roots, flips, areas)
    numbers = np.cumsum(roots == np.arange(len(roots)), dtype=np.int32) - np.int32(1)
    return numbers[roots], turned


@dataclass(frozen=True, eq=False)
class _Points:
    """Points of parts, in the local frame of the mesh's scene after `RayScene.frame`."""

    parts: IntArray
    positions: FloatArray
    normals: FloatArray
    left_out: BoolArray  # (n_parts,): parts that rays enough for all of them would have reached


def _points(
    mesh: Mesh, areas: FloatArray, parts: IntArray, turned: BoolArray, n_parts: int
) -> _Points:
    """Draw points of each part, evenly over its area."""
    order = np.argsort(parts, kind="stable")
    sums = np.concatenate([[0.0], np.cumsum(areas[order])])
    stops = np.searchsorted(parts[order], np.arange(n_parts), side="right")
    ends = sums[stops]
    begins = np.concatenate([[0.0], ends[:-1]])
    share = _MOST_RAYS // 2 * (ends - begins) / max(sums[-1], np.finfo(float).tiny)
    n_points = np.clip(share, _LEAST_OF_PART, _MOST_OF_PART).astype(np.int64)
    n_points[ends <= begins] = 0
    left_out = np.zeros(n_parts, dtype=np.bool_)
    allowed = points_allowed(mesh)
    if n_points.sum() > allowed:
        largest_first = np.argsort(begins - ends, kind="stable")
        left_out[largest_first[np.cumsum(n_points[largest_first]) > allowed]] = True
        left_out &= n_points > 0
    n_points[left_out] = 0
    of_points = np.repeat(np.arange(n_parts, dtype=np.int32), n_points)
    random = np.random.Generator(np.random.PCG64(_SEED))
    n = len(of_points)
    drawn = begins[of_points] + random.random(n) * (ends - begins)[of_points]
    rows = np.clip(np.searchsorted(sums, drawn, side="right") - 1, 0, len(order) - 1)
    faces = order[rows]
    positions = points_in(mesh, faces, random)
    normals = unit_normals(_centered(mesh), mesh.faces[faces])
    normals[turned[faces]] *= -1.0
    return _Points(of_points, positions, normals, left_out)


def points_in(mesh: Mesh, faces: IndexArray, random: np.random.Generator) -> FloatArray:
    """(n, 3) float64: a random point of each face, evenly spread over its area."""
    root, second = np.sqrt(random.random(len(faces))), random.random(len(faces))
    weights = np.stack([1.0 - root, root * (1.0 - second), root * second], axis=1)
    return np.asarray(pm.vecmat(weights, mesh.positions[mesh.faces[faces]]))


def cosine_directions(normals: FloatArray, random: np.random.Generator) -> FloatArray:
    """(n, 3) float64: a random direction about each normal, by the cosine of their angle."""
    n = len(normals)
    z, turn = random.uniform(-1.0, 1.0, n), random.uniform(0.0, 2.0 * math.pi, n)
    across = np.sqrt(1.0 - z * z)
    directions = normals + np.stack([across * pm.cos(turn), across * pm.sin(turn), z], axis=1)
    return np.asarray(directions / np.maximum(pm.norm(directions, axis=1, keepdims=True), 1e-300))


def cast_from(
    scene: RayScene, origins: FloatArray, normals: FloatArray, directions: FloatArray
) -> RayHits:
    """Cast rays from points of a surface in the scene's frame, off it on the side of normals."""
    return _cast(scene, origins + _OFFSET * normals, directions, 2.0 * math.sqrt(3.0))


def points_allowed(mesh: Mesh) -> float:
    """Points of all parts together, from the boxes that a ray through the mesh meets."""
    step = max(1, mesh.n_faces // _FACES_LOOKED_AT)
    corners = mesh.positions[mesh.faces[::step]] / max(mesh.diagonal, 1e-300)
    x, y, z = (corners.max(axis=1) - corners.min(axis=1)).T
    low, high = mesh.bounds / max(mesh.diagonal, 1e-300)
    width, height, depth = high - low
    whole = width * height + height * depth + depth * width
    n_boxes = step * float((x * y + y * z + z * x).sum()) / max(whole, 1e-300)
    return float(min(_RAYS_ALLOWED, _BOXES_ALLOWED / max(n_boxes, 1.0)) / 2.0)


@dataclass(frozen=True, eq=False)
class _Votes:
    """What rays from both sides of each part have met."""

    # in_front, behind: (n_parts,) int; rays that got away.
    in_front: IntArray
    behind: IntArray
    hits: IntArray  # (m, 2) int; part that a ray left, and other part that it hit

    @classmethod
    def of(cls, points: _Points, parts: IntArray, n_parts: int, scene: RayScene) -> _Votes:
        """Cast the rays."""
        random = np.random.Generator(np.random.PCG64(_SEED + 1))
        directions = cosine_directions(points.normals, random)
        origins = scene.frame.to_local(points.positions)
        escapes, met = [], []
        for side in (1.0, -1.0):
            hits = cast_from(scene, origins, side * points.normals, side * directions)
            away = hits.faces == NO_HIT
            escapes.append(np.bincount(points.parts[away], minlength=n_parts).astype(np.int32))
            met.append(np.stack([points.parts[~away], parts[hits.faces[~away]]], axis=1))
        pairs = np.concatenate(met)
        return cls(escapes[0], escapes[1], pairs[pairs[:, 0] != pairs[:, 1]])

    @cached_property
    def seen(self) -> BoolArray:
        """(n_parts,) bool: parts from which rays get away."""
        return np.asarray(self.in_front + self.behind > 0)

    @property
    def clear(self) -> BoolArray:
        """(n_parts,) bool: parts of which one side is outside beyond chance."""
        ahead = np.abs(self.in_front - self.behind)
        return np.asarray(self.seen & (ahead > _CLEAR * np.sqrt(self.in_front + self.behind)))

    def inwards(self) -> BoolArray:
        """(n_parts,) bool: parts to flip; a hidden one is as the seen one that it lies within."""
        inwards: BoolArray = self.clear & (self.behind > self.in_front)
        most_hit = self._most_hit_parts()
        for part in np.setdiff1d(self.hits[:, 0], np.flatnonzero(self.seen)).tolist():
            around, visited = part, {part}
            while not self.seen[around]:
                around = most_hit.get(around, around)
                if around in visited:
                    break
                visited.add(around)
            inwards[part] = inwards[around]
        return inwards

    def _most_hit_parts(self) -> dict[int, int]:
        """For each part, the other one that its rays hit most; of equals, the first."""
        n_parts = len(self.in_front)
        keys = self.hits[:, 0].astype(np.int64) * n_parts + self.hits[:, 1]
        keys, counts = np.unique(keys, return_counts=True)
        parts, others = np.divmod(keys, n_parts)
        order = np.lexsort((-others, counts))
        return dict(zip(parts[order].tolist(), others[order].tolist(), strict=True))


def _views() -> list[FloatArray]:
    """Axes of the views from the sides and the corners of a cube: right, up, ahead."""
    views = []
    for ahead in itertools.product((-1.0, 0.0, 1.0), repeat=3):
        if np.count_nonzero(ahead) in (1, 3):
            z = np.array(ahead) / pm.norm(ahead)
            x = np.cross(z, (0.6, 0.48, 0.64))  # not along any of them
            x /= pm.norm(x)
            views.append(np.stack([x, np.cross(z, x), z]))
    return views


_VIEWS = _views()


def _centered(mesh: Mesh) -> FloatArray:
    """(V, 3) float64: positions from the middle of the mesh, in units of its size."""
    return np.asarray((mesh.positions - mesh.bounds.mean(axis=0)) / max(mesh.diagonal, 1e-300))


def _cast(scene: RayScene, origins: FloatArray, directions: FloatArray, length: float) -> RayHits:
    """Cast rays that stop at back faces too."""
    n = len(origins)
    rays = Rays(origins, directions, np.full(n, length), np.zeros(n))
    return scene.cast(rays, cull_back_faces=False)
