"""Each map without secondary rays against closed forms and exact counts."""

from pathlib import Path

import numpy as np
import pytest

from texbake import (
    BakeOptions,
    Mesh,
    OptionError,
    bake,
    read_image,
    read_mesh,
    write_image,
    write_mesh,
)
from texbake.baking.codings import id_colors
from texbake.baking.maps import DEFAULT_PATTERN, MAP_NAMES, MAPS, map_file_names
from texbake.errors import MeshError
from texbake.mesh.files.conversion import linear_colors
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.shapes import plane, uv_sphere
from texbake.texture.encoding import decode_srgb

N = 64
CENTERS = (np.arange(N) + 0.5) / N


def baked(high, *maps, low=None, materials=None, **options):
    low = plane() if low is None else low
    chosen = BakeOptions(**{"size": N, "maps": maps, "padding": 0, **options})
    return bake(high, low, chosen, materials=materials).maps


def halves(**fields_):
    """A square of 8 x 8 in two groups, left and right of x = 1/2."""
    mesh = plane(8, 8)
    centers = mesh.positions[mesh.faces].mean(axis=1)
    groups = (centers[:, 0] > 0.5).astype(np.int32)
    return mesh.replace(face_groups=groups, group_names=("left", "right"), **fields_)


@pytest.mark.parametrize("name", MAP_NAMES)
def test_every_map_is_declared_as_its_channel_is(name):
    kind = MAPS[name]
    assert kind.plain is None or len(kind.plain) == kind.channels
    assert kind.is_channel == (name in CHANNELS and name != "normal")
    if kind.is_channel:  # black for colors, so that nothing looks like data, else the default
        channel = CHANNELS[name]
        black = (0.0, 0.0, 0.0)
        assert kind.neutral(BakeOptions()) == (black if channel.is_color else channel.default)
        assert (kind.coding == "color") == channel.is_color


# Position


def test_a_flat_position_is_exact():
    high = plane(5, 5, lambda x, y: 0.125 + 0.0 * x)
    values = baked(high, "position")["position"].values
    u, v = np.meshgrid(CENTERS, CENTERS[::-1])
    # Weights on faces are float32: half a unit in its last place at 1 is 6e-8.
    np.testing.assert_allclose(values[:, :, 0], u, atol=6e-8)
    np.testing.assert_allclose(values[:, :, 1], v, atol=6e-8)
    # Offsets are measured in float64 and kept in float32, which holds 1/8 exactly.
    np.testing.assert_array_equal(values[:, :, 2], np.float32(0.125))


# Curvature


def test_a_sphere_bends_by_one_over_its_radius():
    radius = 4.0
    high = uv_sphere(96, 192).replace(positions=radius * uv_sphere(96, 192).positions)
    low = uv_sphere(12, 24).replace(positions=radius * uv_sphere(12, 24).positions)
    maps = baked(high, "curvature", "convexity", "concavity", low=low, size=128)
    found = maps["curvature"].values[maps["curvature"].has_data]
    # The triangles about the poles are off by 1 %; see the tests of the estimate itself.
    np.testing.assert_allclose(found, 1.0 / radius, rtol=1e-2)
    assert np.median(found) == pytest.approx(1.0 / radius, rel=1e-3)
    assert np.array_equal(maps["convexity"].values, maps["curvature"].values)
    assert not maps["concavity"].values.any()


def test_convexity_and_concavity_are_the_halves_of_curvature():
    high = plane(48, 48, lambda x, y: 0.02 * np.sin(20 * x) * np.sin(15 * y))
    maps = baked(high, "curvature", "convexity", "concavity")
    values = {name: item.values for name, item in maps.items()}
    assert values["curvature"].min() < 0.0 < values["curvature"].max()
    assert np.array_equal(values["convexity"] - values["concavity"], values["curvature"])
    assert values["convexity"].min() == values["concavity"].min() == 0.0


@pytest.mark.parametrize(("bits", "flat"), [(8, 128), (16, 32768)])
def test_flat_is_the_middle_code(tmp_path, bits, flat):
    baked(plane(4, 4), "curvature")["curvature"].write(tmp_path / "c.png", bits=bits)
    pixels = read_image(tmp_path / "c.png", color=False).pixels
    assert (np.rint(pixels * (2**bits - 1)) == flat).all()


# Ids


