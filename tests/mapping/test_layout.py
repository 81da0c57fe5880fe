"""Coverage of samples by faces and lines, against every sample held against everything."""

import math

import numpy as np
import pytest

from texbake.core import core
from texbake.errors import UvError
from texbake.mapping.layout import (
    SAMPLES,
    UNMEASURED,
    Tile,
    draw_layout,
    face_colors,
    text_coverage,
)
from texbake.mesh.mesh import Mesh
from texbake.mesh.oklch import diverging
from texbake.mesh.shapes import cube, plane


def triangle(*uvs):
    return Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]], uvs=uvs,
        uv_faces=[[0, 1, 2]],
    )  # fmt: skip


def test_row_0_is_the_top_and_the_rest_is_bright():
    picture = draw_layout(triangle((0, 0.5), (0.5, 1), (0, 1)), size=(80, 40))
    assert picture.shape == (40, 80, 3)
    assert picture.dtype == np.float32
    inside = picture[4, 4]  # the triangle is in the upper left corner
    background = picture[30, 60]
    assert np.ptp(background) == 0.0
    assert background.min() > 0.85
    assert np.ptp(inside) > 0.1
    assert (picture[21:, :] == background).all()
    assert ((picture >= 0.0) & (picture <= 1.0)).all()


def test_a_mirrored_face_is_red():
    corners = (0.1, 0.1), (0.9, 0.1), (0.1, 0.9)
    right, wrong = (draw_layout(triangle(*uvs), 64)[40, 20] for uvs in (corners, corners[::-1]))
    assert wrong[0] > 10.0 * wrong[1:].max()
    assert not right[0] > 10.0 * right[1:].max()


def test_a_chart_is_outlined_all_around_and_inner_edges_are_fainter():
    mesh = plane(1, 1)
    picture = draw_layout(mesh.replace(uvs=mesh.uvs * 0.5 + 0.25), 64)
    brightness = picture.sum(axis=2)
    inside, diagonal = brightness[25, 34], brightness[32, 31]
    borders = [brightness[16, 40], brightness[47, 24], brightness[40, 16], brightness[24, 47]]
    assert max(borders) < diagonal < inside


def test_charts_differ_in_color_and_the_same_comes_out_of_any_number_of_threads():
    corners = np.tile(plane().corner_uvs(), (6, 1, 1)) * 0.15
    corners += np.repeat(np.arange(6), 2)[:, None, None] * 0.16
    mesh = cube().replace(
        uvs=corners.reshape(-1, 2), uv_faces=np.arange(36, dtype=np.int32).reshape(-1, 3)
    )
    picture = draw_layout(mesh, 300, threads=1)
    centers = ((np.arange(6) * 0.16 + 0.05) * 300).astype(int)
    colors = picture[299 - centers, centers + 15]
    assert len(np.unique(colors.round(3), axis=0)) == 6
    assert draw_layout(mesh, 300, threads=3).tobytes() == picture.tobytes()


def test_faces_without_area_are_left_out():
    blank = draw_layout(triangle((0.2, 0.2), (0.5, 0.5), (0.8, 0.8)), 32)
    assert (blank[:4] == blank[0, 0]).all()
    assert draw_layout(triangle((9, 9), (9, 9), (9, 9)), 32).shape == (32, 32, 3)
    with pytest.raises(UvError):
        draw_layout(cube())


def test_tiles_stand_side_by_side_with_borders_and_numbers():
    mesh = triangle((2.1, 1.1), (2.9, 1.1), (2.1, 1.9))
    picture = draw_layout(mesh, 600)
    assert picture.shape == (400, 600, 3)  # three columns of tiles, two rows
    colored = np.ptp(picture, axis=2) > 0.05
    rows, columns = np.nonzero(colored)
    assert (rows.min(), rows.max()) == pytest.approx((20, 180), abs=2)
    assert (columns.min(), columns.max()) == pytest.approx((420, 580), abs=2)
    background = picture[300, 100, 0]
    assert (picture[:, 200, 0] < background).all()  # a border from top to bottom
    assert (picture[200, :, 0] < background).all()
    for row in range(2):  # a number in the lower left corner of each tile
        for column in range(3):
            corner = picture[(1 - row) * 200 + 160 : (1 - row) * 200 + 196, column * 200 + 8 :]
            assert corner[:, :40].min() < 0.1


