"""Why two meshes do not fit: one is scaled, rotated or moved against the other.

A place or axes are accepted if the meshes then fit, and guessed from the bounding boxes where
nothing fits.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from texbake.checks.finding import Finding
from texbake.checks.pair import APART, MeshPair, distances, opposite_sides
from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.mesh import FloatArray, Mesh

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
    size, other_size = float(pm.norm(sides)), float(pm.norm(other_sides))
    ratio = other_size / size if size > 0.0 else math.inf
    if not 1.0 / _SAME_SCALE < ratio < _SAME_SCALE:
        return [pair.low.finding("differing-scale", 1, ratio=ratio)]
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
    """Raise where a low-poly mesh fits the high-poly mesh only once it is scaled, rotated or moved.

    Other pairs that lie apart may be meant so: a plane and what stands before it, or a low-poly
    mesh that is inflated.
    """
    if min(high.n_faces, low.n_faces) == 0:
        return
    pair = MeshPair.of(high, low, threads=threads)
    if not pair.apart:
        return
    sides = [float(pm.norm(side)) for side in pair.sides]
    ratio = sides[1] / sides[0] if sides[0] > 0.0 else math.inf
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
    """Say in the words of `check` that two meshes face against each other; nothing if they do not.

    For bakes of which most rays missed.
    """
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
