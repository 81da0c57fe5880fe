"""A patch of triangles flattened with as little distortion as possible and a free boundary.

A layout in a circle, without flips, is the start (Tutte's embedding, with holes filled by fans);
then the symmetric Dirichlet energy is minimized by Newton steps that stop short of the first flip.

Based on: Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015. It departs in
not keeping the boundary from crossing itself: `injective` says whether it does, and it is for the
caller to divide the patch then. The numerical methods are in `core/symmetric_dirichlet.c`,
`core/conjugate_gradient.c` and `core/tutte.c`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texbake.core import core
from texbake.mapping.atlas.flattening.patch import Patch, is_injective, patch_of
from texbake.mesh.mesh import FloatArray, IntArray

# Of layouts in the circle: first roughly, and if that has flips, as well as can be.
_CIRCLE_TOLERANCES = (1e-4, 1e-12)

# Least number of vertices in a region, and most halvings of the patch: 64 regions give a system of
# 192 unknowns, which takes about as long as ten iterations with 3,000 vertices.
_REGION_SIZE = 64
_MOST_HALVINGS = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """A flattened patch, with the area that it has in space and without flipped triangles.

    Attributes
    ----------
    uvs : (n, 2) float64
        Coordinates in the unit of the points, about the origin; 0 for unused vertices.
    l2 : float
        Stretch of the patch at this scale (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2,
        1 at best.
    energy : float
        Mean of the symmetric Dirichlet energy at this scale, 4 at best.
    injective : bool
        True if no two triangles overlap.
    """

    uvs: FloatArray
    l2: float
    energy: float
    injective: bool


def flatten(
    points: FloatArray,
    faces: IntArray,
    start: FloatArray | None = None,
    *,
    n_iterations: int = 50,
    accuracy: float = 1e-3,
    keep_apart: bool = False,
) -> Flat | None:
    """Flatten a patch with the least symmetric Dirichlet energy that its start leads to.

    Parameters
    ----------
    points : (n, 3) float64
        Positions of the vertices of the patch; some may be unused.
    faces : (m, 3) int32
        Triangles, all with the same winding.
    start : (n, 2) float64, optional
        A layout to start from, ignored if a triangle is flipped or has no area. The default start
        is a layout in a circle.
    n_iterations : int
        Largest number of Newton steps.
    accuracy : float
        The iteration stops after a step that gains less than this share of the energy above its
        minimum of 4, or less than a tenth of it absolutely. About as much again may be left to
        gain.
    keep_apart : bool
        Also stop each step before the boundary crosses itself. From an injective start, this leads
        to an injective layout, though seldom to the least energy.

    Returns
    -------
    Flat or None
        None if the patch is not an oriented surface. Without a usable start, also None if it is
        not connected, is closed, has a handle, or has vertices at which it only touches itself; or
        if it is so far from a disk that float64 cannot resolve its corners in the circle.
        Triangles with little or no area are flattened as slivers.

    Examples
    --------
    >>> bent = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1]], dtype=float)
    >>> flat = flatten(bent, np.array([[0, 1, 2], [0, 3, 1]], dtype=np.int32))
    >>> round(flat.energy, 6), round(flat.l2, 6), flat.injective
    (4.0, 1.0, True)
    """
    patch = patch_of(faces, len(points))
    if patch is None:
        return None
    points = np.ascontiguousarray(points, dtype=np.float64)
    gradients, areas = _rest_shapes(points, patch)
    if not areas.sum() > 0.0:
        return None
    uvs = _start_layout(points, patch, gradients, areas, start)
    if uvs is None:
        return None
    n_kept_apart = len(patch.boundary) if keep_apart else 0
    core.minimize_dirichlet(
        uvs,
        patch.faces,
        gradients,
        areas,
        patch.row_starts,
        patch.columns,
        patch.entries,
        patch.boundary[:n_kept_apart],
        patch.boundary_loops[:n_kept_apart],
        regions_of(uvs),
        n_iterations,
        accuracy,
    )
    return _finished(uvs, patch, gradients, areas)


def measured(points: FloatArray, faces: IntArray, uvs: FloatArray) -> Flat | None:
    """Move a layout to the origin, give it its area in space, and measure it as `flatten` does.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int32
    uvs : (n, 2) float64

    Returns
    -------
    Flat or None
        None if the patch is not an oriented surface, or a triangle is flipped or has no area.
    """
    patch = patch_of(faces, len(points))
    if patch is None:
        return None
    gradients, areas = _rest_shapes(np.ascontiguousarray(points, dtype=np.float64), patch)
    uvs = np.array(uvs, dtype=np.float64, order="C")
    if not math.isfinite(core.dirichlet_energy(uvs, patch.faces, gradients, areas)):
        return None
    return _finished(uvs, patch, gradients, areas)


def _rest_shapes(points: FloatArray, patch: Patch) -> tuple[FloatArray, FloatArray]:
    """Shapes of the triangles in space, for the kernels: (m, 3, 2) gradients and (m,) areas."""
    gradients, areas = np.empty((len(patch.faces), 3, 2)), np.empty(len(patch.faces))
    core.find_rest_shapes(points, patch.faces, gradients, areas)
    return gradients, areas


def _mean_stretches(
    uvs: FloatArray, patch: Patch, gradients: FloatArray, areas: FloatArray
) -> tuple[float, float, float]:
    """Means of σ1² + σ2², of σ1⁻² + σ2⁻², and of σ1 σ2, over a layout without flips."""
    means = np.empty(3)
    core.mean_stretches(uvs, patch.faces, gradients, areas, means)
    return float(means[0]), float(means[1]), float(means[2])


def _start_layout(
    points: FloatArray,
    patch: Patch,
    gradients: FloatArray,
    areas: FloatArray,
    start: FloatArray | None,
) -> FloatArray | None:
    """Return a layout without flips and of about the right size, in a new array."""
    if start is not None:
        uvs = np.array(start, dtype=np.float64, order="C")
        if math.isfinite(core.dirichlet_energy(uvs, patch.faces, gradients, areas)):
            return uvs
    if not patch.is_disk:
        return None
    for tolerance in _CIRCLE_TOLERANCES:
        circle = tutte_layout(points, patch, tolerance)
        if circle is None:
            return None
        if math.isfinite(core.dirichlet_energy(circle, patch.faces, gradients, areas)):
            # Scaled to the size of least energy.
            mean_dirichlet, mean_inverse, _ = _mean_stretches(circle, patch, gradients, areas)
            return np.asarray(circle * (mean_inverse / mean_dirichlet) ** 0.25)
    return None


def _finished(uvs: FloatArray, patch: Patch, gradients: FloatArray, areas: FloatArray) -> Flat:
    """Move and scale a layout, which is overwritten, and measure it."""
    used = np.diff(patch.row_starts) > 1
    uvs -= uvs[used].mean(axis=0)
    uvs[~used] = 0.0
    mean_dirichlet, mean_inverse, growth = _mean_stretches(uvs, patch, gradients, areas)
    uvs /= math.sqrt(growth)
    return Flat(
        uvs=uvs,
        l2=math.sqrt(mean_inverse * growth / 2.0),
        energy=mean_dirichlet / growth + mean_inverse * growth,
        injective=is_injective(uvs, patch),
    )


def tutte_layout(points: FloatArray, patch: Patch, tolerance: float = 1e-12) -> FloatArray | None:
    """Lay out a disk in the unit circle, without flips as far as float64 can resolve its corners.

    Parameters
    ----------
    points : (n, 3) float64
    patch : Patch
        A disk once its holes are filled: `is_disk` is true.
    tolerance : float
        Accuracy of the linear system. A patch that is nowhere far from its boundary has no flips
        even with a rough solution.

    Returns
    -------
    (n, 2) float64 or None
        None if a hole cannot be filled by a fan, because an edge across it already exists.
    """
    lengths = [_loop_lengths(points, loop) for loop in patch.loops]
    outer = int(np.argmax([length.sum() for length in lengths]))
    fans, centers = [patch.faces], [points]
    for index, loop in enumerate(patch.loops):
        if index != outer:
            center = np.full(len(loop), patch.n_vertices + len(fans) - 1, dtype=np.int32)
            fans.append(np.stack([np.roll(loop, -1), loop, center], axis=1).astype(np.int32))
            centers.append(points[loop].mean(axis=0, keepdims=True))
    filled = patch
    if len(fans) > 1:
        points = np.concatenate(centers)
        closed = patch_of(np.concatenate(fans), len(points))
        if closed is None:
            return None
        filled = closed
    angles = _circle_angles(lengths[outer])
    uvs = np.zeros((len(points), 2))
    circle = np.zeros(len(points), dtype=np.bool_)
    circle[patch.loops[outer]] = True
    uvs[patch.loops[outer]] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    core.embed_in_circle(
        points,
        filled.faces,
        filled.row_starts,
        filled.columns,
        filled.entries,
        circle,
        uvs,
        tolerance,
    )
    return np.ascontiguousarray(uvs[: patch.n_vertices])


def _loop_lengths(points: FloatArray, loop: IntArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1))


def _circle_angles(lengths: FloatArray) -> FloatArray:
    """Angle of each vertex of the loop: by edge lengths, with a tenth shared evenly."""
    total = float(lengths.sum())
    shares = lengths / total if total > 0.0 else np.zeros(len(lengths))
    shares = 0.9 * shares + 0.1 / len(lengths)
    shares /= shares.sum()
    return np.asarray(2.0 * math.pi * np.concatenate([[0.0], np.cumsum(shares[:-1])]))


def regions_of(uvs: FloatArray) -> IntArray:
    """Halve a layout and its parts, again and again, across their longer sides.

    Parameters
    ----------
    uvs : (n, 2) float64

    Returns
    -------
    (n,) int32
        Region of each vertex, from 0 without gaps; all 0 if the patch is too small for it to pay.
    """
    n = len(uvs)
    regions = np.zeros(n, dtype=np.int64)
    n_halvings = min(int(math.log2(max(n / _REGION_SIZE, 1.0))), _MOST_HALVINGS)
    for level in range(n_halvings):
        starts = np.arange(1 << level) * n // (1 << level)
        order = np.argsort(regions, kind="stable")
        by_region = uvs[order]
        extents = np.maximum.reduceat(by_region, starts) - np.minimum.reduceat(by_region, starts)
        axes = np.argmax(extents, axis=1)[regions]
        order = np.lexsort((uvs[np.arange(n), axes], regions))
        regions[order] = np.arange(n) * (2 << level) // n
    return regions.astype(np.int32)
