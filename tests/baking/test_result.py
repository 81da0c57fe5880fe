"""Maps as files: in every encoding, values are read as they were written; and maps without use."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import BakeOptions, FileError, OptionError, bake, read_image, write_mesh
from texbake.baking.maps import MAP_NAMES
from texbake.baking.result import redundant_maps
from texbake.errors import FileFormatError
from texbake.jobs.maps import bake_files
from texbake.mesh.materials import ChannelSource, Materials, MeshMaterial
from texbake.mesh.shapes import orange, plane, uv_sphere
from texbake.metadata import (
    CURVATURE_MID,
    CURVATURE_SCALE,
    DISPLACEMENT_MID,
    DISPLACEMENT_SCALE,
    ID,
    POSITION_MAX,
    POSITION_MIN,
    SPACE,
    THICKNESS_SCALE,
)
from texbake.texture.encoding import decode_heights, encode_srgb


@pytest.fixture(scope="module")
def every(painted):
    """All maps of a model that is not at the origin."""
    high, low, materials = painted
    high, low = (mesh.replace(positions=3.0 * mesh.positions - [0, 2, 9]) for mesh in (high, low))
    options = BakeOptions(maps=MAP_NAMES, size=(48, 32), padding=0, secondary_rays=4)
    return bake(high, low, options, materials=materials).maps


def decoded(item, image, bits):
    """The values of a map in a file, and the step from one code to the next."""
    pixels, data, coding = image.pixels.astype(np.float64), image.metadata, item.kind.coding
    if coding == "normal":
        return 2.0 * pixels - 1.0, 2.0
    if coding in ("height", "vector"):
        mid, scale = data[DISPLACEMENT_MID], data[DISPLACEMENT_SCALE]
        assert bits == 32 or scale < 2.1 * np.abs(item.values).max()
        return decode_heights(pixels, mid=mid, scale=scale), scale
    if coding == "curvature":
        mid, scale = data[CURVATURE_MID], data[CURVATURE_SCALE]
        return decode_heights(pixels, mid=mid, scale=scale), scale
    if coding == "thickness":
        return pixels * data[THICKNESS_SCALE], data[THICKNESS_SCALE]
    if coding == "position" and POSITION_MIN in data:
        least, greatest = (
            np.array([float(word) for word in data[key].split()])
            for key in (POSITION_MIN, POSITION_MAX)
        )
        return least + pixels * (greatest - least), greatest - least
    if coding == "id" and pixels.shape[2] == 3:
        codes = np.rint(255.0 * pixels).astype(int)
        ids = np.zeros(pixels.shape[:2])
        for key, name in data.items():
            color = bytes.fromhex(key.removeprefix(f"{ID}#"))
            ids[(codes == list(color)).all(axis=2)] = item.legend.index(name) + 1
        return ids[:, :, None], 0.0
    return pixels, 1.0


# Half a code, or float32 of values of about 10, or 11 bits of half floats.
@pytest.mark.parametrize(
    ("suffix", "bits"),
    [("png", 8), ("png", 16), ("tif", 8), ("tif", 16), ("tif", 32), ("tga", 8), ("exr", 16),
     ("exr", 32)],
)  # fmt: skip
def test_every_map_comes_back_within_half_a_step(every, tmp_path, suffix, bits):
    is_float = suffix == "exr" or bits == 32
    for name, item in every.items():
        path = tmp_path / f"{name}.{suffix}"
        written = item.write(path, bits=bits)
        image = read_image(path, color=False)
        assert (written.bits, written.n_clipped) == (bits, 0)
        assert image.metadata == written.metadata, name
        without = replace(item, options=replace(item.options, bits=bits)).as_read(path)
        np.testing.assert_array_equal(without.pixels, image.pixels)
        assert replace(without, pixels=image.pixels) == image
        values, step = decoded(item, image, 32 if is_float else bits)
        expected, tolerance = item.values.astype(np.float64), 4e-6
        if is_float:
            tolerance += (2.0**-11 if bits == 16 else 1e-6) * max(1.0, np.abs(expected).max())
        elif item.kind.coding == "color":
            expected = encode_srgb(np.clip(expected, 0.0, 1.0))
            tolerance += 0.501 / (2**bits - 1)
        else:
            tolerance = tolerance + step * 0.501 / (2**bits - 1)
        if item.kind.coding == "curvature" and not is_float:  # the rarest texels are clipped
            white = (1.0 - image.metadata[CURVATURE_MID]) * image.metadata[CURVATURE_SCALE]
            clipped = np.abs(expected) > white
            assert clipped[item.has_data].mean() <= 0.011
            assert clipped.any() or name != "curvature"
            values[clipped], expected[clipped] = 0.0, 0.0
        off = np.abs(values - expected)[item.has_data]
        assert (off <= tolerance).all(), (name, off.max())


def test_files_name_the_space_of_their_values(every, tmp_path):
    spaces = dict.fromkeys(("normal", "bent-normal", "vector-displacement"), "tangent")
    spaces |= {"position": "object", "world-position": "world"}
    low, high = (every["position"].bounds[i] for i in (0, 1))
    written = every["position"].write(tmp_path / "a.png").metadata
    for key, corner in (POSITION_MIN, low), (POSITION_MAX, high):
        assert [float(word) for word in written[key].split()] == corner.tolist()
    for name, space in spaces.items():
        for suffix in "png", "exr":
            assert every[name].write(tmp_path / f"a.{suffix}").metadata[SPACE] == space
    assert np.array_equal(every["position"].values, every["world-position"].values)


def test_given_mid_and_scale_are_used_and_clipped_values_are_counted(every, tmp_path):
    displacement = every["displacement"]
    written = displacement.write(tmp_path / "d.png", mid=0.25, scale=0.1)
    assert written.metadata == {DISPLACEMENT_MID: 0.25, DISPLACEMENT_SCALE: 0.1}
    below = (displacement.values < -0.025) & displacement.has_data[..., None]
    above = (displacement.values > 0.075) & displacement.has_data[..., None]
    assert written.n_clipped == below.sum() + above.sum() > 0
    image = read_image(tmp_path / "d.png", color=False)
    assert (image.pixels[below] == 0).all()
    curvature = every["curvature"]
    white = replace(curvature, options=replace(curvature.options, curvature_scale=100.0))
    levels = white.write(tmp_path / "c.png").metadata
    assert (1.0 - levels[CURVATURE_MID]) * levels[CURVATURE_SCALE] == pytest.approx(100.0)


def test_write_takes_from_the_options_what_is_not_given(tmp_path):
    high = plane(20, 20, lambda x, y: 0.02 * np.sin(5 * x + 4 * y))
    options = BakeOptions(size=16, bits=8, convention="directx")
    normal = bake(high, plane(), options).maps["normal"]
    assert normal.write(tmp_path / "a.png").bits == 8
    assert normal.write(tmp_path / "b.png", convention="directx", bits=8)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(("name", "bits", "error"), [
    ("n.tga", 16, OptionError), ("n.png", 32, OptionError), ("n.gif", None, FileFormatError),
    ("n.jpg", 8, OptionError), ("n", None, FileFormatError), ("missing/n.png", None, FileError),
])  # fmt: skip
def test_a_map_that_a_format_cannot_hold_is_one_clear_error(every, tmp_path, name, bits, error):
    with pytest.raises(error) as raised:
        every["normal"].write(tmp_path / name, bits=bits)
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


BALL = uv_sphere(16, 32)


def sentences(high, *maps, materials=None, **given):
    options = BakeOptions(maps=maps, size=32, secondary_rays=16, **given)
    found = bake(high, BALL, options, materials=materials).maps
    told = dict(line.split(": ", 1) for line in redundant_maps(found, 2.0))
    return {name: words.split(" at ")[0].split(";")[0] for name, words in told.items()}


def test_a_mesh_baked_onto_itself_needs_no_map():
    same = "it has no effect"
    names = ("normal", "displacement", "ao", "opacity")
    assert sentences(BALL, *names) == dict.fromkeys(names, same)


def test_maps_that_show_something_are_not_told():
    assert sentences(orange(20_000), "normal", "displacement", "ao") == {}
    # Normals of an object are not those of a material, even where they are all the same.
    flat = bake(plane(), plane(), BakeOptions(size=16, space="object")).maps
    assert list(redundant_maps(flat, 2.0)) == []
    assert list(sentences(BALL, "displacement", space="object")) == ["displacement"]


def test_one_value_everywhere_is_a_factor():
    gray = MeshMaterial(
        name="gray",
        channels={
            "base-color": ChannelSource(factor=(0.25, 0.5, 1.0)),
            "roughness": ChannelSource(factor=(0.5,)),
        },
    )
    materials = Materials(materials=(gray,), face_materials=np.zeros(BALL.n_faces, np.int32))
    found = sentences(BALL, "base-color", "roughness", materials=materials)
    assert found == {"base-color": "every texel is 0.25, 0.5, 1", "roughness": "every texel is 0.5"}


@pytest.mark.parametrize("high", ["same", "orange"])
def test_the_job_passes_them_on(tmp_path, high):
    write_mesh(BALL, tmp_path / "low.obj")
    write_mesh(BALL if high == "same" else orange(20_000), tmp_path / "high.obj")
    done = bake_files(
        tmp_path / "high.obj", tmp_path / "low.obj", {"normal": tmp_path / "n.png"},
        BakeOptions(size=32),
    )  # fmt: skip
    told = [line for line in done.warnings if line.startswith("normal: it has no effect")]
    assert len(told) == (high == "same")
