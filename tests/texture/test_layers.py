"""EXR files of several layers."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake.errors import FileError, FileFormatError, OptionError
from texbake.texture.image import Image, write_image
from texbake.texture.layers import read_layers, write_layers


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.exr"


@pytest.fixture
def layers():
    rng = np.random.default_rng(0)
    return {
        "normal": Image(
            pixels=rng.random((6, 5, 3), np.float32).astype(np.float16).astype(np.float32),
            bits=16, metadata={"texbake:space": "tangent"},
        ),
        "displacement": Image(
            pixels=rng.random((6, 5, 1), np.float32) * 1e-7 - 1e6,
            metadata={"texbake:displacement_scale": 0.1},
        ),
        "base-color": Image(pixels=np.ones((6, 5, 4), np.float32), bits=8),
        "gray": Image(pixels=rng.random((6, 5, 2), np.float32)),
    }  # fmt: skip


def test_layers_come_back_with_their_metadata(path, layers):
    write_layers(layers, path)
    back = read_layers(path)
    assert back.keys() == layers.keys()
    for name, image in layers.items():
        np.testing.assert_array_equal(back[name].pixels, image.pixels)
        assert back[name].metadata == image.metadata
        assert back[name].bits == (32 if image.bits == 32 else 16)


def test_channels_are_named_after_their_layer(path, layers):
    write_layers(layers, path)
    spec = oiio.ImageInput.open(str(path)).spec()
    kinds = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    assert kinds == {
        "normal.R": "half", "normal.G": "half", "normal.B": "half", "displacement.Y": "float",
        "base-color.R": "half", "base-color.G": "half", "base-color.B": "half",
        "base-color.A": "half", "gray.Y": "float", "gray.A": "float",
    }  # fmt: skip


def test_an_image_without_layers_is_the_layer_without_a_name(path):
    pixels = np.linspace(0, 1, 60, dtype=np.float32).reshape(4, 5, 3)
    write_image(pixels, path, bits=32, metadata={"texbake:space": "object"})
    (layer,) = read_layers(path).items()
    assert layer[0] == ""
    np.testing.assert_array_equal(layer[1].pixels, pixels)
    assert layer[1].metadata == {"texbake:space": "object"}


def test_invalid_layers_are_an_error(tmp_path, path, layers):
    small = {"a": Image(pixels=np.zeros((2, 3, 1), np.float32))}
    for wrong, message in (
        ({}, "there is no layer"),
        (layers | small, r"differ in size \(3 x 2, 5 x 6\)"),
        ({"a.b": small["a"]}, "'a.b' is not a layer name"),
        ({"a": Image(pixels=np.full((1, 1, 1), 1e6, np.float32), bits=16)}, "beyond half"),
        ({"a": Image(pixels=np.zeros((1, 1, 5), np.float32))}, "more than four channels"),
    ):
        with pytest.raises(OptionError, match=message):
            write_layers(wrong, path)
    with pytest.raises(FileFormatError, match=r"give a \.exr file"):
        write_layers(small, tmp_path / "a.png")
    assert not path.exists()


def test_a_damaged_file_is_one_clear_line(path, layers):
    with pytest.raises(FileError):
        read_layers(path)
    write_layers(layers, path)
    data = path.read_bytes()
    for length in 0, 10, len(data) // 2, len(data) - 20:
        path.write_bytes(data[:length])
        with pytest.raises(FileFormatError) as error:
            read_layers(path)
        assert "\n" not in str(error.value)
