import numpy as np
import pytest

from texbake.errors import FileError, FileFormatError
from texbake.texture.cube_files import (
    convert_cube,
    cross_picture,
    cube_of_cross,
    in_convention,
    read_faces,
)
from texbake.texture.cube_map import CubeMap, cube_face_axes, texel_directions
from texbake.texture.image import write_image
from texbake.texture.options import CONVENTIONS


@pytest.fixture
def noise():
    return CubeMap(np.random.default_rng(5).random((6, 6, 6, 3)).astype(np.float32))


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_neighbors_in_the_cross_are_neighbors_on_the_cube(convention):
    size = 16
    directions = cross_picture(CubeMap(texel_directions(size)), convention=convention)
    used = np.linalg.norm(directions, axis=2) > 0
    for axis in 0, 1:
        steps = np.linalg.norm(np.diff(directions, axis=axis), axis=2)
        both = np.logical_and(*(np.take(used, r, axis) for r in _pairs(used.shape[axis])))
        # No step is wider than a texel in the middle of a face.
        assert steps[both].max() < 1.01 * 2 / size


def _pairs(n):
    return np.arange(n - 1), np.arange(1, n)


def test_seen_from_inside_faces_are_the_pictures_of_cameras(noise):
    """Sides exactly; top and bottom turned by half a turn from those of `cube_face_axes`."""
    seen = in_convention(noise.faces, "inside")
    for face in range(6):
        view = noise.faces[face, :, ::-1]
        expected = view[::-1, ::-1] if face in (2, 3) else view
        np.testing.assert_array_equal(seen[face], expected)
    np.testing.assert_array_equal(in_convention(seen, "inside"), noise.faces)
    # The picture along -z is not mirrored: +x is on its right.
    along = cross_picture(CubeMap(texel_directions(9)), convention="inside")[9:18, 9:18]
    np.testing.assert_allclose(along[4, 4], -cube_face_axes(5)[2], atol=1e-6)
    assert along[4, 8, 0] > 0.5 and along[0, 4, 1] > 0.5


def test_sources_of_the_wrong_shape(tmp_path):
    square = np.zeros((4, 4, 3), np.float32)
    write_image(square, tmp_path / "square.png")
    with pytest.raises(FileFormatError, match="4 x 4 pixels are neither a latlong"):
        convert_cube(tmp_path / "square.png", tmp_path / "out")
    with pytest.raises(FileFormatError, match="4 x 4 pixels are not a cross"):
        cube_of_cross(square)
    folder = tmp_path / "faces"
    folder.mkdir()
    for name in "px", "nx", "py", "ny", "posz":
        write_image(square, folder / f"{name}.png")
    with pytest.raises(FileError, match="the face nz is missing"):
        read_faces(folder)
    write_image(square[:2, :2], folder / "nz.png")
    with pytest.raises(FileFormatError, match=r"nz\.png has 2 x 2 pixels"):
        read_faces(folder)
    write_image(square[:2], folder / "nz.png")
    with pytest.raises(FileFormatError, match="a face is a square"):
        read_faces(folder)
    write_image(square, folder / "nz.png")
    write_image(square, folder / "PX.tif")
    with pytest.raises(FileFormatError, match="are the same face"):
        read_faces(folder)
    with pytest.raises(FileError, match="cannot be read"):
        read_faces(tmp_path / "nowhere")
