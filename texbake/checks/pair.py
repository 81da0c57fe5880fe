"""Checks of a low-poly mesh against the high-poly mesh that it is baked from.

Distances are from the centers of faces to the closest point of the other mesh. Where half of the
low-poly mesh lies away from the high-poly mesh, one of them is scaled, rotated or moved. A place or
axes are accepted if the meshes then fit, and guessed from the bounding boxes where nothing fits.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import permutations, product

import numpy as np

from texbake.baking.texels import NO_FACE
from texbake.checks.checked_mesh import CheckedMesh, Finding
from texbake.checks.kinds import CheckOptions
from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mapping.options.shared import MAX_SIZE
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.triangle_tree import TriangleTree
from texbake.records import dataclass

# Shares of the size of the low-poly mesh. In pairs made from scans, the low-poly mesh lies within
# 0.3 % of the high-poly mesh on average and 1.3 % at most.
APART = 0.02  # a median distance at which the meshes do not fit together
_FAR = 0.03  # the distance of a single face

_MAX_MEASURED = 100_000  # faces of a mesh whose distance is measured
_MAX_TRIED = 2_000  # faces of a low-poly mesh that is rotated in all 24 ways
_MAX_FACES_PER_TEXEL = 4.0


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The closest points of another mesh to the centers of some faces."""

    faces: Int64Array  # (n,) int64; faces that were measured
    step: int  # one of every `step` faces was
    distances: FloatArray  # (n,) float64; distances, in the local frame
    others: IntArray  # (n,) int32; faces of the other mesh that have the closest points


