"""Parts of a model, enlarged before it is simplified, so that small ones keep their share of faces.

The quadric error of a part grows with the fourth power of its size, while what shows in pictures
grows with the square: small parts would become coarse long before large ones. Parts are scaled by a
root of how small they are, so that what shows is about the same for all.

Parts that are copies of one another are simplified once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.decals import Decals
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.options import MIN_FACES
from texbake.mesh.repeated_parts import RepeatedParts
from texbake.mesh.simplify import SimplifyReport, measured_to
from texbake.mesh.topology import face_components
from texbake.records import dataclass

# Power of the size of the model over that of a part. With a quarter, outlines would move alike in
# theory. Pictures of models of many parts differed little with 0, 0.25, 0.35 and 0.5.
_ROOT = 1.0 / 3.0
_STEP = 1.25  # parts are enlarged by a power of this
_MOST_STEPS = 32
# Share of a number of faces that copies shall have together, and how often that is tried.
_ENOUGH, _MOST_TRIES = 0.97, 5
_More = TypeVar("_More")


@dataclass(frozen=True, eq=False)
class EnlargedParts:
    """A mesh whose parts are enlarged, those of one scale at a place of their own."""

    mesh: Mesh
    source: Mesh
    center: FloatArray  # (3,)
    width: float  # of a place along x; 0 where nothing is enlarged
    threads: int | None = None

    @classmethod
    def of(cls, mesh: Mesh, *, threads: int | None = None) -> EnlargedParts:
        """Enlarge the small connected parts of objects of a mesh, unless something bends it."""
        low, high = mesh.bounds
        center = (low + high) / 2.0
        steps = _steps(mesh, weld_vertices(mesh, threads=threads))
        if mesh.deformation is not None or not steps.any():
            return cls(mesh, mesh, center, 0.0, threads)
        # All of a mesh that is enlarged to the most lies within a quarter of this from its place.
        width = 4.0 * float((high - low).max()) * float(_scales(steps).max())
        moved = (mesh.positions - center) * _scales(steps)
        moved[:, 0] += steps * width
        return cls(mesh.replace(positions=moved), mesh, center, width, threads)

    @cached_property
    def _decals(self) -> Decals:
        return Decals(self.source, self.threads)

    def restored(self, low: Mesh) -> Mesh:
        """Bring what was made of the mesh back to size and place, with decals above the rest."""
        if self.width:
            moved = low.positions.copy()
            steps = np.rint(moved[:, 0] / self.width)
            moved[:, 0] -= steps * self.width
            moved = moved / _scales(steps.astype(np.int64)) + self.center
            low = low.replace(positions=moved)
        return self._decals.raised(low)


def simplified_once(
    repeated: RepeatedParts,
    n_faces: int,
    make: Callable[[int], tuple[Mesh, SimplifyReport, _More]],
    *,
    threads: int | None = None,
) -> tuple[Mesh, SimplifyReport, _More]:
    """Simplify one part of each kind, so that all copies together have `n_faces` faces.

    `make` simplifies the parts in `repeated.is_first` to a number of faces. The report is of all
    copies.
    """
    most, best = int(repeated.is_first.sum()), None
    n, before = n_faces * most // repeated.mesh.n_faces, (0, 0)
    for _ in range(_MOST_TRIES):
        n = max(min(n, most), MIN_FACES)
        if n == before[0]:
            break
        low, report, more = make(n)
        groups = np.zeros(1, np.int32) if low.face_groups is None else low.face_groups
        placed = int(repeated.counts[groups].sum())
        rank = placed > n_faces, abs(placed - n_faces)
        if best is None or rank < best[0]:
            best = rank, low, replace(report, n_faces=placed, n_faces_asked=n_faces), more
        if _ENOUGH * n_faces <= placed <= n_faces or not report.is_close_to_count:
            break
        step = (n_faces - placed) * (n - before[0]) // ((placed - before[1]) or 1)
        before, n = (n, placed), n + step  # as if each face more gave as many copies as the last
    assert best is not None
    _, low, report, more = best
    whole, _ = repeated.restored(low)
    report = replace(report, n_vertices=whole.n_vertices)
    return low, measured_to(report, repeated.mesh, whole, threads=threads), more


def _scales(steps: Int64Array) -> FloatArray:
    """(n, 1) float64 factors of powers of `_STEP`."""
    factors = [1.0]
    for _ in range(_MOST_STEPS):
        factors.append(factors[-1] * _STEP)
    return np.array(factors)[steps][:, np.newaxis]


def _steps(mesh: Mesh, places: IntArray) -> Int64Array:
    """(V,) int64: power of `_STEP` that the part of each vertex is enlarged by."""
    corners = places[mesh.faces]
    part_of, n = face_components(corners, mesh.n_vertices)
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    for corner in range(3):
        np.minimum.at(low, part_of, mesh.positions[mesh.faces[:, corner]])
        np.maximum.at(high, part_of, mesh.positions[mesh.faces[:, corner]])
    extents = high.max(axis=0) - low.min(axis=0)
    unit = float(extents.max()) or 1.0  # so that no square leaves the range of float64
    diagonal, sizes = float(pm.norm(extents / unit)), pm.norm((high - low) / unit, axis=1)
    times = np.maximum(diagonal / np.where(sizes > 0.0, sizes, diagonal or 1.0), 1.0)
    powers = np.rint(_ROOT / pm.log(_STEP) * pm.log(times)).astype(np.int64)
    steps = np.zeros(mesh.n_vertices, np.int64)
    steps[corners] = np.clip(powers, 0, _MOST_STEPS)[part_of][:, np.newaxis]
    return np.asarray(steps[places])
