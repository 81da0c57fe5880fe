import itertools

import numpy as np
import pytest

from texbake.errors import OptionError
from texbake.texture.cube_map import (
    CubeChain,
    CubeMap,
    cube_face_axes,
    face_directions,
    locate_directions,
    shrink_cube,
    solid_angles,
    texel_directions,
)

# OpenGL 4.6, table 8.19: of each face the major axis, then s and t as axes with their signs.
TABLE = ["+x -z -y", "-x +z -y", "+y +x +z", "-y +x -z", "+z +x -y", "-z -x -y"]


def axis(name):
    return (1 if name[0] == "+" else -1) * np.eye(3)["xyz".index(name[1])]


def waves(directions):
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    return np.stack([np.exp(0.7 * x + 0.4 * y - 0.6 * z), 1.0 + 0.5 * x * y + z], axis=-1)


@pytest.fixture
def noise():
    return CubeMap(np.random.default_rng(5).random((6, 7, 7, 3)).astype(np.float32))


@pytest.mark.parametrize("face", range(6))
def test_axes_are_those_of_opengls_table_and_show_a_camera_the_face_mirrored(face):
    middle, s, t = map(axis, TABLE[face].split())
    point = middle + 0.5 * s - 0.25 * t
    faces, st = locate_directions(3.0 * point)
    assert faces == face
    assert st.tolist() == [0.75, 0.375]
    right, up, back = cube_face_axes(face)
    np.testing.assert_array_equal(np.cross(right, up), back)
    # What is at the right and top of its picture is at the left and top of the face.
    faces, st = locate_directions(-back + 0.5 * right + 0.5 * up)
    assert faces == face
    assert st.tolist() == [0.25, 0.25]
    views = np.zeros((6, 4, 4, 1), np.float32)
    views[face, 0, 3] = 1.0
    assert CubeMap.from_views(views).faces[face, 0, 0] == 1.0


def test_directions_of_texels_lie_on_them():
    for size in 1, 2, 5:
        faces, st = locate_directions(face_directions(size))
        assert (faces == np.arange(6)[:, None, None]).all()
        centers = (np.arange(size) + 0.5) / size
        expected = np.stack(np.meshgrid(centers, centers), axis=-1)
        # A few roundings of numbers below 1.
        np.testing.assert_allclose(st, np.broadcast_to(expected, st.shape), atol=1e-15)
        lengths = np.linalg.norm(texel_directions(size), axis=-1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)


@pytest.mark.parametrize("size", [1, 2, 3, 16, 100])
def test_solid_angles_sum_to_the_sphere_and_agree_with_the_texels(size):
    angles = solid_angles(size)
    assert angles.min() > 0
    assert 6 * angles.sum() == pytest.approx(4 * np.pi, rel=1e-13)
    if size == 100:
        # Area over the cube of the distance, by the midpoint: off by the square of 1/50, at most.
        points = np.linalg.norm(face_directions(size)[0], axis=-1)
        np.testing.assert_allclose(angles, (2 / size) ** 2 / points**3, rtol=4e-4)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_borders_continue_a_smooth_function(size):
    # Every texel its own direction: the border's must be those of the nearest texels beyond.
    cube = CubeMap(face_directions(size).astype(np.float32))
    border = cube.bordered.astype(np.float64)
    for face, (row, column) in itertools.product(
        range(6), [(0, slice(1, -1)), (-1, slice(1, -1)), (slice(1, -1), 0), (slice(1, -1), -1)]
    ):
        inner_row = {0: 1, -1: -2}.get(row, row) if isinstance(row, int) else row
        inner_column = {0: 1, -1: -2}.get(column, column) if isinstance(column, int) else column
        apart = border[face, row, column] - border[face, inner_row, inner_column]
        # Half a texel to the edge and half a texel down the other face, at a right angle.
        np.testing.assert_allclose(np.linalg.norm(apart, axis=-1), np.sqrt(2) / size, rtol=1e-6)


def test_corners_are_the_mean_of_the_three_texels_that_meet(noise):
    # +x, +y and +z meet where s and t are: +x (0, 0), +y (1, 1), +z (1, 0).
    mean = (noise.faces[0, 0, 0] + noise.faces[2, -1, -1] + noise.faces[4, 0, -1]) / 3
    for corner in (noise.bordered[0, 0, 0], noise.bordered[2, -1, -1], noise.bordered[4, 0, -1]):
        # Three float32 roundings.
        np.testing.assert_allclose(corner, mean, rtol=3e-7)


def test_values_that_are_not_finite_become_0():
    faces = np.ones((6, 2, 2, 1), np.float32)
    faces[0, 0, 0], faces[1, 1, 1], faces[5, 0, 1] = np.nan, np.inf, -np.inf
    cube = CubeMap(faces)
    assert cube.faces.sum() == 6 * 4 - 3
    assert np.isnan(faces[0, 0, 0])  # the caller's array is left as it was
    with pytest.raises(ValueError, match="read-only"):
        cube.faces[0] = 1.0


@pytest.mark.parametrize(
    "shape", [(6, 2, 3, 1), (5, 2, 2, 1), (6, 2, 2), (6, 0, 0, 3), (6, 2, 2, 0)]
)
def test_wrong_shapes_are_one_clear_error(shape):
    with pytest.raises(OptionError, match="faces: the shape"):
        CubeMap(np.zeros(shape, np.float32))


@pytest.mark.parametrize("size", [1, 2, 3, 7])
@pytest.mark.parametrize("source", [7, 12])
def test_reducing_keeps_a_constant_exactly(source, size):
    value = np.array([0.1, 3.3e4, 1e-6], np.float32)
    cube = CubeMap(np.broadcast_to(value, (6, source, source, 3)))
    assert (shrink_cube(cube, size).faces == value).all()


@pytest.mark.parametrize(("source", "size"), [(16, 8), (12, 4), (12, 1)])
def test_reducing_by_a_whole_factor_keeps_the_energy(source, size):
    cube = CubeMap(np.random.default_rng(1).random((6, source, source, 2)).astype(np.float32))
    before = (cube.faces * solid_angles(source)[None, ..., None]).sum((0, 1, 2))
    after = (shrink_cube(cube, size).faces * solid_angles(size)[None, ..., None]).sum((0, 1, 2))
    # Float32 rounding of the texels alone.
    np.testing.assert_allclose(after, before, rtol=1e-6)


def test_reducing_by_a_fraction_follows_a_smooth_function():
    cube = CubeMap(waves(texel_directions(33)).astype(np.float32))
    # The mean over a texel of width h = 2/10 is off its middle by h²/24 times the second
    # derivatives, which on a face are at most 8 together: of e^0.99, and of the bend of directions.
    np.testing.assert_allclose(
        shrink_cube(cube, 10).faces, waves(texel_directions(10)), atol=8 * 0.2**2 / 24
    )


def test_reducing_to_a_size_that_cannot_be(noise):
    assert shrink_cube(noise, 7) is noise
    for size in 0, 8:
        with pytest.raises(OptionError, match=f"size: {size} is not from 1 to 7"):
            shrink_cube(noise, size)


def test_levels_that_do_not_fit_together(noise):
    with pytest.raises(OptionError, match="levels: 0 cube maps"):
        CubeChain.of([])
    with pytest.raises(OptionError, match=r"levels: 2 cube maps with \[1, 3\] channels"):
        CubeChain.of([noise, CubeMap(np.zeros((6, 1, 1, 1), np.float32))])
