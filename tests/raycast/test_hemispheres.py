"""Sets of directions: nets of one point a cell, spread by the cosine, better than chance."""

import numpy as np
import pytest

from texbake.raycast.rays import concentric_disk, direction_sets, scrambled_nets

COUNTS = [1, 2, 8, 64, 4096]


def cells(nets, columns, rows):
    """Number of the cell, of a grid of 2^columns x 2^rows, that each point lies in."""
    x, y = (nets[..., axis].astype(np.float64) / 2.0**32 for axis in (0, 1))
    return (x * 2**columns).astype(int) * 2**rows + (y * 2**rows).astype(int)


@pytest.mark.parametrize("n", COUNTS)
def test_every_cell_of_every_grid_has_one_point_and_directions_are_above_the_plane(n):
    nets = scrambled_nets(12, n)
    bits = n.bit_length() - 1
    for columns in range(bits + 1):
        found = np.sort(cells(nets, columns, bits - columns), axis=1)
        np.testing.assert_array_equal(found, np.broadcast_to(np.arange(n), found.shape))
    sets = direction_sets(n)
    assert sets.shape == (65536 // n, n, 3)
    assert sets.dtype == np.float32
    assert (sets[..., 2] > 0).all()
    # float32 rounding of three coordinates
    np.testing.assert_allclose(np.linalg.norm(sets.astype(float), axis=-1), 1, atol=1e-7)
    # Each number has its own nth of the disk. Boxes around them cover the disk about once.
    boxes = np.ptp(direction_sets(n)[..., :2], axis=0).prod(axis=-1)
    assert boxes.sum() < 1.5 * np.pi


def test_means_over_all_sets_are_those_of_the_cosine_lobe():
    x, y, z = np.moveaxis(direction_sets(64).astype(float), -1, 0)
    for values, mean in ((z, 2 / 3), (z * z, 1 / 2), (x, 0), (x * x, 1 / 4), (x * y, 0)):
        sets = values.mean(axis=1)
        # 1,024 independent sets: 5 standard errors
        assert abs(sets.mean() - mean) < 5 * sets.std() / np.sqrt(len(sets))


@pytest.mark.parametrize("n", [16, 64, 1024])
def test_the_open_share_is_found_with_less_noise_than_by_chance(n):
    # A wall hides what lies behind a slanted plane through the point: half-spaces at many angles.
    rng = np.random.default_rng(0)
    walls = rng.normal(size=(20, 3))
    errors = []
    for wall in walls / np.linalg.norm(walls, axis=1, keepdims=True):
        shares = (direction_sets(n) @ wall.astype(np.float32) > 0).mean(axis=1)
        truth = (1 + wall[2]) / 2  # projected area of the open part of the hemisphere
        assert abs(shares.mean() - truth) < 5 * shares.std() / np.sqrt(len(shares)) + 1e-9
        by_chance = np.sqrt(truth * (1 - truth) / n)
        errors.append(shares.std() / by_chance)
    # An edge crosses sqrt(n) of the n cells, so the noise falls with n^-3/4 and not with n^-1/2;
    # the factor is what edges of other slopes than the grid's add.
    assert np.mean(errors) < 1.1 * n**-0.25


def test_noise_of_one_set_does_not_show_in_the_next():
    wall = np.array([0.6, 0.3, 0.2], dtype=np.float32)
    shares = (direction_sets(64) @ wall > 0).mean(axis=1)
    errors = shares - shares.mean()
    neighbors = (errors[1:] * errors[:-1]).mean() / errors.var()
    assert abs(neighbors) < 5 / np.sqrt(len(errors))


def test_the_disk_has_equal_areas_and_a_center():
    n = 256
    grid = (np.arange(n) + 0.5) / n
    points = concentric_disk(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2))
    radii = np.linalg.norm(points, axis=1)
    assert radii.max() < 1
    for radius in (0.25, 0.5, 0.75):
        # Rings of the square become rings of the disk; a ring of cells more or less.
        assert abs((radii < radius).mean() - radius**2) < 4 * radius / n
    assert concentric_disk(np.array([[0.5, 0.5]])).tolist() == [[0, 0]]
