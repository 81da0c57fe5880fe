"""What is wrong between a light mesh and the dense one that it is baked from.

Distances are from the middles of faces to the closest point of the other mesh. Where half of the
light mesh lies apart from the dense one, the cause is looked for: another scale, place or axis. A
place or axes are believed if the meshes then fit, and guessed from their boxes where nothing fits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations, product

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import NO_FACE
from texbake.checks.finding import Finding, found
from texbake.checks.subject import Subject
from texbake.checks.texels import Owners
from texbake.mapping.options.texture import MAX_SIZE
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.triangle_tree import TriangleTree

# Of the size of the light mesh. The light meshes of scans that were looked at lie within 0.3 % of
# the dense ones in the mean and 1.3 % at most.
_APART = 0.02  # in the median: the meshes do not fit together
_FAR = 0.03  # of one face
# Two boxes of one object, one of them of a coarser mesh, differ by less than this.
_SAME_SCALE = 1.05
_SAME_SIDES = 0.05
_MOST_FACES = 100_000  # of a mesh whose distance is measured
_MOST_TRIED = 2_000  # of a light mesh that is turned every way
_MOST_FACES_A_TEXEL = 4.0


@dataclass(frozen=True, eq=False)
class Nearest:
    """The closest point of another mesh to the middles of some faces.

    Attributes
    ----------
    faces : (n,) int64
        Faces looked at.
    step : int
        One in so many faces is.
    distances : (n,) float64
        In the local frame.
    others : (n,) int32
        Face of the other mesh.
    """

    faces: npt.NDArray[np.int64]
    step: int
    distances: FloatArray
    others: IntArray


class Pair:
    """A light and a dense mesh in their common local frame."""

    def __init__(self, light: Subject, dense: Subject) -> None:
        self.light = light
        self.dense = dense
        self.frame = LocalFrame.around(light.mesh, dense.mesh)
        low, high = self.frame.to_local(light.mesh.bounds), self.frame.to_local(dense.mesh.bounds)
        self.sides = low[1] - low[0], high[1] - high[0]
        self.middles = low.mean(axis=0), high.mean(axis=0)
        self.size = float(np.linalg.norm(self.sides[0]))

    @cached_property
    def from_light(self) -> Nearest:
        """From the light mesh to the dense one."""
        return self._nearest(self.light, self.dense)

    @cached_property
    def from_dense(self) -> Nearest:
        """From the dense mesh to the light one."""
        return self._nearest(self.dense, self.light)

    def _nearest(self, one: Subject, other: Subject) -> Nearest:
        threads = one.options.threads
        step = -(-one.mesh.n_faces // _MOST_FACES)
        faces = np.arange(0, one.mesh.n_faces, step)
        distances, others, _ = self._tree(other).closest_points(
            self._centers(one, faces), threads=threads
        )
        return Nearest(faces, step, distances, others)

    def _centers(self, one: Subject, faces: npt.NDArray[np.int64]) -> FloatArray:
        corners = self.frame.to_local(one.mesh.positions)[one.mesh.faces[faces]]
        return np.asarray(corners.mean(axis=1))

    def _tree(self, one: Subject) -> TriangleTree:
        return TriangleTree.build(
            self.frame.to_local(one.mesh.positions), one.mesh.faces, threads=one.options.threads
        )

    def fitting_turn(self) -> FloatArray | None:
        """Turn by right angles after which the light mesh, its middle moved, fits the dense one.

        Returns
        -------
        (3, 3) float64 or None
            The identity if it fits unturned, else the one that fits best; None where none does.
        """
        step = -(-self.light.mesh.n_faces // _MOST_TRIED)
        faces = np.arange(0, self.light.mesh.n_faces, step)
        arms = self._centers(self.light, faces) - self.middles[0]
        tree = self._tree(self.dense)
        best, least = None, _APART * self.size
        for turn in _right_turns():
            points = arms @ turn.T + self.middles[1]
            found_distances, *_ = tree.closest_points(points, threads=self.light.options.threads)
            median = float(np.median(found_distances))
            if median <= least:
                best, least = turn, median
                if np.trace(turn) == 3.0:
                    break
        return best

    @cached_property
    def apart(self) -> bool:
        """Whether half of the light mesh lies apart from the dense one."""
        return float(np.median(self.from_light.distances)) > _APART * self.size

    @cached_property
    def cosines(self) -> FloatArray:
        """(n,) float64: between the normals of light faces looked at and of the dense surface."""
        nearest = self.from_light
        normals = self.light.normals[nearest.faces], self.dense.normals[nearest.others]
        return np.asarray(np.einsum("ij,ij->i", *normals))

    @cached_property
    def opposite(self) -> bool:
        """Whether most of the light mesh faces against the dense surface next to it."""
        areas = self.light.areas[self.from_light.faces]
        return float(areas[self.cosines < 0.0].sum()) > 0.5 * float(areas.sum())


def misfit(pair: Pair) -> list[Finding | None]:
    """Find out why two meshes lie apart: scale, then axes, then place."""
    if not pair.apart:
        return []
    low, high = pair.sides
    size, other_size = float(np.linalg.norm(low)), float(np.linalg.norm(high))
    ratio = other_size / size if size > 0.0 else math.inf
    if not 1.0 / _SAME_SCALE < ratio < _SAME_SCALE:
        return [found("differing-scale", "light", 1, ratio=ratio)]
    turn = pair.fitting_turn()
    axes = _swapped_axes(low, high) if turn is None else _axes_of(turn)
    if axes:
        return [found("differing-axes", "light", 1, axes=axes)]
    offset = pair.frame.length_to_model(pair.middles[1] - pair.middles[0])
    way = float(np.linalg.norm(offset))
    if float(np.linalg.norm(pair.middles[1] - pair.middles[0])) <= _APART * pair.size:
        return []
    words = ", ".join(f"{value:.6g}" for value in offset)
    return [found("differing-place", "light", 1, way=f"{way:.4g} model units", offset=f"({words})")]


def _right_turns() -> list[FloatArray]:
    """All 24 turns that take axes to axes, (3, 3) each, the identity first."""
    found_turns = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.diag(signs)[:, list(order)]
        if np.linalg.det(turn) > 0.0:
            found_turns.append(turn)
    return found_turns


def _axes_of(turn: FloatArray) -> str:
    """Which axes a turn takes to which others; none for ""."""
    moved = []
    for k, column in enumerate(turn.T):
        to = int(np.flatnonzero(column)[0])
        if to != k or column[to] < 0.0:
            moved.append(f"{'xyz'[k]} becomes {'-' if column[to] < 0.0 else ''}{'xyz'[to]}")
    return " and ".join(moved)


def _swapped_axes(low: FloatArray, high: FloatArray) -> str:
    """Which axes have to change places for the sides of two boxes to agree; none for "" ."""
    limit = _SAME_SIDES * float(low.max())
    if (np.abs(low - high) <= limit).all():
        return ""
    for order in permutations(range(3)):
        if (np.abs(low[list(order)] - high) <= limit).all():
            moved = [f"{'xyz'[order[k]]} becomes {'xyz'[k]}" for k in range(3) if order[k] != k]
            return " and ".join(moved)
    return ""


def distances(pair: Pair) -> list[Finding | None]:
    """Find faces of either mesh that lie far from the other."""
    results: list[Finding | None] = []
    for name, role, nearest in (
        ("far-from-dense", "light", pair.from_light),
        ("far-from-light", "dense", pair.from_dense),
    ):
        far = nearest.distances > _FAR * pair.size
        part = f" One face in {nearest.step} was looked at." if nearest.step > 1 else ""
        most = float(pair.frame.length_to_model(nearest.distances.max()))
        results.append(
            found(
                name,
                role,
                far.sum(),
                nearest.faces[far],
                nearest.distances[far],
                percent=100.0 * _FAR,
                most=most,
                part=part,
            )
        )
    return results


def opposite_sides(pair: Pair) -> Finding | None:
    """Find out whether most of the light mesh faces against the dense surface next to it."""
    against = pair.cosines < 0.0
    faces = pair.from_light.faces[against]
    count = len(faces) if pair.opposite else 0
    return found("opposite-sides", "light", count, faces, -pair.cosines[against])


def dense_is_coarser(pair: Pair) -> Finding | None:
    """Find out whether the dense mesh has fewer faces than the light one."""
    dense, light = pair.dense.mesh.n_faces, pair.light.mesh.n_faces
    return found("dense-is-coarser", "dense", int(dense < light), dense=dense, light=light)


def detail_below_texels(pair: Pair, owners: Owners) -> Finding | None:
    """Find out whether a texel is much larger than a face of the dense mesh."""
    options = pair.light.options
    n_texels = int(np.count_nonzero(owners != NO_FACE))
    if n_texels == 0:
        return None
    faces = pair.dense.mesh.n_faces / n_texels
    side = max(options.width_px, options.height_px)
    wanted = side * math.sqrt(faces / _MOST_FACES_A_TEXEL)
    size = min(1 << math.ceil(math.log2(wanted)), MAX_SIZE) if faces > 1.0 else side
    return found(
        "detail-below-texels", "dense", int(faces > _MOST_FACES_A_TEXEL), per_texel=faces, size=size
    )


def pair_findings(pair: Pair, owners: Owners | None) -> list[Finding | None]:
    """Everything of this module; what needs the meshes to fit together only where they do."""
    results = [dense_is_coarser(pair), *misfit(pair)]
    if not any(finding and finding.severity == "error" for finding in results):
        results += [*distances(pair), opposite_sides(pair)]
    if owners is not None:
        results.append(detail_below_texels(pair, owners))
    return results
