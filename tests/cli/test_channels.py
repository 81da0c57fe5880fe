"""`pack-channels` and `split-channels`: codes are copied, and unclear requests are one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import OptionError
from texbake.texture.image import read_image, write_image
from texbake.verbs.channels import pack_channels_file, split_channels_files

Invoke = Callable[..., Result]


@pytest.fixture
def codes(workplace: Path) -> np.ndarray:
    """Three 8-bit maps of random codes, as files and as (H, W, 3)."""
    values = np.random.default_rng(5).integers(0, 256, (12, 20, 3), dtype=np.uint8)
    for i, name in enumerate(("ao", "rough", "metal")):
        write_image(values[..., i], f"{name}.png")
    return values


def stored(path: str) -> np.ndarray:
    image = read_image(path, color=False)
    assert not image.is_float
    return np.rint(image.pixels * (2**image.bits - 1)).astype(int)


def test_codes_come_back_as_they_were(codes: np.ndarray, invoke: Invoke) -> None:
    result = invoke("pack-channels --red ao.png --green rough.png --blue metal.png -o orm.png")
    assert "20 x 12" in result.stdout
    assert read_image("orm.png", color=False).bits == 8
    assert np.array_equal(stored("orm.png"), codes)
    invoke("split-channels orm.png -o maps --names occlusion,,metallic")
    assert sorted(path.name for path in Path("maps").iterdir()) == [
        "orm_metallic.png",
        "orm_occlusion.png",
    ]
    metallic = read_image("maps/orm_metallic.png", color=False)
    assert metallic.pixels.shape[2] == 1 and metallic.bits == 8
    assert np.array_equal(stored("maps/orm_metallic.png")[..., 0], codes[..., 2])


def test_channels_and_values_are_chosen(codes: np.ndarray, invoke: Invoke) -> None:
    write_image(codes, "orm.png")
    invoke("pack-channels --red orm.png:b --green 1 --blue 0.2 --alpha orm.png:g -o x.tif")
    packed = stored("x.tif")
    assert np.array_equal(packed[..., 0], codes[..., 2])
    assert np.array_equal(packed[..., 3], codes[..., 1])
    assert (packed[..., 1:3] == [255, 51]).all()


def test_the_deepest_image_gives_the_bits(codes: np.ndarray, invoke: Invoke) -> None:
    deep = np.random.default_rng(6).integers(0, 65536, codes.shape[:2], dtype=np.uint16)
    write_image(deep, "deep.png")
    invoke("pack-channels --red deep.png --green ao.png --blue 0 -o orm.png")
    packed = stored("orm.png")
    assert np.array_equal(packed[..., 0], deep)
    assert np.array_equal(packed[..., 1], codes[..., 0].astype(int) * 257)


def test_floats_beyond_one_are_kept(workplace: Path, invoke: Invoke) -> None:
    values = np.random.default_rng(7).normal(size=(4, 5, 3)).astype(np.float32) * 1e5
    write_image(values, "xyz.exr", bits=32)
    invoke("split-channels xyz.exr -o maps")
    maps = [read_image(f"maps/xyz_{name}.exr", color=False) for name in ("red", "green", "blue")]
    assert np.array_equal(np.concatenate([image.pixels for image in maps], axis=2), values)
    invoke("pack-channels --red maps/xyz_red.exr --green maps/xyz_green.exr --blue 0 -o two.exr")
    assert np.array_equal(read_image("two.exr", color=False).pixels[..., :2], values[..., :2])


def test_the_files_are_those_of_the_python_functions(codes: np.ndarray, invoke: Invoke) -> None:
    invoke("pack-channels --red ao.png --green rough.png --blue 0 -o a.png")
    done = pack_channels_file("b.png", "ao.png", Path("rough.png"), 0)
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()
    assert done.files == (Path("b.png"),)
    split_channels_files("b.png", ["r.png", "g.png"], names=["x", "y"])
    assert np.array_equal(stored("g.png")[..., 0], codes[..., 1])
    with pytest.raises(OptionError, match="1 file is given for 3 channels"):
        split_channels_files("b.png", ["r.png"])
    split_channels_files("ao.png", "gray")
    assert [path.name for path in Path("gray").iterdir()] == ["ao_gray.png"]
    with pytest.raises(OptionError, match="names: 4 are given"):
        split_channels_files("b.png", ["r.png"], names=["x", "", "", "y"])