def test_names_of_tiles():
    names = [Tile(column=c, row=r).name for c, r in ((0, 0), (9, 0), (3, 2), (10, 0), (-1, 0))]
    assert names == ["1001", "1010", "1024", "10, 0", "-1, 0"]


def two_squares():
    """Unit squares in space; the texture has the right one twice as wide and high, or four times
    as large, so that L2 of the left is √2.5 and of the right √(5/8)."""
    square = plane()
    return Mesh(
        positions=np.concatenate([square.positions, square.positions + np.array([2.0, 0.0, 0.0])]),
        faces=np.concatenate([square.faces, square.faces + 4]),
        uvs=np.concatenate([square.uvs * 0.25 + 0.05, square.uvs * 0.5 + 0.45]),
        uv_faces=np.concatenate([square.faces, square.faces + 4]),
    )


def test_heat_is_amber_where_the_texture_is_stretched_and_blue_where_compressed():
    picture = draw_layout(two_squares(), 400, heat=True)
    assert picture.shape[0] > 400  # the scale below
    stretched, compressed = picture[330, 60], picture[80, 240]
    assert stretched[0] > 1.5 * stretched[2]
    assert compressed[2] > 1.2 * compressed[0]
    # The color is that of the scale at the same stretch.
    left = math.log2(math.sqrt(2.5))
    expected = diverging(np.rint(left * 64.0) / 64.0)
    assert stretched == pytest.approx(expected, abs=0.01)
    scale = picture[400 + 9]
    assert np.abs(scale - expected).max(axis=1).min() < 0.02


def test_a_perfect_map_has_no_heat_and_unmeasurable_faces_are_gray():
    picture = draw_layout(plane(4, 4), 400, heat=True)
    assert np.ptp(picture[170, 140]) < 1e-3
    flat = triangle((0, 0), (1, 0), (0, 1)).replace(positions=np.zeros((3, 3)))
    gray = draw_layout(flat, 64, heat=True)[40, 10]
    assert np.ptp(gray) == 0.0
    assert gray[0] < 0.7


def test_cuts_are_darker_than_the_ends_of_the_surface():
    mesh = plane(2, 1)
    apart = mesh.corner_uvs() * 0.4 + 0.05
    apart[2:] += np.array([0.2, 0.2])
    each = np.arange(12, dtype=np.int32).reshape(-1, 3)
    picture = draw_layout(mesh.replace(uvs=apart.reshape(-1, 2), uv_faces=each), 400)
    brightness = picture.sum(axis=2)
    end, cut = brightness[400 - 60, 16:24].min(), brightness[400 - 60, 96:104].min()
    assert cut < 0.7 * end


HEIGHT, WIDTH, TOP = 9, 13, 5


def samples():
    """(H, W, 16, 2) places of all samples, rows of samples within a pixel first."""
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    sy, sx = (part.ravel() for part in np.meshgrid(steps, steps, indexing="ij"))
    return np.stack([x[..., None] + sx, y[..., None] + TOP + sy], axis=-1)


