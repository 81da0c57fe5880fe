import numpy as np
import pytest

from texbake import OptionError, checker_image
from texbake.texture.lookup import lookup


def cells(image, n):
    """(row from the bottom, column, h, w, 3)"""
    side = len(image) // n
    return image.reshape(n, side, n, side, 3).swapaxes(1, 2)[::-1]


def test_each_cell_has_its_own_color_and_neighbors_differ_in_lightness():
    colors = cells(checker_image(512, 16), 16)[:, :, 0, 0]
    assert len(np.unique(colors.reshape(-1, 3), axis=0)) == 256
    luminance = colors @ [0.2126, 0.7152, 0.0722]
    light = luminance > np.median(luminance)
    # All but those of a few hues lie on the same side of the middle as in a checker.
    assert (light == (np.indices((16, 16)).sum(axis=0) % 2 == 1)).mean() > 0.9
    steps = np.abs(np.diff(luminance, axis=1)), np.abs(np.diff(luminance, axis=0))
    assert min(step.min() for step in steps) > 0.05


def test_hues_of_a_column_continue_in_the_next():
    colors = cells(checker_image(512, 16), 16)[:, :, 0, 0]
    last, after, before = colors[-1, 1:-1], colors[0, 2:], colors[0, :-2]
    away = [np.linalg.norm(last - first, axis=1) for first in (after, before)]
    assert (away[0] < 0.5 * away[1]).all()


def test_a_cell_never_looks_like_itself_mirrored_or_turned():
    for cell in cells(checker_image(512, 8), 8).reshape(-1, 64, 64, 3):
        ink = cell.max(axis=2) < 0.5 * cell[0, 0].max()
        assert ink.sum() > 60
        looks = [ink[::-1], ink[:, ::-1], ink[::-1, ::-1], ink.T, np.rot90(ink), np.rot90(ink, 3)]
        assert all((look != ink).sum() > 30 for look in looks)


def test_u_goes_along_the_numbers_and_v_up_the_letters():
    image = checker_image(256, 4)
    corner = lookup(image, np.array([[0.245, 0.24]]))[0]  # upper right of the first cell: A1
    assert np.allclose(corner, cells(image, 4)[0, 0, 0, -1], atol=1e-6)
    right = lookup(image, np.array([[0.495, 0.24]]))[0]
    assert np.allclose(right, cells(image, 4)[0, 1, 0, -1], atol=1e-6)


def test_sizes_that_cells_do_not_divide():
    image = checker_image((101, 67), 8)
    assert image.shape == (67, 101, 3)
    starts = np.flatnonzero((image[0, 1:] != image[0, :-1]).any(axis=1)) + 1
    assert starts.tolist() == [101 * i // 8 for i in range(1, 8)]
    assert checker_image(8, 8).shape == (8, 8, 3)


@pytest.mark.parametrize(
    ("size", "n_cells", "words"),
    [(64, 0, "n_cells: 0"), (64, 27, "n_cells: 27"), (7, 8, "7 x 7 texels are too few")],
)
def test_wrong_numbers(size, n_cells, words):
    with pytest.raises(OptionError, match=words):
        checker_image(size, n_cells)
