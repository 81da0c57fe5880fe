"""Materials of FBX files: factors, images in the file and beside it, and none from elsewhere."""

import numpy as np
import pytest

from tests.fbx_writer import POINTS, binary, layer, properties, rich_scene, scene, written
from texbake.limits import file_beside
from texbake.mesh.files import fbx_materials, read_mesh, write_mesh
from texbake.mesh.files.contents import read_contents
from texbake.mesh.files.fbx_materials import has_alpha
from texbake.mesh.materials import UNPLACED, read_materials
from texbake.texture.image import write_image


def materials_of(folder, nodes, version=7400):
    """The materials of a binary file of some nodes."""
    path = folder / "a.fbx"
    path.write_bytes(binary(nodes, version))
    return read_materials(path, read_mesh(path))


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
        return materials_of(folder, nodes)

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


def test_animated_colors_are_no_images(tmp_path):
    nodes = rich_scene(7400)
    objects, connections = nodes[1][2], nodes[2][2]
    objects.append(("AnimationCurveNode", [60, "DiffuseColor\0\1AnimCurveNode", ""], []))
    objects.append(("Texture", [61, "paint\0\1Texture", ""], [("Content", [b"picture"], [])]))
    connections += [("C", ["OP", key, 51, "DiffuseColor"], []) for key in (60, 61)]
    found = materials_of(tmp_path, nodes)
    (source,) = filter(None, found.sources("base-color"))
    assert source.image.data == b"picture"
    assert not found.missing


def test_textures_of_models_are_warned_of(tmp_path):
    nodes = scene(6100, materials=("red",))
    nodes[1][2].append(("Texture", ["paint\0\1Texture", ""], [("Content", [b"picture"], [])]))
    nodes[2][2].append(("Connect", ["OO", "paint\0\1Texture", "wall\0\1Model"], []))
    found = materials_of(tmp_path, nodes, 6100)
    line = "textures of models are not read, only those of materials"
    assert found.missing == (("base-color", line),)


def test_images_of_one_name_are_two(tmp_path):
    nodes = rich_scene(7400)
    objects, connections = nodes[1][2], nodes[2][2]
    for i, (material, content) in enumerate(((50, b"picture"), (51, b"other"))):
        texture = [("Content", [content], [])]
        objects.append(("Texture", [60 + i, "paint\0\1Texture", ""], texture))
        connections.append(("C", ["OP", 60 + i, material, "DiffuseColor"], []))
    sources = materials_of(tmp_path, nodes).sources("base-color")
    assert {source.image.data: source.image.name for source in sources if source} == {
        b"picture": f"{tmp_path / 'a.fbx'}: paint", b"other": f"{tmp_path / 'a.fbx'}: paint (61)"
    }  # fmt: skip


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
    (material,) = materials_of(tmp_path, nodes).materials
    assert material.alpha_mode == ("opaque" if alpha is None else "blend")
    found = material.channels.get("alpha")
    assert found is None if alpha is None else found.factor == pytest.approx((alpha,))


@pytest.mark.parametrize("default, alpha", [(0.0, None), (0.5, 0.5)])
def test_a_color_of_transparency_is_multiplied_by_the_factor_of_the_defaults(
    tmp_path, default, alpha
):
    nodes = scene(materials=("red",))
    nodes[1][2][-1][2].append(properties(7400, {"TransparentColor": [1.0] * 3}))
    values = properties(7400, {"TransparencyFactor": [default]})
    template = ("PropertyTemplate", ["FbxSurfacePhong"], [values])
    nodes.append(("Definitions", [], [("ObjectType", ["Material"], [template])]))
    (material,) = materials_of(tmp_path, nodes).materials
    found = material.channels.get("alpha")
    assert found is None if alpha is None else found.factor == (alpha,)


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


def textured_file(
    folder, textures, *, form="binary", content=RGB, creator=b"", layered=False, **more
):
    """Path of a file whose material has a texture for each property, layered if asked."""
    version = 7400
    nodes = [("Creator", [creator], []), *scene(version, materials=("red",), **more)]
    objects, connections = (node[2] for node in nodes if node[0] in ("Objects", "Connections"))
    for i, (name, values) in enumerate(textures.items()):
        children = [properties(version, values), ("Content", [content], [])]
        objects.append(("Texture", [60 + i, f"{name}\0\1Texture", ""], children))
        if layered:
            objects.append(("LayeredTexture", [160 + i, "layers\0\1LayeredTexture", ""], []))
            objects.append(("Texture", [260 + i, "over\0\1Texture", ""], []))
            connections.append(("C", ["OO", 60 + i, 160 + i], []))
            connections.append(("C", ["OO", 260 + i, 160 + i], []))
        owned = 160 + i if layered else 60 + i
        connections.append(("C", ["OP", owned, 50, name], []))
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