def inwards(corners, points):
    """Distance of points from the nearest edge line of a triangle, negative outside."""
    edges = np.roll(corners, -1, axis=0) - corners
    area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    distances = [
        (e[0] * (points[..., 1] - c[1]) - e[1] * (points[..., 0] - c[0])) / np.hypot(*e)
        for c, e in zip(corners, edges, strict=True)
    ]
    return np.min(distances, axis=0) if area > 0 else -np.max(distances, axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_faces_cover_the_samples_inside_them(seed):
    random = np.random.default_rng(seed)
    # Small, large, thin, and partly outside.
    sizes = random.choice([0.3, 2.0, 30.0], (6, 1, 1)) * random.choice([1.0, 0.01], (6, 1, 2))
    middle = random.random((6, 1, 2)) * [WIDTH, HEIGHT] + [0, TOP]
    pixels = middle + (random.random((6, 3, 2)) - 0.5) * sizes
    colors, half, border_shade = random.random((6, 3)), 0.35, 0.7
    sums = np.zeros((HEIGHT, WIDTH, 4))
    core.cover_faces(pixels, colors, TOP, half, border_shade, sums)
    expected = np.zeros_like(sums)
    for corners, color in zip(pixels, colors, strict=True):
        distances = inwards(corners, samples())
        shade = (distances >= 0.0) * np.where(distances < half, border_shade, 1.0)
        expected[..., :3] += shade.sum(axis=2)[..., None] * color
        expected[..., 3] += (distances >= 0.0).sum(axis=2)
    np.testing.assert_allclose(sums, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(20))
def test_lines_cover_the_samples_near_them(seed):
    random = np.random.default_rng(seed)
    ends = (random.random((4, 2, 2)) * 2.0 - 0.5) * [WIDTH, HEIGHT] + [0, TOP]
    ends[1, :, seed % 2] = ends[1, 0, seed % 2]  # along an axis
    ends[2, 1] = ends[2, 0]  # a point
    masks = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    core.cover_lines(ends, TOP, 0.7, masks)
    expected = np.zeros_like(masks)
    for start, end in ends:
        way, to = end - start, samples() - start
        t = np.clip((to @ way) / max(way @ way, 1e-300), 0.0, 1.0)[..., None]
        near = np.linalg.norm(to - t * way, axis=-1) <= 0.7
        expected |= (near << np.arange(16)).sum(axis=2).astype(np.uint16)
    np.testing.assert_array_equal(masks, expected)


def test_of_many_layers_some_dozens_are_mixed():
    """A thousand faces over everything, every fourth red: so a quarter of the sum is."""
    whole = np.array([[-99.0, -99.0], [99.0, -99.0], [0.0, 199.0]])
    colors = np.zeros((1000, 3))
    colors[::4, 0] = 1.0
    sums = np.zeros((HEIGHT, WIDTH, 4))
    core.cover_faces(np.tile(whole, (1000, 1, 1)), colors, TOP, 0.35, 0.7, sums)
    assert (sums == sums[0, 0]).all()
    assert 32 <= sums[0, 0, 3] / SAMPLES**2 < 1000
    assert sums[0, 0, 0] / sums[0, 0, 3] == 0.25


def test_a_face_over_full_pixels_still_shows_beside_them():
    left = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 99.0]])
    pixels = np.concatenate([np.tile(left, (500, 1, 1)), [left * [3.0, 1.0]]])
    colors = np.zeros((501, 3))
    colors[-1] = 1.0
    sums = np.zeros((HEIGHT, WIDTH, 4))
    core.cover_faces(pixels, colors, TOP, 0.0, 1.0, sums)
    assert sums[0, 0, 0] == 0.0  # full before it came
    assert (sums[:, 7:, 3] == 16.0).all() and (sums[:, 7:, 0] == 16.0).all()


def test_heat_of_a_mesh_whose_areas_cannot_be_computed_is_that_of_faces_without_area():
    mesh = plane(2, 2)
    huge = mesh.replace(positions=mesh.positions * 1e300)
    colors = face_colors(huge, np.zeros(huge.n_faces, np.int32), 32, heat=True)
    np.testing.assert_array_equal(colors, np.tile(UNMEASURED, (huge.n_faces, 1)))


def test_a_line_is_cropped_to_its_ink():
    ink = text_coverage("1001", 32)
    assert ink.dtype == np.float32
    assert (ink.min(), ink.max()) == (0.0, 1.0)
    for border in ink[0], ink[-1], ink[:, 0], ink[:, -1]:
        assert border.max() > 0.0
    assert 16 < len(ink) < 32  # a digit is about 3/4 of the size
    assert ink.shape[1] > ink.shape[0]
