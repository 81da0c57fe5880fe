"""Materials of FBX files: factors, images in the file and beside it, and none from elsewhere."""

import numpy as np
import pytest

from tests.hard_cases.fbx_writer import (
    POINTS,
    binary,
    layer,
    properties,
    rich_scene,
    scene,
    written,
)
from texbake.mesh.files import read_mesh
from texbake.mesh.files.fbx_materials import has_alpha
from texbake.mesh.materials import read_materials
from texbake.texture.image import write_image


@pytest.fixture
def read(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()

    def write_and_read(texture):
        nodes = rich_scene(7400)
        _, _, objects = nodes[1]
        red = next(i for i, node in enumerate(objects) if node[1][0] == 50)
        color = properties(7400, {"DiffuseColor": [0.25, 0.5, 0.75]})
        objects[red] = ("Material", objects[red][1], [color])
        objects.append(("Texture", [60, "paint\0\1Texture", ""], texture))
        nodes[2][2].append(("C", ["OP", 60, 51, "DiffuseColor"], []))
        path = folder / "a.fbx"
        path.write_bytes(binary(nodes))
        return read_materials(path, read_mesh(path))

    return write_and_read


def test_factors_and_images_in_the_file(read):
    found = read([("Content", [b"picture"], [])])
    assert found.names == ("red", "blue")
    assert found.face_materials.tolist() == [0, 0, 1, 1, 0] * 2
    assert found.sources("base-color")[0].factor == (0.25, 0.5, 0.75)
    assert found.sources("base-color")[1].image.data == b"picture"
    # As text files hold it.
    found = read([("Content", [b"cGljdHVyZQ=="], [])])
    assert found.sources("base-color")[1].image.data == b"picture"


# Content of images: a PNG with alpha, one without.
RGBA, RGB = (b"\x89PNG\r\n\x1a\n" + bytes(17) + bytes([kind]) for kind in (6, 2))


@pytest.mark.parametrize(
    "values, alpha",
    [
        ({}, None),
        ({"Opacity": [1.0], "TransparencyFactor": [0.0], "TransparentColor": [1.0] * 3}, None),
        ({"TransparencyFactor": [1.0], "TransparentColor": [0.0] * 3}, None),
        ({"Opacity": [0.25], "TransparencyFactor": [0.0]}, 0.25),
        ({"TransparencyFactor": [0.25]}, 0.75),
        ({"TransparencyFactor": [0.5], "TransparentColor": [0.25, 0.5, 0.75]}, 0.75),
        ({"TransparentColor": [0.25, 0.5, 0.75]}, 0.5),
        ({"Opacity": [-7.0]}, 0.0),
        ({"Opacity": [np.nan], "TransparencyFactor": ["text"]}, None),
    ],
)
def test_opacity(tmp_path, values, alpha):
    nodes = scene(materials=("red",))
    nodes[1][2][-1][2].append(properties(7400, values))
    path = tmp_path / "a.fbx"
    path.write_bytes(binary(nodes))
    (material,) = read_materials(path, read_mesh(path)).materials
    assert material.alpha_mode == ("opaque" if alpha is None else "blend")
    found = material.channels.get("alpha")
    assert found is None if alpha is None else found.factor == pytest.approx((alpha,))


@pytest.mark.parametrize("content, component", [(RGBA, 3), (RGB, 0)])
@pytest.mark.parametrize("name", ["TransparentColor", "TransparencyFactor"])
def test_opacity_of_an_image(tmp_path, name, content, component):
    path = textured_file(tmp_path, {name: {}}, content=content)
    (material,) = read_materials(path, read_mesh(path)).materials
    alpha = material.channels["alpha"]
    assert alpha.factor == (1.0,)
    assert (alpha.image.components, material.alpha_mode) == ((component,), "blend")


def test_images_with_an_alpha_channel_are_known_by_their_headers(tmp_path):
    for suffix, n in ("png", 4), ("png", 3), ("tga", 4), ("tga", 3), ("exr", 3):
        path = tmp_path / f"image.{suffix}"
        write_image(np.ones((4, 4, n), np.float32), path)
        assert has_alpha(path.read_bytes()) == (n == 4), (suffix, n)
    for code, flags in (b"VP8X", bytes(4) + b"\x10"), (b"VP8L", bytes(8) + b"\x10"):
        assert has_alpha(b"RIFF" + bytes(4) + b"WEBP" + code + flags)
        assert not has_alpha(b"RIFF" + bytes(4) + b"WEBP" + code + bytes(len(flags)))


def textured_file(folder, textures, *, layers=(), version=7400, form="binary", content=RGB, **more):
    """Path of a file whose material has a texture for each property, with properties of its own."""
    nodes = scene(version, layers=layers, materials=("red",), **more)
    for i, (name, values) in enumerate(textures.items()):
        children = [properties(version, values), ("Content", [content], [])]
        nodes[1][2].append(("Texture", [60 + i, f"{name}\0\1Texture", ""], children))
        nodes[2][2].append(("C", ["OP", 60 + i, 50, name], []))
    path = folder / "a.fbx"
    path.write_bytes(written(nodes, version, form))
    return path


def uv_layer(index, name, values, indices=None):
    made = layer("LayerElementUV", ("UV", np.array(values, float).ravel()), indices=indices)
    return (made[0], [index], [("Name", [name], []), *made[2]])


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_textures_lie_on_the_sets_that_they_name(tmp_path, form):
    """Sets with rows of their own; textures on some of them, and on one that is not there."""
    rng = np.random.default_rng(1)
    listed = rng.random((11, 2))
    table = rng.random((3, 2))
    rows = rng.integers(0, 3, 11).astype(np.int32)
    layers = [
        uv_layer(0, "map1", np.repeat(POINTS[:1, :2], 11, axis=0)),
        uv_layer(1, "light", table, ("UVIndex", rows)),
        uv_layer(2, "nobody's", listed),
        uv_layer(3, "detail", listed),
    ]
    textures = {
        "DiffuseColor": {"UVSet": ["map1"]},
        "EmissiveColor": {"UVSet": ["light"], "WrapModeU": [1]},
        "NormalMap": {"UVSet": ["detail"], "WrapModeV": [1]},
        "ReflectionFactor": {"UVSet": ["default"]},
    }
    path = textured_file(tmp_path, textures, layers=layers, form=form, content=b"image")
    mesh = read_mesh(path)
    found = read_materials(path, mesh)
    channels = found.materials[0].channels
    numbers = {name: source.image.uv_set for name, source in channels.items()}
    assert numbers == {"base-color": 0, "emissive": 1, "normal": 2, "metallic": 0}
    assert channels["emissive"].image.wraps == ("clamp", "repeat")
    assert channels["normal"].image.wraps == ("repeat", "clamp")
    slots = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]]
    np.testing.assert_array_equal(mesh.corner_uvs(), np.zeros((5, 3, 2)))
    np.testing.assert_allclose(found.uv_sets[1][mesh.uv_faces], table[rows][slots])
    np.testing.assert_allclose(found.uv_sets[2][mesh.uv_faces], listed[slots])
    assert list(found.uv_sets) == [1, 2]


