"""A patch of triangles laid flat with as little distortion as can be, its boundary free.

What is minimized is the symmetric Dirichlet energy, by Newton's method with the part of the
Hessian that curves upward. Steps stop short of the first flip, so that the layout has none from
its start, which is Tutte's or one that is given, to its end.

Based on: Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015; Teran, Sifakis,
Irving, Fedkiw, "Robust Quasistatic Finite Elements and Flesh Simulation", 2005 (projected Newton
with conjugate gradients). It departs from the first in not keeping the boundary from crossing
itself: such a layout is told from others, and it is for the caller to take the patch apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.atlas.flattening.conjugate_gradient import regions_of, solve_blocks
from texbake.mapping.atlas.flattening.injectivity import CROSSING, boundary_meeting, is_injective
from texbake.mapping.atlas.flattening.patch import Patch, patch_of
from texbake.mapping.atlas.flattening.symmetric_dirichlet import (
    energy_of,
    longest_step,
    model_at,
    rest_shapes,
    stretch_of,
)
from texbake.mapping.atlas.flattening.tutte import tutte_layout
from texbake.mesh.mesh import FloatArray, IntArray

# Newton's systems are solved until the residual is this share of the right side: a step of full
# precision gains little more, and takes several times as long.
_TOLERANCE = 0.1

# Of layouts in the circle: first roughly, and if that has flips, as well as can be.
_CIRCLE_TOLERANCES = (1e-4, 1e-12)

# Distortion, as a share of the energy, that is slight: gains are compared with no less.
_SLIGHT = 0.025


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """A patch laid flat, with the area that it has in space; no triangle of it is flipped.

    Attributes
    ----------
    uvs : (n, 2) float64
        Coordinates, in the unit of the points, about the origin; 0 for a vertex of no triangle.
    l2 : float
        Stretch of the patch at this scale (Sander et al. 2001): √ of the mean of (Γ² + γ²) / 2,
        1 at best.
    energy : float
        Mean of the symmetric Dirichlet energy at this scale, 4 at best.
    injective : bool
        Whether no two triangles overlap.
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
    """Lay a patch flat with the least symmetric Dirichlet energy that its start leads to.

    Parameters
    ----------
    points : (n, 3) float64
        Positions of the vertices of the patch; those of no triangle are allowed.
    faces : (m, 3) int32
        Triangles, all with one winding.
    start : (n, 2) float64, optional
        A layout to start from; not used where it has a flipped triangle or one without area.
        Without one, the patch is laid out in a circle first.
    n_iterations : int
        Steps of Newton's method at most.
    accuracy : float
        The last step is the one that takes less than this share of the energy above its minimum
        of 4, or less than a tenth of it absolutely. About as much again may be left to gain.
    keep_apart : bool
        Whether a step also stops short of where the boundary crosses itself. From an injective
        start, this leads to an injective layout, though seldom to one of least energy.

    Returns
    -------
    Flat or None
        None for a patch that is no oriented surface, and, if no start is of use, for one that is
        not in one piece, is closed, has a handle, or vertices at which it only touches itself; or
        that is so far from a disk that float64 cannot tell its corners apart in the circle.
        Triangles without area, or next to none, are laid out as slivers.

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
    points = np.array(points, dtype=np.float64, order="C")  # writable: one signature of the kernels
    gradients, areas = rest_shapes(points, patch.faces)
    if not areas.sum() > 0.0:
        return None
    uvs = _start_layout(points, patch, gradients, areas, start)
    if uvs is None:
        return None
    _minimize_kernel(
        uvs,
        patch.faces,
        gradients,
        areas,
        patch.row_starts,
        patch.columns,
        patch.entries,
        patch.boundary if keep_apart else patch.boundary[:0],
        patch.boundary_loops,
        regions_of(uvs),
        n_iterations,
        accuracy,
    )
    return _finished(uvs, patch, gradients, areas)


def measured(points: FloatArray, faces: IntArray, uvs: FloatArray) -> Flat | None:
    """Measure a layout as `flatten` does: moved to the origin, and with its area in space.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int32
    uvs : (n, 2) float64

    Returns
    -------
    Flat or None
        None for what is no oriented surface, and for a layout with a flipped triangle or one
        without area.
    """
    patch = patch_of(faces, len(points))
    if patch is None:
        return None
    gradients, areas = rest_shapes(np.array(points, dtype=np.float64, order="C"), patch.faces)
    uvs = np.array(uvs, dtype=np.float64, order="C")
    if not math.isfinite(energy_of(uvs, patch.faces, gradients, areas)):
        return None
    return _finished(uvs, patch, gradients, areas)


def _start_layout(
    points: FloatArray,
    patch: Patch,
    gradients: FloatArray,
    areas: FloatArray,
    start: FloatArray | None,
) -> FloatArray | None:
    """Return a layout without flips, of about the right size, in an array of its own."""
    if start is not None:
        uvs = np.array(start, dtype=np.float64, order="C")
        if math.isfinite(energy_of(uvs, patch.faces, gradients, areas)):
            return uvs
    if not patch.is_disk:
        return None
    for tolerance in _CIRCLE_TOLERANCES:
        circle = tutte_layout(points, patch, tolerance)
        if circle is None:
            return None
        if math.isfinite(energy_of(circle, patch.faces, gradients, areas)):
            # Of all sizes, the one with the least energy.
            mean_dirichlet, mean_inverse, _ = stretch_of(circle, patch.faces, gradients, areas)
            return np.asarray(circle * (mean_inverse / mean_dirichlet) ** 0.25)
    return None


def _finished(uvs: FloatArray, patch: Patch, gradients: FloatArray, areas: FloatArray) -> Flat:
    """Move and scale a layout, which is overwritten, and measure it."""
    used = np.diff(patch.row_starts) > 1
    uvs -= uvs[used].mean(axis=0)
    uvs[~used] = 0.0
    mean_dirichlet, mean_inverse, growth = stretch_of(uvs, patch.faces, gradients, areas)
    uvs /= math.sqrt(growth)
    return Flat(
        uvs=uvs,
        l2=math.sqrt(mean_inverse * growth / 2.0),
        energy=mean_dirichlet / growth + mean_inverse * growth,
        injective=is_injective(uvs, patch),
    )


@kernel
def _minimize_kernel(  # type: ignore[no-untyped-def]
    uvs,
    faces,
    gradients,
    areas,
    row_starts,
    columns,
    entries,
    boundary,
    loops,
    regions,
    n_iterations,
    accuracy,
):
    """Write the layout of least energy to `uvs`, which has no flips; return the steps it took.

    Edges of `boundary` do not cross in any layout on the way.
    """
    n = len(uvs)
    descent, steps, tried = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
    blocks = np.empty((len(columns), 4))
    energy, least = energy_of(uvs, faces, gradients, areas), 0.0
    for face in range(len(areas)):
        least += 4.0 * areas[face]
    for iteration in range(n_iterations):
        model_at(uvs, faces, gradients, areas, entries, descent, blocks)
        solve_blocks(row_starts, columns, blocks, descent, uvs, regions, steps, _TOLERANCE, 1000)
        downhill = 0.0
        for i in range(n):
            downhill += descent[i, 0] * steps[i, 0] + descent[i, 1] * steps[i, 1]
        if not downhill > 0.0:
            return iteration
        step = min(1.0, 0.9 * longest_step(uvs, steps, faces))
        before = energy
        while True:
            for i in range(n):
                tried[i, 0] = uvs[i, 0] + step * steps[i, 0]
                tried[i, 1] = uvs[i, 1] + step * steps[i, 1]
            energy = energy_of(tried, faces, gradients, areas)
            if energy <= before - 1e-4 * step * downhill and (
                len(boundary) == 0 or boundary_meeting(tried, boundary, loops) != CROSSING
            ):
                break
            step *= 0.5
            if step < 1e-10:
                return iteration
        for i in range(n):
            uvs[i, 0], uvs[i, 1] = tried[i, 0], tried[i, 1]
        if before - energy <= accuracy * (energy - least + _SLIGHT * least):
            return iteration + 1
    return n_iterations
