"""Block systems, against dense ones."""

import numpy as np
import pytest

from texbake.mapping.atlas.flattening.conjugate_gradient import regions_of, solve_blocks


def grid_system(n, *, held):
    """Springs of random directions along the edges of a grid, and with `held` to the ground."""
    rng = np.random.default_rng(n)
    places = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) * 1.0
    blocks = {(i, i): np.eye(2) * held for i in range(n * n)}
    for i in range(n * n):
        for j in ([i + 1] if (i + 1) % n else []) + ([i + n] if i + n < n * n else []):
            root = rng.normal(size=(2, 2))
            spring = root @ root.T + 0.1 * np.eye(2)
            blocks[i, i] = blocks[i, i] + spring
            blocks[j, j] = blocks[j, j] + spring
            blocks[i, j] = blocks[j, i] = -spring
    rows = sorted(blocks, key=lambda key: (key[0], key[1] != key[0], key[1]))
    row_starts = np.searchsorted([row for row, _ in rows], np.arange(n * n + 1)).astype(np.int32)
    columns = np.array([column for _, column in rows], dtype=np.int32)
    values = np.array([blocks[key].ravel() for key in rows])
    dense = np.zeros((n * n, 2, n * n, 2))
    for i, j in rows:
        dense[i, :, j] = blocks[i, j]
    return places, row_starts, columns, values, dense.reshape(2 * n * n, -1)


def solved(system, target, regions, tolerance):
    places, row_starts, columns, values, _ = system
    solution = np.full_like(target, np.nan)
    n_iterations = solve_blocks(
        row_starts, columns, values, target, places, regions, solution, tolerance, 5000
    )
    return solution, n_iterations


@pytest.mark.parametrize("in_regions", [False, True])
def test_against_a_dense_solver(in_regions):
    system = grid_system(14, held=0.1)
    target = np.random.default_rng(0).normal(size=(196, 2))
    regions = regions_of(system[0]) if in_regions else np.zeros(196, dtype=np.int32)
    assert regions.max() == in_regions  # two, for 196 vertices
    solution, _ = solved(system, target, regions, 1e-12)
    expected = np.linalg.solve(system[4], target.ravel())
    np.testing.assert_allclose(solution.ravel(), expected, atol=1e-9)


def test_what_nothing_holds():
    """Singular: the whole may be moved; a right side without a mean has solutions."""
    system = grid_system(14, held=0.0)
    target = np.random.default_rng(0).normal(size=(196, 2))
    target -= target.mean(axis=0)
    solution, _ = solved(system, target, regions_of(system[0]), 1e-10)
    np.testing.assert_allclose(system[4] @ solution.ravel(), target.ravel(), atol=1e-8)


def test_regions_make_it_faster():
    system = grid_system(40, held=1e-6)
    target = np.random.default_rng(0).normal(size=(1600, 2))
    alone = solved(system, target, np.zeros(1600, dtype=np.int32), 1e-3)[1]
    together = solved(system, target, regions_of(system[0]), 1e-3)[1]
    assert together < 0.7 * alone


def test_regions_are_alike_in_size():
    uvs = np.random.default_rng(1).normal(size=(5000, 2)) ** 3
    sizes = np.bincount(regions_of(uvs))
    assert len(sizes) == 64
    assert sizes.max() - sizes.min() <= 1
    assert regions_of(uvs[:127]).max() == 0