class MeshPair:
    """A low-poly and a high-poly mesh in their common local frame."""

    def __init__(self, low: CheckedMesh, high: CheckedMesh) -> None:
        self.low = low
        self.high = high
        self.frame = LocalFrame.around(low.mesh, high.mesh)
        box, other = self.frame.to_local(low.mesh.bounds), self.frame.to_local(high.mesh.bounds)
        self.sides = box[1] - box[0], other[1] - other[0]
        self.middles = box.mean(axis=0), other.mean(axis=0)
        self.size = float(pm.norm(self.sides[0]))

    @classmethod
    def of(cls, high: Mesh, low: Mesh, *, threads: int | None = None) -> MeshPair:
        """Pair two meshes."""
        options = CheckOptions(threads=threads)
        return cls(CheckedMesh(low, "low", options), CheckedMesh(high, "high", options))

    @cached_property
    def from_low(self) -> ClosestPoints:
        """From the low-poly mesh to the high-poly mesh."""
        return self._nearest(self.low, self.high_tree)

    @cached_property
    def from_high(self) -> ClosestPoints:
        """From the high-poly mesh to the low-poly mesh."""
        return self._nearest(self.high, self._tree(self.low))

    @cached_property
    def high_tree(self) -> TriangleTree:
        """Tree of the high-poly mesh."""
        return self._tree(self.high)

    def _nearest(self, one: CheckedMesh, tree: TriangleTree) -> ClosestPoints:
        threads = one.options.threads
        step = -(-one.mesh.n_faces // _MAX_MEASURED)
        faces = np.arange(0, one.mesh.n_faces, step)
        distances, others, _ = tree.closest_points(self._centers(one, faces), threads=threads)
        return ClosestPoints(faces, step, distances, others)

    def _centers(self, one: CheckedMesh, faces: Int64Array) -> FloatArray:
        corners = self.frame.to_local(one.mesh.positions)[one.mesh.faces[faces]]
        return np.asarray(corners.mean(axis=1))

    def _tree(self, one: CheckedMesh) -> TriangleTree:
        return TriangleTree.build(
            self.frame.to_local(one.mesh.positions), one.mesh.faces, threads=one.options.threads
        )

    def fitting_rotation(self, scale: float = 1.0) -> FloatArray | None:
        """(3, 3) right-angled rotation of the scaled, centered low-poly mesh that fits, or None."""
        step = -(-self.low.mesh.n_faces // _MAX_TRIED)
        faces = np.arange(0, self.low.mesh.n_faces, step)
        arms = scale * (self._centers(self.low, faces) - self.middles[0])
        best, least = None, APART * self.size * scale
        for turn in _right_angle_rotations():
            points = pm.matmul(arms, turn.T) + self.middles[1]
            measured, *_ = self.high_tree.closest_points(points, threads=self.low.options.threads)
            median = float(np.median(measured))
            if median <= least:
                best, least = turn, median
                if np.trace(turn) == 3.0:
                    break
        return best

    def fits_scaled(self, scale: float) -> bool:
        """Whether the low-poly mesh fits once it is scaled, centered and rotated."""
        turn = self.fitting_rotation(scale)
        if turn is None:
            return False
        arms = self.frame.to_local(self.low.mesh.positions) - self.middles[0]
        positions = pm.matmul(scale * arms, turn.T) + self.middles[1]
        tree = TriangleTree.build(positions, self.low.mesh.faces, threads=self.low.options.threads)
        step = -(-self.high.mesh.n_faces // _MAX_TRIED)
        points = self._centers(self.high, np.arange(0, self.high.mesh.n_faces, step))
        distances_to_low, *_ = tree.closest_points(points, threads=self.low.options.threads)
        return float(np.median(distances_to_low)) <= APART * self.size * scale

    @property
    def ratio(self) -> float:
        """Size of the high-poly mesh over that of the low-poly mesh; inf where that is a point."""
        return float(pm.norm(self.sides[1])) / self.size if self.size > 0.0 else math.inf

    @cached_property
    def apart(self) -> bool:
        """Whether half of the low-poly mesh lies away from the high-poly mesh."""
        return float(np.median(self.from_low.distances)) > APART * self.size

    @cached_property
    def cosines(self) -> FloatArray:
        """(n,) float64: between the normals of low-poly faces and the high-poly surface."""
        nearest = self.from_low
        normals = self.low.normals[nearest.faces], self.high.normals[nearest.others]
        return np.asarray(pm.vecdot(*normals))

    @cached_property
    def opposite(self) -> bool:
        """Whether most of the low-poly mesh faces against the high-poly surface next to it."""
        step = -(-len(self.from_low.faces) // _MAX_TRIED)
        areas = self.low.areas[self.from_low.faces[::step]]
        return float(areas[self.lie_against(step)].sum()) > 0.5 * float(areas.sum())

    def lie_against(self, step: int) -> BoolArray:
        """(n,) bool: faces, one of every `step`, closer to a surface that faces against them."""
        faces = self.from_low.faces[::step]
        corners = self.frame.to_local(self.low.mesh.positions)[self.low.mesh.faces[faces]]
        points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        normals = np.repeat(self.low.normals[faces], 4, axis=0)
        limit = _FAR * self.size
        along, against = (
            self.high_tree.closest_points(
                points.reshape(-1, 3), facing=facing, max_distance=limit,
                threads=self.low.options.threads,
            )[0]
            for facing in (normals, -normals)
        )  # fmt: skip
        nearer = np.minimum(against, limit) - np.minimum(along, limit)
        sums = nearer.reshape(-1, 4).sum(axis=1)
        return np.asarray(np.where(sums == 0.0, self.cosines[::step] < 0.0, sums < 0.0))


def distances(pair: MeshPair) -> list[Finding | None]:
    """Faces of either mesh that lie far from the other."""
    results: list[Finding | None] = []
    for name, checked, nearest in (
        ("far-from-high", pair.low, pair.from_low),
        ("far-from-low", pair.high, pair.from_high),
    ):
        far = nearest.distances > _FAR * pair.size
        part = f" Only one of every {nearest.step} faces was measured." if nearest.step > 1 else ""
        results.append(
            checked.finding(
                name,
                far.sum(),
                nearest.faces[far],
                nearest.distances[far],
                percent=100.0 * _FAR,
                most=float(pair.frame.length_to_model(nearest.distances.max())),
                part=part,
            )
        )
    return results


def opposite_sides(pair: MeshPair) -> Finding | None:
    """Whether most of the low-poly mesh faces against the high-poly surface next to it."""
    if not pair.opposite:
        return None
    against = pair.lie_against(1)
    faces = pair.from_low.faces[against]
    return pair.low.finding("opposite-sides", len(faces), faces, -pair.cosines[against])


def high_is_coarser(pair: MeshPair) -> Finding | None:
    """Whether the high-poly mesh has fewer faces than the low-poly mesh."""
    high, low = pair.high.mesh.n_faces, pair.low.mesh.n_faces
    return pair.high.finding("high-is-coarser", int(high < low), high=high, low=low)


def detail_below_texels(pair: MeshPair, owners: IntArray) -> Finding | None:
    """Whether a texel is much larger than a face of the high-poly mesh."""
    options = pair.low.options
    n_texels = int(np.count_nonzero(owners != NO_FACE))
    if n_texels == 0:
        return None
    faces = pair.high.mesh.n_faces / n_texels
    side = max(options.width_px, options.height_px)
    wanted = side * math.sqrt(faces / _MAX_FACES_PER_TEXEL)
    size = min(1 << math.ceil(pm.log2(wanted)), MAX_SIZE) if faces > 1.0 else side
    return pair.high.finding(
        "detail-below-texels", int(faces > _MAX_FACES_PER_TEXEL), per_texel=faces, size=size
    )


def _right_angle_rotations() -> list[FloatArray]:
    """All 24 rotations that take axes to axes, (3, 3) each, the identity first."""
    rotations = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.diag(signs)[:, list(order)]
        if pm.det(turn) > 0.0:
            rotations.append(turn)
    return rotations


# The boxes of one object, at two levels of detail, differ by less than this.
_SAME_SCALE = 1.05
_SAME_SIDES = 0.05

# A low-poly mesh may be inflated or set off on purpose, for long rays. A bake goes on up to this
# scale and this distance of the centers, in sizes of the low-poly mesh.
_INFLATED = 2.2
_BESIDE = 0.5


def misalignment(pair: MeshPair) -> list[Finding | None]:
    """Why two meshes do not fit: their scale, then their axes, then their place."""
    if not pair.apart:
        return []
    sides, other_sides = pair.sides
    if not 1.0 / _SAME_SCALE < pair.ratio < _SAME_SCALE:
        return [pair.low.finding("differing-scale", 1, ratio=pair.ratio)]
    turn = pair.fitting_rotation()
    axes = _swapped_axes(sides, other_sides) if turn is None else _axes_of(turn)
    if axes:
        return [pair.low.finding("differing-axes", 1, axes=axes)]
    offset = pair.frame.length_to_model(pair.middles[1] - pair.middles[0])
    if float(pm.norm(pair.middles[1] - pair.middles[0])) <= APART * pair.size:
        return []
    words = ", ".join(f"{value:.6g}" for value in offset)
    distance = f"{float(pm.norm(offset)):.4g} model units"
    return [pair.low.finding("differing-place", 1, distance=distance, offset=f"({words})")]


def require_alignment(high: Mesh, low: Mesh, *, threads: int | None = None) -> None:
    """Raise where a low-poly mesh fits only once it is scaled, rotated or moved."""
    if min(high.n_faces, low.n_faces) == 0:
        return
    pair = MeshPair.of(high, low, threads=threads)
    if not pair.apart:
        return
    ratio = pair.ratio
    same = 1.0 / _SAME_SCALE < ratio < _SAME_SCALE
    if not math.isfinite(ratio) or not pair.fits_scaled(1.0 if same else ratio):
        return
    moved = float(pm.norm(pair.middles[1] - pair.middles[0])) / pair.size
    harmless = {
        "differing-scale": 1.0 / _INFLATED <= ratio <= _INFLATED,
        "differing-place": moved < _BESIDE,
    }
    for finding in misalignment(pair):
        if finding is not None and not harmless.get(finding.name):
            raise MeshError(_worded(pair, finding))


def explain_opposite_sides(pair: MeshPair) -> tuple[str, ...]:
    """Say in the words of `check` that two meshes face against each other, or nothing."""
    found = opposite_sides(pair)
    return () if found is None else (_worded(pair, found),)


def explain_misalignment(pair: MeshPair) -> tuple[str, ...]:
    """Say in the words of `check` whether two meshes are apart, or only some low-poly faces."""
    found = tuple(_worded(pair, finding) for finding in misalignment(pair) if finding is not None)
    if not found and (far := distances(pair)[0]) is not None:
        return (
            f"{pair.low.mesh.name}: {far.count:,} {far.kind.title}. {far.problem} {far.remedy}",
        )
    return found


def _worded(pair: MeshPair, finding: Finding) -> str:
    return f"{pair.low.mesh.name}: {finding.problem} {finding.remedy}"


def _axes_of(turn: FloatArray) -> str:
    """Which axes a rotation takes to which others, in words; "" for none."""
    moved = []
    for k, column in enumerate(turn.T):
        to = int(np.flatnonzero(column)[0])
        if to != k or column[to] < 0.0:
            moved.append(f"{'xyz'[k]} becomes {'-' if column[to] < 0.0 else ''}{'xyz'[to]}")
    return " and ".join(moved)


def _swapped_axes(low: FloatArray, high: FloatArray) -> str:
    """Which axes must be swapped for the sides of two boxes to agree, in words; "" for none."""
    limit = _SAME_SIDES * float(low.max())
    if (np.abs(low - high) <= limit).all():
        return ""
    for order in permutations(range(3)):
        if (np.abs(low[list(order)] - high) <= limit).all():
            moved = [f"{'xyz'[order[k]]} becomes {'xyz'[k]}" for k in range(3) if order[k] != k]
            return " and ".join(moved)
    return ""
