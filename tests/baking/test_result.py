"""Maps as files: in every encoding, the values that are read are those that were written."""

import numpy as np
import pytest

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.errors import FileError, FileFormatError, OptionError
from texbake.mesh.shapes import plane
from texbake.metadata import DISPLACEMENT_MID, DISPLACEMENT_SCALE
from texbake.texture.encoding import decode_heights, decode_normals
from texbake.texture.image import read_image


@pytest.fixture(scope="module")
def baked():
    high = plane(60, 60, lambda x, y: 0.03 * np.sin(5 * x + y) * np.cos(6 * y))
    maps = ("normal", "displacement", "vector-displacement")
    return bake(high, plane(), BakeOptions(size=(48, 32), maps=maps, padding=2)).maps


@pytest.mark.parametrize(
    ("name", "bits", "half_step"),
    [
        ("n.png", 8, 1 / 255), ("n.png", 16, 1 / 65535), ("n.tif", 8, 1 / 255),
        ("n.tif", 16, 1 / 65535), ("n.tif", 32, 1e-7), ("n.tga", 8, 1 / 255),
        ("n.exr", 16, 2**-11), ("n.exr", 32, 1e-7),
    ],
)  # fmt: skip
def test_normals_come_back_within_half_a_step(baked, tmp_path, name, bits, half_step):
    written = baked["normal"].write(tmp_path / name, bits=bits)
    assert written.bits == bits
    image = read_image(tmp_path / name, color=False)
    assert image.metadata == written.metadata
    # A component is 2x - 1, so half a step of x is a whole step of it; within 4e-6 of flat is flat.
    vectors = image.pixels * 2.0 - 1.0
    np.testing.assert_allclose(vectors, baked["normal"].values, atol=half_step * 1.01 + 4e-6)
    angles = np.linalg.norm(decode_normals(image.pixels) - baked["normal"].values, axis=2)
    assert angles.max() < 2 * half_step + 1e-5


@pytest.mark.parametrize("kind", ["displacement", "vector-displacement"])
@pytest.mark.parametrize(("name", "bits"), [("d.png", 8), ("d.png", 16), ("d.tif", 16)])
def test_heights_come_back_within_half_a_step(baked, tmp_path, kind, name, bits):
    written = baked[kind].write(tmp_path / name, bits=bits)
    assert written.n_clipped == 0
    image = read_image(tmp_path / name, color=False)
    mid, scale = image.metadata[DISPLACEMENT_MID], image.metadata[DISPLACEMENT_SCALE]
    heights = decode_heights(image.pixels, mid=mid, scale=scale)
    step = scale / (2**bits - 1)
    assert np.abs(heights - baked[kind].values).max() <= step / 2 * 1.001
    assert scale < 2.1 * np.abs(baked[kind].values).max()


@pytest.mark.parametrize("name", ["d.exr", "d.tif"])
def test_float_files_hold_plain_heights(baked, tmp_path, name):
    baked["displacement"].write(tmp_path / name)
    image = read_image(tmp_path / name, color=False)
    np.testing.assert_array_equal(image.pixels, baked["displacement"].values)
    assert (image.metadata[DISPLACEMENT_MID], image.metadata[DISPLACEMENT_SCALE]) == (0.0, 1.0)


def test_given_mid_and_scale_are_used_and_clipped_values_are_counted(baked, tmp_path):
    displacement = baked["displacement"]
    written = displacement.write(tmp_path / "d.png", mid=0.25, scale=0.1)
    assert written.metadata == {DISPLACEMENT_MID: 0.25, DISPLACEMENT_SCALE: 0.1}
    below = displacement.values < -0.025
    above = displacement.values > 0.075
    assert written.n_clipped == below.sum() + above.sum() > 0
    image = read_image(tmp_path / "d.png", color=False)
    assert (image.pixels[below] == 0).all()


def test_write_takes_from_the_options_what_is_not_given(tmp_path):
    high = plane(20, 20, lambda x, y: 0.02 * np.sin(5 * x + 4 * y))
    options = BakeOptions(size=16, bits=8, convention="directx")
    normal = bake(high, plane(), options).maps["normal"]
    assert normal.write(tmp_path / "a.png").bits == 8
    assert normal.write(tmp_path / "b.png", convention="directx", bits=8)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("name", "bits", "error"),
    [
        ("n.tga", 16, OptionError), ("n.png", 32, OptionError), ("n.gif", None, FileFormatError),
        ("n.jpg", 8, OptionError), ("n", None, FileFormatError), ("missing/n.png", None, FileError),
    ],
)  # fmt: skip
def test_a_map_that_a_format_cannot_hold_is_one_clear_error(baked, tmp_path, name, bits, error):
    with pytest.raises(error) as raised:
        baked["normal"].write(tmp_path / name, bits=bits)
    assert str(tmp_path / name) in str(raised.value)
    assert list(tmp_path.iterdir()) == []


def test_one_file_for_several_maps_is_an_error(tmp_path):
    options = BakeOptions(size=16, maps=("normal", "displacement"), front=0.1, back=0.1)
    result = bake(plane(), plane(), options)
    with pytest.raises(OptionError, match="one file cannot hold 2 maps"):
        result.write(tmp_path / "maps.png")
    paths = result.write(tmp_path / "maps", suffix=".exr")
    assert [path.name for path in paths] == ["normal.exr", "displacement.exr"]
    single = bake(plane(), plane(), BakeOptions(size=16, front=0.1, back=0.1))
    assert single.write(tmp_path / "one.png") == [tmp_path / "one.png"]
