"""Coverage and owners of points against the rasterizer on a whole grid."""

import numpy as np
import pytest

from texbake.baking.adaptive_texels.coverage import (
    FINE,
    FULL,
    TEXEL,
    FaceBins,
    TexelCoverage,
    find_owners,
    outlined_texels,
)
from texbake.baking.texels import NO_FACE, SampleGrid, rasterize_uv, snap_uvs
from texbake.mesh.mesh import Mesh

WIDTH, HEIGHT = 20, 12


def soup(n, seed, spread=0.4):
    """Triangles that overlap, leave gaps and extend outside."""
    rng = np.random.default_rng(seed)
    uvs = (rng.uniform(-0.1, 1.1, (n, 1, 2)) + rng.uniform(-spread, spread, (n, 3, 2))).reshape(
        -1, 2
    )
    return mesh_of(uvs, np.arange(3 * n).reshape(n, 3))


def folded():
    """Two triangles that lie on one another, mirrored at the edge that they share."""
    return mesh_of([[0.1, 0.1], [0.1, 0.9], [0.8, 0.47]], [[0, 1, 2], [1, 0, 2]])


def chart(seed):
    """A grid of squares, moved about within, turned, with a square left out."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 7))
    points = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.05, 0.05, (49, 2))
    angle = rng.uniform(0, 6)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corner = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    corner = corner[corner != 24]
    faces = np.concatenate([
        np.column_stack([corner, corner + 1, corner + 8]),
        np.column_stack([corner, corner + 8, corner + 7]),
    ])  # fmt: skip
    return mesh_of(0.5 + 0.33 * points @ turn.T, faces)


def mesh_of(uvs, faces):
    uvs = np.asarray(uvs, dtype=float)
    positions = np.column_stack([uvs, np.zeros(len(uvs))])
    return Mesh(positions=positions, faces=faces, uvs=uvs, uv_faces=faces)


MESHES = [soup(5, 1), soup(40, 2, 0.1), soup(300, 3, 0.02), folded(), chart(4), chart(5)]


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("per_side", [1, 2, 4, 8])
def test_owners_are_those_of_the_rasterizer_on_any_grid(mesh, per_side):
    grid = SampleGrid(WIDTH, HEIGHT, per_side)
    bins = FaceBins.of(mesh, WIDTH, HEIGHT)
    # Coordinates on the finer grid are rounded more finely; put the coarser one onto it.
    faces = snap_uvs(mesh, grid)
    scale = FINE // per_side
    bins = FaceBins(faces.corners * scale, bins.firsts, bins.faces, bins.n_columns)
    owners, _ = rasterize_uv(faces, grid)
    side = TEXEL // per_side
    x, y = np.meshgrid(np.arange(grid.n_columns), np.arange(grid.n_rows))
    points = np.stack([x, y], axis=2).reshape(-1, 2) * side + side // 2
    by_points, _ = find_owners(bins, points)
    np.testing.assert_array_equal(by_points, owners.ravel())


@pytest.mark.parametrize("mesh", MESHES)
def test_masks_equal_the_coverage_of_the_rasterizer(mesh):
    """This includes texels that no outline passes through, whose sub-squares are not tested."""
    bins = FaceBins.of(mesh, WIDTH, HEIGHT)
    centers, _ = rasterize_uv(
        snap_uvs(mesh, SampleGrid(WIDTH, HEIGHT, 1)), SampleGrid(WIDTH, HEIGHT, 1)
    )
    coverage = TexelCoverage.none(WIDTH * HEIGHT)
    outlined = outlined_texels(bins, WIDTH, HEIGHT)
    for rows in (range(0, 8), range(8, HEIGHT)):
        coverage.measure(bins, centers[rows.start : rows.stop], outlined, rows, 2)
    fine = SampleGrid(WIDTH, HEIGHT, FINE)
    covered = rasterize_uv(snap_uvs(mesh, fine), fine)[0] != NO_FACE
    bits = covered.reshape(HEIGHT, FINE, WIDTH, FINE).swapaxes(1, 2).reshape(-1, FULL)
    counts = bits.sum(axis=1)
    only_center = (counts == 0) & (centers.ravel() != NO_FACE)
    np.testing.assert_array_equal(coverage.counts, np.where(only_center, 1, counts))
    is_part = outlined.ravel()
    masks = (bits.astype(np.uint64) << np.arange(FULL, dtype=np.uint64)).sum(
        axis=1, dtype=np.uint64
    )
    np.testing.assert_array_equal(coverage.masks[is_part].view(np.uint64), masks[is_part])
    assert np.isin(counts[~is_part], [0, FULL]).all()


@pytest.mark.parametrize("seed", [4, 5])
def test_only_texels_that_outlines_pass_through_are_tested(seed):
    """Of a chart of 70 faces only the 24 edges around it and the 4 around its hole are outlines."""
    bins = FaceBins.of(chart(seed), 96, 64)
    sides = np.stack([bins.corners, np.roll(bins.corners, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    _, rows, counts = np.unique(
        np.sort(sides.view("i8,i8"), axis=1).reshape(-1, 2), axis=0, return_index=True,
        return_counts=True,
    )  # fmt: skip
    edges = sides[rows[counts == 1]]
    assert len(edges) == 24 + 4
    along = np.linspace(0.0, 1.0, 4097)[:, None, None]
    points = (edges[:, 0] + along * (edges[:, 1] - edges[:, 0])) / TEXEL
    near = np.zeros((64, 96), dtype=bool)
    for shift in (0.0, -2.0 / TEXEL, 2.0 / TEXEL):  # what rounding may add
        x, y = np.floor(points + shift).astype(int).reshape(-1, 2).T
        inside = (x >= 0) & (x < 96) & (y >= 0) & (y < 64)
        near[y[inside], x[inside]] = True
        if shift == 0.0:
            through = near.copy()
    outlined = outlined_texels(bins, 96, 64)
    assert (outlined >= through).all()
    assert np.count_nonzero(outlined & ~near) <= 0.02 * np.count_nonzero(near)