def test_a_set_that_no_texture_names_splits_no_row(tmp_path):
    layers = [uv_layer(i, f"map{i}", np.arange(22.0) * i) for i in range(3)]
    path = textured_file(tmp_path, {"DiffuseColor": {"UVSet": ["map0"]}}, layers=layers)
    mesh = read_mesh(path)
    assert len(mesh.uvs) == 7  # one for each vertex
    assert read_materials(path, mesh).uv_sets == {}


def test_models_that_show_a_set_twice_and_without_one(tmp_path):
    layers = [uv_layer(0, "a", np.zeros(22)), uv_layer(1, "b", np.arange(22.0))]
    models = {"one": ({}, None), "two": ({"Lcl Scaling": [-1.0, 1.0, 1.0]}, None)}
    textures = {"DiffuseColor": {"UVSet": ["b"]}}
    path = textured_file(tmp_path, textures, layers=layers, models=models)
    mesh = read_mesh(path)
    found = read_materials(path, mesh)
    u = found.uv_sets[1][mesh.uv_faces][..., 0]
    np.testing.assert_array_equal(
        u[:5], 2.0 * np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]])
    )
    np.testing.assert_array_equal(np.sort(u[5:], axis=1), u[:5])


def test_a_texture_transform_is_noted(tmp_path):
    textures = {"DiffuseColor": {"Scaling": [2.0, 2.0, 1.0]}, "NormalMap": {"Scaling": [1.0] * 3}}
    path = textured_file(tmp_path, textures)
    found = read_materials(path, read_mesh(path))
    assert [name for name, _ in found.missing] == ["base-color"]
    assert "red: a texture transform is left out" in found.notes(["base-color"])[0]


@pytest.mark.parametrize("name", ["b.png", r"C:\work\b.png", "../b.png", "textures/b.png"])
def test_images_lie_in_the_folder_of_the_file(read, tmp_path, name):
    (tmp_path / "b.png").write_bytes(b"outside")
    texture = [("RelativeFilename", [name], [])]
    found = read(texture)
    assert found.sources("base-color")[1] is None
    assert "blue" in found.notes(["base-color"])[0]
    (tmp_path / "model" / "b.png").write_bytes(b"inside")
    assert read(texture).sources("base-color")[1].image.data == b"inside"
