"""Ownership of samples is decided exactly: against rational arithmetic, and by counting."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.baking.texels import NO_FACE, UNIT, SampleGrid, owned_samples, rasterize_uv, snap_uvs
from texbake.errors import UvError
from texbake.mesh.mesh import Mesh


def mesh_of(uvs, uv_faces):
    """A mesh whose positions are its texture coordinates."""
    uvs = np.asarray(uvs, dtype=float)
    positions = np.column_stack([uvs, np.zeros(len(uvs))])
    return Mesh(positions=positions, faces=uv_faces, uvs=uvs, uv_faces=uv_faces, name="low.obj")


def owners_of(mesh, width, height, per_side=1):
    grid = SampleGrid(width, height, per_side)
    return rasterize_uv(snap_uvs(mesh, grid), grid)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(-40, 200), st.integers(-40, 200)), min_size=3, max_size=3))
def test_coverage_matches_rational_edge_functions(points):
    """Corners on eighths of texels, so that centers fall exactly on edges and corners."""
    size = 20
    uvs = np.array(points) / (8 * size)
    mesh = mesh_of(uvs, [[0, 1, 2]])
    expected = np.zeros((size, size), dtype=bool)
    corners = [(Fraction(int(x), 8), size - Fraction(int(y), 8)) for x, y in points]
    (ax, ay), (bx, by), (cx, cy) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area < 0:
        corners = [corners[0], corners[2], corners[1]]
    for row in range(size):
        for column in range(size):
            x, y = column + Fraction(1, 2), row + Fraction(1, 2)
            inside = area != 0
            for (px, py), (qx, qy) in zip(corners, corners[1:] + corners[:1], strict=True):
                dx, dy = qx - px, qy - py
                edge = dx * (y - py) - dy * (x - px)
                inside &= edge > 0 or (edge == 0 and (dy < 0 or (dy == 0 and dx > 0)))
            expected[row, column] = inside
    if not expected.any():
        return
    owners, _ = owners_of(mesh, size, size)
    np.testing.assert_array_equal(owners == 0, expected)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_random_triangulation_of_the_square_tiles_it(seed, size):
    """A jittered grid, split either way, covers every sample once, whatever the slivers."""
    rng = np.random.default_rng(seed)
    n = 6
    grid = np.stack(np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)), axis=-1)
    inner = rng.uniform(-0.045, 0.045, (n - 2, n - 2, 2))
    grid[1:-1, 1:-1] += inner
    faces = []
    for i in range(n - 1):
        for j in range(n - 1):
            a, b, c, d = i * n + j, i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j
            split = [[a, b, c], [a, c, d]] if rng.random() < 0.5 else [[a, b, d], [b, c, d]]
            faces += [face if rng.random() < 0.5 else face[::-1] for face in split]
    owners, n_overlaps = owners_of(mesh_of(grid.reshape(-1, 2), faces), size, size, 2)
    assert n_overlaps == 0
    assert (owners != NO_FACE).all()


def test_overlapping_faces_first_wins_and_is_counted():
    uvs = [[0, 0], [1, 0], [0, 1], [1, 1]]
    owners, n_overlaps = owners_of(mesh_of(uvs, [[0, 1, 2], [0, 1, 2], [0, 1, 3]]), 32, 32)
    first = owners == 0
    assert not (owners == 1).any() and (owners == 2).any()
    # Each sample of the first face is covered again, by the second; the third adds no new one.
    assert n_overlaps == first.sum()


def test_faces_outside_the_tile_are_clipped_and_counted():
    uvs = [[-1, -1], [3, -1], [-1, 3], [1e12, 0], [0, 1e12], [1e307, 0]]
    grid = SampleGrid(16, 16, 1)
    faces = snap_uvs(mesh_of(uvs, [[0, 1, 2], [0, 3, 4], [0, 1, 5]]), grid)
    assert faces.n_outside_tile == 3
    owners, n_overlaps = rasterize_uv(faces, grid)
    # u + v <= 2 holds on the whole tile; the faces at 1e12 and 1e307 are beyond the grid's reach.
    assert (owners == 0).all()
    assert n_overlaps == 0


@pytest.mark.parametrize(("uvs", "why"), [
    ([[0.5, 0.5]] * 3, "no area"),
    ([[0.1, 0.1], [0.5, 0.5], [0.9, 0.9]], "no area"),
    ([[2, 2], [3, 2], [2, 3]], "unit square"),
    ([[0.5, 0.5], [0.501, 0.5], [0.5, 0.501]], "smaller than any texel"),
])  # fmt: skip
def test_uvs_that_cover_nothing_are_an_error(uvs, why):
    with pytest.raises(UvError, match=why):
        owners_of(mesh_of(uvs, [[0, 1, 2]]), 16, 16)


def test_no_uvs_says_what_to_do():
    mesh = Mesh(positions=np.eye(3), faces=[[0, 1, 2]], name="low.obj")
    with pytest.raises(UvError, match=r"^low\.obj: it has no texture coordinates; .*unwrap low"):
        owners_of(mesh, 16, 16)


def test_rows_come_out_the_same_alone_or_together_and_for_any_threads():
    rng = np.random.default_rng(3)
    mesh = mesh_of(rng.uniform(-0.2, 1.2, (60, 2)), np.arange(60).reshape(20, 3))
    grid = SampleGrid(200, 150, 2)
    faces = snap_uvs(mesh, grid)
    whole, n_whole = rasterize_uv(faces, grid, threads=1)
    parts = [
        rasterize_uv(faces, grid, range(i, min(i + 13, 150)), threads=2) for i in range(0, 150, 13)
    ]
    np.testing.assert_array_equal(whole, np.concatenate([owners for owners, _ in parts]))
    assert n_whole == sum(n for _, n in parts)


@pytest.mark.parametrize("per_side", [1, 2, 4])
def test_samples_lie_where_their_barycentrics_say(per_side):
    rng = np.random.default_rng(5)
    uvs = rng.uniform(0, 1, (30, 2))
    mesh = mesh_of(uvs, np.arange(30).reshape(10, 3))
    grid = SampleGrid(37, 23, per_side)
    faces = snap_uvs(mesh, grid)
    owners, _ = rasterize_uv(faces, grid)
    samples = owned_samples(owners, faces, grid, 0)
    assert len(samples) == (owners != NO_FACE).sum()
    b = samples.barycentrics
    weights = np.column_stack([1 - b.sum(axis=1), b])
    assert weights.min() >= 0
    points = np.einsum("ni,nij->nj", weights, mesh.corner_uvs()[samples.faces])
    x, y = points[:, 0] * grid.n_columns, (1 - points[:, 1]) * grid.n_rows
    # Half a unit of the grid that corners were snapped to, and a texel is `per_side` samples wide.
    off = 0.51 / UNIT
    column, row = np.floor(x), np.floor(y)
    assert np.abs(x - column - 0.5).max() <= off and np.abs(y - row - 0.5).max() <= off
    texels = (row // per_side) * grid.width + column // per_side
    np.testing.assert_array_equal(samples.texel_ids, texels)
    np.testing.assert_array_equal(owners[row.astype(int), column.astype(int)], samples.faces)
    # Each owned sample is listed once.
    assert len(np.unique(row * grid.n_columns + column)) == len(samples)
