"""Commands on images: textures baked and packed, channels, mip levels and cube maps converted."""

import json
from pathlib import Path

import numpy as np
import pytest

from texbake import OptionError, read_image, write_image, write_mesh
from texbake.mesh.shapes import plane
from texbake.metadata import CONVENTION, DISPLACEMENT_SCALE
from texbake.verbs.channels import pack_channels_file, split_channels_files

FACES = [f"{name}.hdr" for name in ("nx", "ny", "nz", "px", "py", "pz")]


@pytest.fixture
def shop(workplace):
    """The workplace with images, a plane and cameras."""
    write_image(np.full((16, 24, 3), (1.0, 0.0, 0.0)), "red.png", color=True)
    y, x = np.mgrid[:32, :32] / 32
    hill = 0.5 + 0.25 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    write_image(hill, "hill.png", bits=16)
    write_mesh(plane(), "plane.obj")
    Path("front.toml").write_text("position = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 45\n")
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (8, 12, 3)).astype(np.uint8)
    write_image(noise, "wood.png", color=True)
    write_image(noise, "noisy.png")
    write_image(rng.random((32, 64, 3)).astype(np.float32) * 2, "sky.hdr", color=True)
    write_image(np.full((16, 32, 3), 100, np.uint8), "even.png", color=True)
    return workplace


@pytest.fixture
def codes(workplace):
    """Three 8-bit maps of random codes, as files and as (H, W, 3)."""
    values = np.random.default_rng(5).integers(0, 256, (12, 20, 3), dtype=np.uint8)
    for i, name in enumerate(("ao", "rough", "metal")):
        write_image(values[..., i], f"{name}.png")
    return values


def test_a_photograph_covers_the_faces_in_view(shop, invoke):
    invoke(
        "bake-texture low.obj -o t.png --photo red.png --camera front.toml --size 64 --fill none "
        "--feather 0 --report r.json"
    )
    figures = json.loads(Path("r.json").read_text())
    assert 0 < figures["texels_unseen"] < figures["texels_covered"]
    colors = read_image("t.png", color=True).pixels
    assert set(map(tuple, colors.reshape(-1, 3))) == {(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)}


def test_colors_are_srgb(shop, invoke):
    invoke("bake-texture low.obj -o t.png --procedure noise --colors #336699 --size 16")
    codes = read_image("t.png", color=False).pixels * 255
    np.testing.assert_allclose(codes, np.broadcast_to((0x33, 0x66, 0x99), codes.shape), atol=1e-4)


def test_packed_texels_keep_their_codes(shop, invoke):
    rng = np.random.default_rng(0)
    deep = rng.integers(0, 65536, (20, 12, 3)).astype(np.uint16)
    for name, codes in (
        ("deep", deep),
        ("flat", rng.integers(0, 256, (9, 30, 3)).astype(np.uint8)),
    ):
        write_image(codes, f"{name}.png", color=True)
    invoke("pack-textures deep.png -o a.png --padding 3")
    codes = np.rint(read_image("a.png", color=False).pixels * 65535).astype(int)
    np.testing.assert_array_equal(codes[3:23, 3:15], deep)
    invoke("pack-textures flat.png -o b.png --padding 0 --size 30x9")
    flat = (read_image(name, color=False).pixels for name in ("flat.png", "b.png"))
    np.testing.assert_array_equal(*flat)


def test_heights_come_back_through_files(shop, invoke):
    """Heights to normals to heights: each file records how the next command must read it."""
    invoke("height-to-normal hill.png -o n.png --scale 0.2 --width 1 --convention directx")
    assert read_image("n.png", color=False).metadata[CONVENTION] == "directx"
    invoke("normal-to-height n.png -o h.png --width 1")
    found = read_image("h.png", color=False)
    scale = found.metadata[DISPLACEMENT_SCALE]
    assert isinstance(scale, float)
    y, x = np.mgrid[:32, :32] / 32
    hill = 0.2 * 0.25 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    # The wave of 32 texels comes back as cos²(pi / 32) = 0.990 of itself.
    kept = np.cos(np.pi / 32) ** 2
    heights = found.pixels[..., 0] * scale
    np.testing.assert_allclose(heights - heights.mean(), kept * hill, atol=2e-5)
    invoke("height-to-normal h.png -o again.png --convention directx")
    first, again = (read_image(f"{name}.png", color=False).pixels for name in ("n", "again"))
    assert np.abs(first - again).max() < 0.01


