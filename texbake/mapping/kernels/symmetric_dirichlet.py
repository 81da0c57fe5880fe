"""The symmetric Dirichlet energy of a flat patch, and its minimum by projected Newton steps.

Let J be the Jacobian that takes a triangle from its shape in space to the plane, and σ1 ≥ σ2 > 0
its singular values. The energy is the sum of A (σ1² + σ2² + σ1⁻² + σ2⁻²) over the triangles, with A
their areas in space. It is 4 A where lengths are kept, and infinite where a triangle flips. Newton
steps use the part of the Hessian that curves upward, and stop short of the first flip.

Based on: Smith, Schaefer, "Bijective Parameterization with Free Boundaries", 2015 (the energy, and
the longest step without a flip); Smith, de Goes, Kim, "Analytic Eigensystems for Isotropic
Distortion Energies", 2019 (the four eigenvalues of a triangle's Hessian, of which only that of a
rotation can be negative); Teran, Sifakis, Irving, Fedkiw, "Robust Quasistatic Finite Elements and
Flesh Simulation", 2005 (projected Newton steps solved by conjugate gradients).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mapping.kernels.conjugate_gradient import solve_blocks
from texbake.mapping.kernels.planar_overlap import CROSSING, boundary_meeting

# Newton systems are solved until the residual is this share of the right side. A step of full
# precision gains little more and takes several times as long.
_TOLERANCE = 0.1

# A slight distortion, as a share of the energy: gains are never compared with less than this.
_SLIGHT = 0.025

# Least height of a triangle as a share of its longest edge, and least length of that edge as a
# share of the mean. A flatter or smaller triangle is flattened as if it had these, since its own
# shape is lost in rounding and would dominate the energy.
_LEAST_HEIGHT = 1e-5
_LEAST_LENGTH = 1e-5


@kernel
def rest_shapes(points, faces):  # type: ignore[no-untyped-def]
    """Gradients of the three hat functions in the plane of each triangle, and its area.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int32

    Returns
    -------
    gradients : (m, 3, 2) float64
        J = Σ u_k ⊗ gradients[k] with the flat corners u_k. Triangles without height or length get
        a little of it.
    areas : (m,) float64
        Areas of the triangles, after thin ones have been widened.
    """
    m = len(faces)
    gradients, areas = np.empty((m, 3, 2)), np.empty(m)
    mean = 0.0
    for face in range(m):
        for i in range(3):
            mean += math.sqrt(_edge_square(points, faces, face, i)) / (3 * m)
    for face in range(m):
        base, longest = 0, -1.0
        for i in range(3):
            square = _edge_square(points, faces, face, i)
            if square > longest:
                base, longest = i, square
        longest = math.sqrt(longest)
        i, j, k = base, (base + 1) % 3, (base + 2) % 3
        a, b, c = faces[face, i], faces[face, j], faces[face, k]
        along = 0.0
        for axis in range(3):
            along += (points[c, axis] - points[a, axis]) * (points[b, axis] - points[a, axis])
        length = max(longest, _LEAST_LENGTH * mean)
        along = along / longest if longest > 0.0 else 0.5 * length
        height = 0.0
        if longest > 0.0:
            for axis in range(3):
                off = points[c, axis] - points[a, axis]
                off -= along * (points[b, axis] - points[a, axis]) / longest
                height += off * off
        height = max(math.sqrt(height), _LEAST_HEIGHT * length)
        areas[face] = 0.5 * length * height
        gradients[face, j, 0], gradients[face, j, 1] = 1.0 / length, -along / (length * height)
        gradients[face, k, 0], gradients[face, k, 1] = 0.0, 1.0 / height
        gradients[face, i, 0] = -1.0 / length
        gradients[face, i, 1] = along / (length * height) - 1.0 / height
    return gradients, areas


@kernel
def _edge_square(points, faces, face, i):  # type: ignore[no-untyped-def]
    """Squared length of the edge from corner i to the next."""
    a, b = faces[face, i], faces[face, (i + 1) % 3]
    x, y, z = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    return x * x + y * y + z * z


@kernel
def energy_of(uvs, faces, gradients, areas):  # type: ignore[no-untyped-def]
    """Total energy; infinite where a triangle is flipped or has no area."""
    total = 0.0
    for face in range(len(faces)):
        j00, j01, j10, j11 = _jacobian(uvs, faces, gradients, face)
        determinant = j00 * j11 - j01 * j10
        if not determinant > 0.0:
            return np.inf
        square = j00 * j00 + j01 * j01 + j10 * j10 + j11 * j11
        total += areas[face] * (square + square / (determinant * determinant))
    return total


@kernel
def stretch_of(uvs, faces, gradients, areas):  # type: ignore[no-untyped-def]
    """Means of σ1² + σ2², of σ1⁻² + σ2⁻², and of σ1 σ2, over a layout without flips."""
    dirichlet, inverse, flat, total = 0.0, 0.0, 0.0, 0.0
    for face in range(len(faces)):
        j00, j01, j10, j11 = _jacobian(uvs, faces, gradients, face)
        determinant = j00 * j11 - j01 * j10
        square = j00 * j00 + j01 * j01 + j10 * j10 + j11 * j11
        dirichlet += areas[face] * square
        inverse += areas[face] * square / (determinant * determinant)
        flat += areas[face] * determinant
        total += areas[face]
    return dirichlet / total, inverse / total, flat / total


@kernel
def model_at(uvs, faces, gradients, areas, entries, descent, blocks):  # type: ignore[no-untyped-def]
    """Write the negative gradient of the energy and a positive Hessian; no triangle is flipped.

    In the basis of the singular vectors the Hessian of a triangle has the eigenvalues f''(σ1) and
    f''(σ2) for its two stretches, and (f'(σ1) ∓ f'(σ2)) / (σ1 ∓ σ2) for shear and turn, where
    f(σ) = σ² + σ⁻². A negative one, of a turn, is left out.

    Parameters
    ----------
    descent : (n, 2) float64
        Overwritten.
    blocks : (k, 4) float64
        Of the entries of a `Patch`; overwritten.
    """
    for i in range(len(descent)):
        descent[i, 0] = descent[i, 1] = 0.0
    for at in range(len(blocks)):
        blocks[at, 0] = blocks[at, 1] = blocks[at, 2] = blocks[at, 3] = 0.0
    alpha, beta = np.empty(3), np.empty(3)
    for face in range(len(faces)):
        j00, j01, j10, j11 = _jacobian(uvs, faces, gradients, face)
        determinant = j00 * j11 - j01 * j10
        square = j00 * j00 + j01 * j01 + j10 * j10 + j11 * j11
        # f(J) = |J|² + |J|² / det², of which the slope is 2 J (1 + det⁻²) - 2 |J|² det⁻³ cof J.
        keep = 2.0 * areas[face] * (1.0 + 1.0 / (determinant * determinant))
        turn = -2.0 * areas[face] * square / (determinant * determinant * determinant)
        p00, p01 = keep * j00 + turn * j11, keep * j01 - turn * j10
        p10, p11 = keep * j10 - turn * j01, keep * j11 + turn * j00

        # J = U diag(σ) Vᵀ; U and V are rotations by half of (difference ± sum) of two angles.
        total = math.hypot(j00 + j11, j10 - j01)
        spread = math.hypot(j00 - j11, j10 + j01)
        first = 0.5 * (total + spread)
        second = determinant / first
        minus, plus = math.atan2(j10 - j01, j00 + j11), math.atan2(j10 + j01, j00 - j11)
        cu, su = math.cos(0.5 * (plus + minus)), math.sin(0.5 * (plus + minus))
        cv, sv = math.cos(0.5 * (plus - minus)), math.sin(0.5 * (plus - minus))
        stretch_1 = areas[face] * (2.0 + 6.0 / first**4)
        stretch_2 = areas[face] * (2.0 + 6.0 / second**4)
        shear = areas[face] * (2.0 + 2.0 * (square + determinant) / determinant**3)
        twist = areas[face] * (2.0 - 2.0 * (square - determinant) / determinant**3)
        twist = max(twist, 0.0)
        same, other = 0.5 * (shear + twist), 0.5 * (shear - twist)
        for i in range(3):
            g0, g1 = gradients[face, i, 0], gradients[face, i, 1]
            alpha[i], beta[i] = cv * g0 + sv * g1, cv * g1 - sv * g0
            vertex = faces[face, i]
            descent[vertex, 0] -= p00 * g0 + p01 * g1
            descent[vertex, 1] -= p10 * g0 + p11 * g1
        for i in range(3):
            for j in range(3):
                # The block in the basis U, rotated back.
                a = stretch_1 * alpha[i] * alpha[j] + same * beta[i] * beta[j]
                b, c = other * beta[i] * alpha[j], other * alpha[i] * beta[j]
                d = stretch_2 * beta[i] * beta[j] + same * alpha[i] * alpha[j]
                at = entries[face, i, j]
                # U [[a, b], [c, d]] Uᵀ with U = [[cu, -su], [su, cu]]
                e, f = cu * a - su * c, cu * b - su * d
                g, h = su * a + cu * c, su * b + cu * d
                blocks[at, 0] += e * cu - f * su
                blocks[at, 1] += e * su + f * cu
                blocks[at, 2] += g * cu - h * su
                blocks[at, 3] += g * su + h * cu


@kernel
def longest_step(uvs, steps, faces):  # type: ignore[no-untyped-def]
    """Largest t up to which every triangle of uvs + t steps keeps a positive area; may be infinite.

    The area of a triangle is a quadratic function of t, positive at 0.
    """
    longest = np.inf
    for face in range(len(faces)):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay = uvs[j, 0] - uvs[i, 0], uvs[j, 1] - uvs[i, 1]
        bx, by = uvs[k, 0] - uvs[i, 0], uvs[k, 1] - uvs[i, 1]
        px, py = steps[j, 0] - steps[i, 0], steps[j, 1] - steps[i, 1]
        qx, qy = steps[k, 0] - steps[i, 0], steps[k, 1] - steps[i, 1]
        c = ax * by - ay * bx
        b = ax * qy - ay * qx + px * by - py * bx
        a = px * qy - py * qx
        # The least positive root of a t² + b t + c, in the form that does not cancel for b < 0.
        discriminant = b * b - 4.0 * a * c
        if discriminant < 0.0:
            continue
        root = math.sqrt(discriminant)
        if b < 0.0:
            longest = min(longest, 2.0 * c / (root - b))
        elif a < 0.0:
            longest = min(longest, -(b + root) / (2.0 * a))
    return longest


@kernel
def _jacobian(uvs, faces, gradients, face):  # type: ignore[no-untyped-def]
    j00, j01, j10, j11 = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        vertex = faces[face, i]
        j00 += uvs[vertex, 0] * gradients[face, i, 0]
        j01 += uvs[vertex, 0] * gradients[face, i, 1]
        j10 += uvs[vertex, 1] * gradients[face, i, 0]
        j11 += uvs[vertex, 1] * gradients[face, i, 1]
    return j00, j01, j10, j11


@kernel
def minimize_kernel(  # type: ignore[no-untyped-def]
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
    """Minimize the energy from a layout without flips, in place; return the number of steps.

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
