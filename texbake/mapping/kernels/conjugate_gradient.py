"""Conjugate gradients for sparse symmetric systems of 2 x 2 blocks.

The unknowns are the movements of the vertices of a flat patch. The preconditioner adds two
corrections: one for each vertex, the inverse of its diagonal block; and one for whole regions of
the patch, each moved and rotated as a rigid body, from a small dense system. The first alone does
not see errors that change slowly over the patch, and takes more iterations the finer the patch is.

Based on: Hestenes, Stiefel, "Methods of Conjugate Gradients for Solving Linear Systems", 1952;
Vaněk, Mandel, Brezina, "Algebraic Multigrid by Smoothed Aggregation for Second and Fourth Order
Elliptic Problems", 1996 (rigid bodies as a coarse space; here on two levels, without the smoothing,
and added).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

# Added to the dense system, as a share of its diagonal. Without it the system is singular, because
# the patch as a whole is free to move.
_RIDGE = 1e-9


@kernel
def solve_blocks(  # type: ignore[no-untyped-def]
    row_starts, columns, blocks, target, uvs, regions, solution, tolerance, n_iterations
):
    """Solve A x = b for a symmetric matrix of 2 x 2 blocks in at most `n_iterations`.

    A may be singular if b lies in its range.

    Parameters
    ----------
    row_starts, columns
        As in `Patch`: the first entry of a row lies on the diagonal.
    blocks : (k, 4) float64
        The rows of each entry's block. Where a diagonal block is 0, its unknown is left alone.
    target : (n, 2) float64
    uvs : (n, 2) float64
        Current positions of the vertices that x moves.
    regions : (n,) int32
        From `regions_of`; with a single region there is no second correction.
    solution : (n, 2) float64
        Overwritten.
    tolerance : float
        Residual at which to stop, as a share of `target`; the preconditioner measures both.

    Returns
    -------
    int
        Number of iterations.
    """
    n = len(row_starts) - 1
    inverses, bodies, factor = _preconditioner(row_starts, columns, blocks, uvs, regions)
    residual, direction, product = np.empty((n, 2)), np.zeros((n, 2)), np.empty((n, 2))
    better, coarse = np.empty((n, 2)), np.empty(len(factor))
    for i in range(n):
        residual[i, 0], residual[i, 1] = target[i, 0], target[i, 1]
        solution[i, 0] = solution[i, 1] = 0.0
    size, before = 0.0, 1.0
    for iteration in range(n_iterations):
        rho = _precondition(inverses, bodies, factor, regions, residual, coarse, better)
        if iteration == 0:
            size = rho
        if rho <= tolerance * tolerance * size:
            return iteration
        ratio = rho / before if iteration > 0 else 0.0
        for i in range(n):
            direction[i, 0] = better[i, 0] + ratio * direction[i, 0]
            direction[i, 1] = better[i, 1] + ratio * direction[i, 1]
        curvature = 0.0
        for i in range(n):
            x, y = 0.0, 0.0
            for at in range(row_starts[i], row_starts[i + 1]):
                j = columns[at]
                x += blocks[at, 0] * direction[j, 0] + blocks[at, 1] * direction[j, 1]
                y += blocks[at, 2] * direction[j, 0] + blocks[at, 3] * direction[j, 1]
            product[i, 0], product[i, 1] = x, y
            curvature += direction[i, 0] * x + direction[i, 1] * y
        if not curvature > 0.0:
            return iteration
        step, before = rho / curvature, rho
        for i in range(n):
            solution[i, 0] += step * direction[i, 0]
            solution[i, 1] += step * direction[i, 1]
            residual[i, 0] -= step * product[i, 0]
            residual[i, 1] -= step * product[i, 1]
    return n_iterations


@kernel
def _preconditioner(row_starts, columns, blocks, uvs, regions):  # type: ignore[no-untyped-def]
    """Inverses of diagonal blocks, vertices relative to their regions, and the dense factor."""
    n = len(row_starts) - 1
    inverses = np.empty((n, 3))
    n_regions = 0
    for i in range(n):
        n_regions = max(n_regions, regions[i] + 1)
        block = blocks[row_starts[i]]
        a, b, c = block[0], 0.5 * (block[1] + block[2]), block[3]
        determinant = a * c - b * b
        if determinant > 1e-14 * a * c:
            inverses[i, 0], inverses[i, 1] = c / determinant, -b / determinant
            inverses[i, 2] = a / determinant
        else:  # also for a vertex without entries
            inverses[i, 0] = 1.0 / a if a > 0.0 else 0.0
            inverses[i, 1] = 0.0
            inverses[i, 2] = 1.0 / c if c > 0.0 else 0.0
    bodies = np.zeros((n, 2))
    if n_regions < 2:
        return inverses, bodies, np.empty((0, 0))
    means = np.zeros((n_regions, 3))
    for i in range(n):
        means[regions[i], 0] += uvs[i, 0]
        means[regions[i], 1] += uvs[i, 1]
        means[regions[i], 2] += 1.0
    spread = 0.0
    for i in range(n):
        region = regions[i]
        bodies[i, 0] = uvs[i, 0] - means[region, 0] / means[region, 2]
        bodies[i, 1] = uvs[i, 1] - means[region, 1] / means[region, 2]
        spread += (bodies[i, 0] ** 2 + bodies[i, 1] ** 2) / n
    spread = math.sqrt(spread) if spread > 0.0 else 1.0
    factor = np.zeros((3 * n_regions, 3 * n_regions))
    for i in range(n):
        bodies[i, 0] /= spread
        bodies[i, 1] /= spread
    for i in range(n):
        row, xi, yi = 3 * regions[i], bodies[i, 0], bodies[i, 1]
        for at in range(row_starts[i], row_starts[i + 1]):
            j = columns[at]
            column, xj, yj = 3 * regions[j], bodies[j, 0], bodies[j, 1]
            if column > row:
                continue
            a, b, c, d = blocks[at, 0], blocks[at, 1], blocks[at, 2], blocks[at, 3]
            # Movements of i and j along both axes, and a rotation (-y, x).
            turned_x, turned_y = b * xj - a * yj, d * xj - c * yj
            factor[row, column] += a
            factor[row, column + 1] += b
            factor[row, column + 2] += turned_x
            factor[row + 1, column] += c
            factor[row + 1, column + 1] += d
            factor[row + 1, column + 2] += turned_y
            factor[row + 2, column] += c * xi - a * yi
            factor[row + 2, column + 1] += d * xi - b * yi
            factor[row + 2, column + 2] += turned_y * xi - turned_x * yi
    _factorize(factor)
    return inverses, bodies, factor


@kernel
def _factorize(matrix):  # type: ignore[no-untyped-def]
    """Overwrite the lower triangle with its Cholesky factor; the diagonal is stored inverted."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            if i == j:
                total += _RIDGE * total
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if j < i:
                matrix[i, j] = total * matrix[j, j]
            else:  # a region without entries does not move
                matrix[i, i] = 1.0 / math.sqrt(total) if total > 0.0 else 0.0


