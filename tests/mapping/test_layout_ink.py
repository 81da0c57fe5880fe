"""Coverage of samples by faces and lines, against every sample held against everything."""

import numpy as np
import pytest

from texbake.mapping.layout_ink import SAMPLES, add_faces, add_lines

HEIGHT, WIDTH, TOP = 9, 13, 5


def samples() -> np.ndarray:
    """(H, W, 16, 2) places of all samples, rows of samples within a pixel first."""
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    sy, sx = (part.ravel() for part in np.meshgrid(steps, steps, indexing="ij"))
    return np.stack([x[..., None] + sx, y[..., None] + TOP + sy], axis=-1)


def inwards(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points from the nearest edge line of a triangle, negative outside."""
    edges = np.roll(corners, -1, axis=0) - corners
    area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    ways = [
        (e[0] * (points[..., 1] - c[1]) - e[1] * (points[..., 0] - c[0])) / np.hypot(*e)
        for c, e in zip(corners, edges, strict=True)
    ]
    return np.min(ways, axis=0) if area > 0 else -np.max(ways, axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_faces_cover_what_every_sample_says(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Small, large, thin, and partly outside.
    sizes = random.choice([0.3, 2.0, 30.0], (6, 1, 1)) * random.choice([1.0, 0.01], (6, 1, 2))
    middle = random.random((6, 1, 2)) * [WIDTH, HEIGHT] + [0, TOP]
    pixels = middle + (random.random((6, 3, 2)) - 0.5) * sizes
    colors, half, light = random.random((6, 3)), 0.35, 0.7
    sums = np.zeros((HEIGHT, WIDTH, 4))
    add_faces(pixels, colors, TOP, half, light, sums)
    expected = np.zeros_like(sums)
    for corners, color in zip(pixels, colors, strict=True):
        ways = inwards(corners, samples())
        shade = (ways >= 0.0) * np.where(ways < half, light, 1.0)
        expected[..., :3] += shade.sum(axis=2)[..., None] * color
        expected[..., 3] += (ways >= 0.0).sum(axis=2)
    np.testing.assert_allclose(sums, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(20))
def test_lines_cover_what_every_sample_says(seed: int) -> None:
    random = np.random.default_rng(seed)
    ends = (random.random((4, 2, 2)) * 2.0 - 0.5) * [WIDTH, HEIGHT] + [0, TOP]
    ends[1, :, seed % 2] = ends[1, 0, seed % 2]  # along an axis
    ends[2, 1] = ends[2, 0]  # a point
    masks = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    add_lines(ends, 1.4, TOP, masks)
    expected = np.zeros_like(masks)
    for start, end in ends:
        way, to = end - start, samples() - start
        t = np.clip((to @ way) / max(way @ way, 1e-300), 0.0, 1.0)[..., None]
        near = np.linalg.norm(to - t * way, axis=-1) <= 0.7
        expected |= (near << np.arange(16)).sum(axis=2).astype(np.uint16)
    np.testing.assert_array_equal(masks, expected)


def test_of_many_layers_some_dozens_are_mixed() -> None:
    """A thousand faces over everything, every fourth red: a quarter of the light is."""
    whole = np.array([[-99.0, -99.0], [99.0, -99.0], [0.0, 199.0]])
    colors = np.zeros((1000, 3))
    colors[::4, 0] = 1.0
    sums = np.zeros((HEIGHT, WIDTH, 4))
    add_faces(np.tile(whole, (1000, 1, 1)), colors, TOP, 0.35, 0.7, sums)
    assert (sums == sums[0, 0]).all()
    assert 32 <= sums[0, 0, 3] / SAMPLES**2 < 1000
    assert sums[0, 0, 0] / sums[0, 0, 3] == 0.25


def test_a_face_over_what_is_full_still_shows_beside_it() -> None:
    left = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 99.0]])
    pixels = np.concatenate([np.tile(left, (500, 1, 1)), [left * [3.0, 1.0]]])
    colors = np.zeros((501, 3))
    colors[-1] = 1.0
    sums = np.zeros((HEIGHT, WIDTH, 4))
    add_faces(pixels, colors, TOP, 0.0, 1.0, sums)
    assert sums[0, 0, 0] == 0.0  # full before it came
    assert (sums[:, 7:, 3] == 16.0).all() and (sums[:, 7:, 0] == 16.0).all()