def test_ids_count_exactly_the_texels_of_each_group():
    values = baked(halves(), "object-id")["object-id"].values[:, :, 0]
    assert np.array_equal(values[:, : N // 2], np.ones((N, N // 2)))
    assert np.array_equal(values[:, N // 2 :], np.full((N, N // 2), 2.0))


def test_more_ids_than_half_floats_can_hold_are_an_error(tmp_path):
    mesh = plane(40, 40)
    high = mesh.replace(
        face_groups=np.arange(3200, dtype=np.int32), group_names=tuple(map(str, range(3200)))
    )
    item = baked(high, "object-id")["object-id"]
    with pytest.raises(OptionError, match="half floats cannot hold 3,200"):
        item.write(tmp_path / "id.exr", bits=16)
    item.write(tmp_path / "id.exr")
    ids = read_image(tmp_path / "id.exr", color=False).pixels
    assert len(np.unique(ids)) == 3200 - np.count_nonzero(
        ~np.isin(np.arange(1, 3201), np.unique(item.values))
    )


@pytest.mark.parametrize("n", [1, 7, 423, 1024, 5000])
def test_colors_of_ids_are_all_different(n):
    colors = id_colors(n)
    assert colors.shape == (n + 1, 3)
    assert colors[0].tolist() == [0, 0, 0]
    assert len(np.unique(colors, axis=0)) == n + 1


def test_a_mesh_without_groups_has_one_id():
    item = baked(plane(), "object-id")["object-id"]
    assert item.legend == ("plane",)
    assert (item.values == 1.0).all()


def test_material_ids_differ_from_group_ids():
    high = halves()
    ids = (high.positions[high.faces].mean(axis=1)[:, 1] > 0.5).astype(np.int32)
    above = MeshMaterial(name="above", channels={"base-color": ChannelSource((0.5, 0.0, 1.0))})
    materials = Materials(face_materials=ids, materials=(MeshMaterial(name="below"), above))
    maps = baked(high, "material-id", "object-id", "base-color", materials=materials)
    assert maps["material-id"].legend == ("below", "above")
    assert (maps["material-id"].values[: N // 2] == 2.0).all()
    assert (maps["material-id"].values[N // 2 :] == 1.0).all()
    assert (maps["base-color"].values[: N // 2] == (0.5, 0.0, 1.0)).all()
    assert (maps["base-color"].values[N // 2 :] == 1.0).all()
    assert np.array_equal(
        baked(high, "material-id")["material-id"].values, maps["object-id"].values
    )


# Colors


def ramp(mesh):
    """Vertex colors that grow evenly: x, y, and 1/4 everywhere."""
    x, y, _ = mesh.positions.T
    return np.stack([x, y, np.full_like(x, 0.25)], axis=1).astype(np.float32)


def test_linear_vertex_colors_are_baked_unchanged():
    high = plane(16, 16).replace(colors=ramp(plane(16, 16)))
    values = baked(high, "vertex-color", vertex_colors="linear")["vertex-color"].values
    u, v = np.meshgrid(CENTERS, CENTERS[::-1])
    # float32 of the weights, the colors and the result, up to 1.
    np.testing.assert_allclose(values, np.stack([u, v, 0.25 + 0 * u], axis=2), atol=2e-7)


def test_vertex_colors_of_scans_keep_their_codes(tmp_path):
    codes = np.uint8([[200, 30, 7]] * 4)
    high = plane().replace(colors=linear_colors(codes))
    item = baked(high, "vertex-color")["vertex-color"]
    assert item.write(tmp_path / "c.png").bits == 8
    stored = np.rint(read_image(tmp_path / "c.png", color=False).pixels * 255.0)
    assert (stored == codes[0]).all()


@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_options_say_how_the_file_codes_vertex_colors(tmp_path, suffix):
    colors = linear_colors(np.uint8([[60, 60, 60]] * 4))
    write_mesh(plane().replace(colors=colors), tmp_path / f"a{suffix}")
    high = read_mesh(tmp_path / f"a{suffix}")
    stored = 60 / 255 if suffix == ".ply" else colors[0, 0]
    expected = {"auto": colors[0, 0], "linear": stored, "srgb": decode_srgb(stored)}
    for coding, value in expected.items():
        found = baked(high, "vertex-color", vertex_colors=coding)["vertex-color"].values
        np.testing.assert_allclose(found, value, rtol=1e-5)


def image_bytes(tmp_path, pixels):
    write_image(pixels, tmp_path / "image.png", color=True)
    return (tmp_path / "image.png").read_bytes()


def textured(tmp_path, pixels, *, channel="base-color", factor=(1.0, 1.0, 1.0), **changes):
    mesh = plane(4, 4)
    image = ChannelImage(data=image_bytes(tmp_path, pixels), **changes)
    material = MeshMaterial(name="a", channels={channel: ChannelSource(factor, image)})
    return mesh, Materials(face_materials=np.zeros(mesh.n_faces, np.int32), materials=(material,))


def test_a_linear_ramp_is_interpolated_in_linear_light(tmp_path):
    levels = np.linspace(0.0, 1.0, 9, dtype=np.float32)  # texels 1/9 wide
    write_image(np.repeat(levels[None, :, None], 3, axis=2), tmp_path / "ramp.exr", bits=32)
    mesh = plane(4, 4)
    materials = Materials.of_image(mesh, tmp_path / "ramp.exr")
    values = baked(mesh, "base-color", materials=materials)["base-color"].values
    inside = (CENTERS > 1 / 18) & (CENTERS < 17 / 18)
    expected = (CENTERS[inside] * 9 - 0.5) / 8
    np.testing.assert_allclose(values[5, inside, 1], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "message"),
    [("vertex-color", "no vertex colors"), ("base-color", "names no base color")],
)
def test_a_mesh_without_colors_is_one_clear_error(name, message):
    with pytest.raises(MeshError, match=message):
        baked(plane(), name)


def test_an_image_needs_texture_coordinates(tmp_path):
    high, materials = textured(tmp_path, np.zeros((2, 2, 3), dtype=np.float32))
    bare = Mesh(positions=high.positions, faces=high.faces)
    with pytest.raises(MeshError, match="no texture coordinates"):
        baked(bare, "base-color", materials=materials)


# Opacity


def strip(right):
    """The part of the unit square left of a line."""
    return Mesh(
        positions=[[0, 0, 0], [right, 0, 0], [right, 1, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]]
    )


@pytest.mark.parametrize(("samples", "share"), [(1, 0.0), (4, 0.5), (16, 0.5), (64, 0.375)])
def test_opacity_is_the_share_of_samples_that_hit(samples, share):
    # The high-poly mesh ends 0.4 of the way through texels 10; samples lie at (i + 1/2) / side.
    high = strip((10 + 0.4) / 32)
    item = baked(high, "opacity", size=32, samples=samples, front=0.1, back=0.1)["opacity"]
    assert (item.values[:, :10] == 1.0).all() and (item.values[:, 10] == share).all()
    assert (item.values[:, 11:] == 0.0).all()


def test_padding_of_opacity_repeats_holes_too():
    low = plane().replace(uvs=0.25 + 0.5 * plane().uvs)
    item = baked(strip(0.5), "opacity", low=low, padding=4, front=0.1, back=0.1)["opacity"]
    # Above the chart: over the strip opaque, over the hole as empty as that.
    assert (item.values[13:16, 20:30] == 1.0).all()
    assert (item.values[13:16, 34:44] == 0.0).all()


def test_opacity_needs_a_fixed_number_of_samples():
    with pytest.raises(OptionError, match="opacity counts misses"):
        baked(plane(), "opacity", "normal", samples="adaptive")


# All maps


def test_the_page_of_the_maps_has_a_row_for_each():
    page = (Path(__file__).parents[2] / "docs" / "reference" / "maps.md").read_text("utf-8")
    rows = [line.split("`")[1] for line in page.splitlines() if line.startswith("| `")]
    assert rows == list(MAP_NAMES)
    channels = [line.split("|")[2].strip() for line in page.splitlines() if line.startswith("| `")]
    assert channels == [str(kind.channels) for kind in MAPS.values()]


def test_adaptive_samples_keep_ids_whole():
    dents = plane(64, 64, lambda x, y: 0.01 * np.sin(40 * x) * np.sin(40 * y))
    groups = (dents.positions[dents.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
    high = dents.replace(face_groups=groups, group_names=("left", "right"))
    maps = baked(high, "normal", "object-id", size=21, samples="adaptive")
    assert set(np.unique(maps["object-id"].values).tolist()) == {1.0, 2.0}
    assert (maps["object-id"].values[:, :10] == 1.0).all()
    assert (maps["object-id"].values[:, 11:] == 2.0).all()


def names(pattern, *maps, **changes):
    return map_file_names(
        pattern, **{"asset": "orc low", "maps": maps, "ext": "exr", "udim": 1012, **changes}
    )


def test_files_have_the_names_of_the_maps_by_default():
    assert names(DEFAULT_PATTERN, "normal", "ao") == {"normal": "normal.exr", "ao": "ao.exr"}


@pytest.mark.parametrize(("pattern", "name"), [
    ("{asset}_{map}_{udim}.{ext}", "orc low_normal_1012.exr"),
    ("T_{asset}_{map}.{ext}", "T_orc low_normal.exr"),
    ("{{x}}{map}.{ext}", "{x}normal.exr"),
    ("{udim:05d}.{ext}", "01012.exr"),
])  # fmt: skip
def test_fields_are_replaced(pattern, name):
    assert names(pattern, "normal") == {"normal": name}


@pytest.mark.parametrize(("pattern", "message"), [
    ("{mesh}.{ext}", r"\{mesh\} is not known"),
    ("{}.{ext}", "is not known"),
    ("{map.x}.{ext}", "is not known"),
    ("{map.{ext}", "cannot be parsed"),
    ("{map}.png", r"must end with \.\{ext\}"),
    ("{asset}/{map}.{ext}", "names a folder"),
    ("{asset}.{ext}", "two maps the same name"),
])  # fmt: skip
def test_wrong_patterns(pattern, message):
    with pytest.raises(OptionError, match=message):
        names(pattern, "normal", "ao")