def moved(path):
    """The matrix that takes texture coordinates to those of the image of the base color."""
    (material,) = read_materials(path, read_mesh(path)).materials
    return np.array(material.channels["base-color"].image.placing)


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_textures_scale_turn_and_move_coordinates(tmp_path, form):
    values = {
        "Translation": [0.1, 0.2, 0.0],
        "Rotation": [0.0, 0.0, 90.0],
        "Scaling": [2.0, 3.0, 1.0],
        "TextureRotationPivot": [0.5, 0.25, 0.0],
        "TextureScalingPivot": [1.0, 0.5, 0.0],
    }
    textures = {"DiffuseColor": values}
    found = moved(textured_file(tmp_path, textures, form=form, content=b"image"))
    for u, v in ((0.0, 0.0), (0.3, 0.9), (1.0, 1.0)):
        x, y = 1.0 + 2.0 * (u - 1.0), 0.5 + 3.0 * (v - 0.5)
        x, y = 0.5 - (y - 0.25), 0.25 + (x - 0.5)  # a quarter turn about the pivot
        np.testing.assert_allclose(found @ [u, v, 1.0], [x + 0.1, y + 0.2], atol=1e-12)


def test_textures_of_blender_move_coordinates_first(tmp_path):
    """What Cycles looks up for this mapping, and what Blender 5.0 writes for it."""
    values = {
        "Translation": [0.1, 0.2, 0.0],
        "Rotation": [0.0, 0.0, -0.3490658402442932],
        "Scaling": [0.5, 0.25, 1.0],
    }
    looked_up = {
        (0.390625, 0.265625): (0.14779696, 0.99057889),
        (0.171875, 0.640625): (0.10914689, 0.09737936),
        (0.890625, 0.890625): (0.48960146, 0.09465341),
        (0.953125, 0.109375): (0.38536519, 0.90577561),
    }
    corners = np.array([list(looked_up)[i % 4] for i in range(11)])
    path = textured_file(
        tmp_path,
        {"DiffuseColor": values, "EmissiveColor": values},
        layers=[uv_layer(0, "map1", corners)],
        creator=b"Blender (stable FBX IO)",
    )
    mesh = read_mesh(path)
    found = read_materials(path, mesh)
    # The image is sheared, which glTF cannot do: it has coordinates of its own.
    assert list(found.uv_sets) == [1]
    for (u, v), coordinates in zip(mesh.uvs.tolist(), found.uv_sets[1] % 1.0, strict=True):
        # The image was a ramp of 512 texels, interpolated linearly in float32.
        np.testing.assert_allclose(coordinates, looked_up[u, v], atol=1e-4)
    for channel in "base-color", "emissive":
        image = found.sources(channel)[0].image
        assert (image.uv_set, image.placing) == (1, UNPLACED)
    write_mesh(mesh, tmp_path / "a.glb", materials=found)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308])
def test_a_transform_that_is_not_finite_moves_nothing(tmp_path, value):
    values = {"Scaling": [value, 10.0, 1.0], "Translation": [value, 0.0, 0.0]}
    values["TextureScalingPivot"] = [value, 0.0, 0.0]
    path = textured_file(tmp_path, {"DiffuseColor": {"Scaling": ["a", "b", "c"], **values}})
    assert np.isfinite(moved(path)).all()


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_the_base_layer_of_a_layered_texture_is_read_and_noted(tmp_path, form):
    textures = {"DiffuseColor": {}}
    path = textured_file(tmp_path, textures, form=form, layered=True, content=b"image")
    found = read_materials(path, read_mesh(path))
    assert found.sources("base-color")[0].image.data == b"image"
    assert found.notes() == ("of layered textures only the base layer is read",)
    contents = read_contents(path)
    name = contents.materials[0].channels["base-color"]
    assert contents.images == {name: b"image"}


@pytest.mark.parametrize("name", [r"C:\\work\\bark 1.png", "textures/bark 1.png"])
def test_a_missing_image_is_named(read, name):
    found = read([("RelativeFilename", [name], [])])
    (line,) = found.notes()
    assert "its image 'bark 1.png' is missing; the material keeps its factors" in line
    assert found.missing_images == ("bark 1.png",)


@pytest.mark.parametrize("name", ["b.png", r"C:\work\b.png", "../b.png", "textures/b.png"])
def test_images_lie_in_the_folder_of_the_file(read, tmp_path, name):
    (tmp_path / "b.png").write_bytes(b"outside")
    texture = [("RelativeFilename", [name], [])]
    found = read(texture)
    assert found.sources("base-color")[1] is None
    assert "blue" in found.notes()[0]
    (tmp_path / "model" / "b.png").write_bytes(b"inside")
    assert read(texture).sources("base-color")[1].image.data == b"inside"


def test_a_texture_that_many_materials_share_is_read_once(tmp_path, monkeypatch):
    """Ten thousand materials may share a texture of as many videos."""
    file = ("RelativeFilename", ["missing.png"], [])
    nodes = rich_scene(7400)
    objects, connections = nodes[1][2], nodes[2][2]
    objects.append(("Texture", [60, "paint\0\1Texture", ""], [file]))
    for i in range(20):
        objects.append(("Material", [100 + i, f"m{i}\0\1Material", ""], []))
        objects.append(("Video", [200 + i, f"v{i}\0\1Video", ""], [file]))
        connections.append(("C", ["OO", 200 + i, 60], []))
        connections.append(("C", ["OP", 60, 100 + i, "DiffuseColor"], []))
    (tmp_path / "a.fbx").write_bytes(binary(nodes))
    names = []
    monkeypatch.setattr(
        fbx_materials, "file_beside", lambda *place: names.append(place) or file_beside(*place)
    )
    assert read_contents(tmp_path / "a.fbx").images == {"missing.png": None}
    assert len(names) < 100
