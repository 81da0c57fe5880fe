import numpy as np
import pytest

from texbake.texture.image import read_image, write_image
from texbake.texture.mipmaps import mip_chain, roughness_of_lengths, write_mip_levels
from texbake.texture.options import MipOptions


@pytest.fixture
def rock(tmp_path):
    pixels = np.random.default_rng(0).random((12, 20, 3)).astype(np.float32)
    write_image(pixels, tmp_path / "rock.tif", bits=32)
    return tmp_path / "rock.tif"


def test_every_level_is_a_file(tmp_path, rock):
    files = write_mip_levels(rock, tmp_path / "levels")
    chain = mip_chain(read_image(rock, color=True).pixels)
    assert [file.name for file in files] == [f"rock_{i}.tif" for i in range(chain.n_levels)]
    for index, file in enumerate(files):
        np.testing.assert_array_equal(read_image(file, color=True).pixels, chain.level(index))
    assert read_image(files[-1], color=True).pixels.shape == (1, 1, 3)


def test_colors_are_averaged_in_linear_light(tmp_path):
    black_and_white = np.zeros((2, 2, 3), np.uint8)
    black_and_white[0] = 255
    write_image(black_and_white, tmp_path / "bw.png", color=True)
    write_mip_levels(tmp_path / "bw.png", tmp_path / "color")
    write_mip_levels(tmp_path / "bw.png", tmp_path / "data", MipOptions(kind="data"))

    def codes(folder):
        pixels = read_image(tmp_path / folder / "bw_1.png", color=False).pixels
        return (pixels * np.iinfo(np.uint8).max).ravel()

    # sRGB of 1/2 is 187.5 of 255; data stays at a half, which rounds up.
    np.testing.assert_allclose(codes("color"), 188, atol=1e-3)
    np.testing.assert_allclose(codes("data"), 128, atol=0.6)


def test_one_picture_holds_all_levels(tmp_path, rock):
    (file,) = write_mip_levels(rock, tmp_path / "levels.tif", MipOptions(filter="kaiser"))
    picture = read_image(file, color=True).pixels
    chain = mip_chain(read_image(rock, color=True).pixels, filter="kaiser")
    assert picture.shape == (12, 30, 3)
    np.testing.assert_array_equal(picture[:12, :20], chain.level(0))
    np.testing.assert_array_equal(picture[:6, 20:], chain.level(1))
    np.testing.assert_array_equal(picture[6:9, 20:25], chain.level(2))
    assert (picture[-1, 20:] == 0).all()


def test_normals_come_out_as_unit_normals_and_roughness_as_asked(tmp_path):
    tilted = np.zeros((2, 2, 3), np.float32)
    tilted[:, 0], tilted[:, 1] = (0.6, 0.0, 0.8), (-0.6, 0.0, 0.8)
    write_image(tilted / 2 + 0.5, tmp_path / "n.tif", bits=32)
    files = write_mip_levels(
        tmp_path / "n.tif", tmp_path / "levels", MipOptions(kind="normal"),
        roughness=tmp_path / "rough",
    )  # fmt: skip
    assert [file.name for file in files] == [
        "n_0.tif", "n_1.tif", "n_roughness_0.tif", "n_roughness_1.tif",
    ]  # fmt: skip
    mean = read_image(files[1], color=False).pixels[0, 0]
    np.testing.assert_allclose(mean, [0.5, 0.5, 1.0], atol=1e-6)
    np.testing.assert_allclose(read_image(files[2], color=False).pixels, 0.0, atol=0.03)
    rough = read_image(files[3], color=False).pixels.ravel()
    # The mean vector is 0.8 long.
    np.testing.assert_allclose(rough, roughness_of_lengths(np.array([0.8])), atol=1e-6)
    assert read_image(files[3], color=False).pixels.shape == (1, 1, 1)


def test_flat_normals_of_8_bits_stay_the_flat_code(tmp_path):
    flat = np.broadcast_to(np.array([128, 128, 255], np.uint8), (4, 4, 3))
    write_image(flat, tmp_path / "flat.png")
    files = write_mip_levels(tmp_path / "flat.png", tmp_path / "l", MipOptions(kind="normal"))
    assert len(files) == 3
    for file in files:
        codes = read_image(file, color=False).pixels * np.float32(255)
        np.testing.assert_allclose(codes, np.broadcast_to([128, 128, 255], codes.shape), atol=1e-3)


def test_roughness_of_lengths():
    lengths = np.linspace(0, 1, 101)
    rough = roughness_of_lengths(lengths)
    assert (rough[0], rough[-1]) == (1.0, 0.0)
    assert (np.diff(rough) <= 0).all()
    # Normals of a GGX lobe of small alpha: their mean is shortened by alpha² / 2, but for its tail.
    alpha = 0.01
    narrow = roughness_of_lengths(np.array([1 - alpha**2 / 2]))
    np.testing.assert_allclose(narrow, np.sqrt(alpha), rtol=1e-3)
    assert roughness_of_lengths(np.array([1.0001, -0.5])).tolist() == [0.0, 1.0]