def stored(path):
    image = read_image(path, color=False)
    assert not image.is_float
    return np.rint(image.pixels * (2**image.bits - 1)).astype(int)


def test_codes_come_back_as_they_were(codes, invoke):
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


def test_channels_and_values_are_chosen(codes, invoke):
    write_image(codes, "orm.png")
    invoke("pack-channels --red orm.png:b --green 1 --blue 0.2 --alpha orm.png:g -o x.tif")
    packed = stored("x.tif")
    assert np.array_equal(packed[..., 0], codes[..., 2])
    assert np.array_equal(packed[..., 3], codes[..., 1])
    assert (packed[..., 1:3] == [255, 51]).all()


def test_the_deepest_image_gives_the_bits(codes, invoke):
    deep = np.random.default_rng(6).integers(0, 65536, codes.shape[:2], dtype=np.uint16)
    write_image(deep, "deep.png")
    invoke("pack-channels --red deep.png --green ao.png --blue 0 -o orm.png")
    packed = stored("orm.png")
    assert np.array_equal(packed[..., 0], deep)
    assert np.array_equal(packed[..., 1], codes[..., 0].astype(int) * 257)


def test_floats_beyond_one_are_kept(shop, invoke):
    values = np.random.default_rng(7).normal(size=(4, 5, 3)).astype(np.float32) * 1e5
    write_image(values, "xyz.exr", bits=32)
    invoke("split-channels xyz.exr -o maps")
    maps = [read_image(f"maps/xyz_{name}.exr", color=False) for name in ("red", "green", "blue")]
    assert np.array_equal(np.concatenate([image.pixels for image in maps], axis=2), values)
    invoke("pack-channels --red maps/xyz_red.exr --green maps/xyz_green.exr --blue 0 -o two.exr")
    assert np.array_equal(read_image("two.exr", color=False).pixels[..., :2], values[..., :2])


def test_the_files_are_those_of_the_python_functions(codes, invoke):
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


def test_roughness_of_normals(shop, invoke):
    invoke("mipmap noisy.png -o levels.tif --kind normal --roughness rough")
    rough = [read_image(f"rough/noisy_roughness_{i}.png", color=False).pixels for i in range(4)]
    assert rough[0].max() < 0.05  # every texel alone is smooth
    assert rough[3].min() > 0.9  # noise in all directions is not


def test_to_six_faces_and_back(shop, invoke):
    result = invoke("cubemap sky.hdr -o faces/")
    assert sorted(path.name for path in Path("faces").iterdir()) == FACES
    assert "to    faces of 16 px" in result.stdout
    assert result.stdout.count("wrote ") == 6
    result = invoke("cubemap faces/ -o pano.exr --size 64")
    assert "from  faces\nto    latlong of 64 px\nwrote pano.exr\n" in result.stdout
    assert result.stderr == ""
    back, sky = (read_image(name, color=True).pixels for name in ("pano.exr", "sky.hdr"))
    assert back.shape == (64, 128, 3)
    np.testing.assert_allclose(back.mean(axis=(0, 1)), sky.mean(axis=(0, 1)), rtol=0.05)


def test_one_image_is_a_cross_and_clipping_is_reported(shop, invoke):
    result = invoke("cubemap sky.hdr -o cross.png --size 8 --convention inside")
    assert "warning: cross.png: " in result.stderr
    assert "were clipped; EXR and HDR files keep them" in result.stderr
    assert read_image("cross.png", color=True).pixels.shape == (24, 32, 3)
    result = invoke("cubemap cross.png -o again --convention inside --format tga --quiet")
    assert result.stdout == ""
    assert (shop / "again" / "px.tga").is_file()