@kernel
def _precondition(inverses, bodies, factor, regions, residual, coarse, better):  # type: ignore[no-untyped-def]
    """Write M r to `better`, and return r · M r."""
    size = len(factor)
    for row in range(size):
        coarse[row] = 0.0
    if size > 0:
        for i in range(len(residual)):
            row, x, y = 3 * regions[i], residual[i, 0], residual[i, 1]
            coarse[row] += x
            coarse[row + 1] += y
            coarse[row + 2] += bodies[i, 0] * y - bodies[i, 1] * x
    for row in range(size):
        total = coarse[row]
        for column in range(row):
            total -= factor[row, column] * coarse[column]
        coarse[row] = total * factor[row, row]
    for row in range(size - 1, -1, -1):
        coarse[row] *= factor[row, row]
        for column in range(row):
            coarse[column] -= factor[row, column] * coarse[row]
    rho = 0.0
    for i in range(len(residual)):
        x, y = residual[i, 0], residual[i, 1]
        u = inverses[i, 0] * x + inverses[i, 1] * y
        v = inverses[i, 1] * x + inverses[i, 2] * y
        if size > 0:
            row = 3 * regions[i]
            u += coarse[row] - coarse[row + 2] * bodies[i, 1]
            v += coarse[row + 1] + coarse[row + 2] * bodies[i, 0]
        better[i, 0], better[i, 1] = u, v
        rho += x * u + y * v
    return rho
