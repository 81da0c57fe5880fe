"""Reading glTF files as scenes, checked against the specification."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.glb import GltfFile
from texbake import ImageTexture, ReadWarning, RenderOptions, read_scene, write_image
from texbake.errors import FileFormatError, MeshError
from texbake.rendering.scene.scene import camera_of, place_mesh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
UVS = np.array([[0, 0], [1, 0], [0, 1]], "<f4")


class Asset(GltfFile):
    """One triangle, and whatever a test adds."""

    def __init__(self, **attributes):
        super().__init__(nodes=[{"mesh": 0}], materials=[], textures=[], images=[], samplers=[])
        self.mesh()
        self.add(POSITION=CORNERS, TEXCOORD_0=UVS, **attributes)

    def add(self, **attributes):
        accessors = {name: self.accessor(values) for name, values in attributes.items()}
        self.json["meshes"][0]["primitives"].append({"attributes": accessors})

    def material(self, **fields):
        self.json["materials"].append(fields)
        self.json["meshes"][0]["primitives"][-1]["material"] = len(self.json["materials"]) - 1

    def texture(self, data, sampler=None, **info):
        """A textureInfo of an image inside the file, or of a uri."""
        source = {"uri": data} if isinstance(data, str) else {"bufferView": self.view(data)}
        self.json["images"].append(source)
        texture = {"source": len(self.json["images"]) - 1}
        if sampler is not None:
            self.json["samplers"].append(sampler)
            texture["sampler"] = len(self.json["samplers"]) - 1
        self.json["textures"].append(texture)
        return {"index": len(self.json["textures"]) - 1, **info}

    def read(self, folder):
        return read_scene(self.write(folder / "a.glb"))


@pytest.fixture
def asset():
    return Asset()


@pytest.fixture
def pixels(tmp_path):
    """Bytes of a PNG of 2 x 2 pixels with alpha."""
    codes = np.array([[[0, 64, 128, 255], [255, 0, 0, 128]]] * 2, np.uint8)
    write_image(codes, tmp_path / "pixels.png", color=True)
    return (tmp_path / "pixels.png").read_bytes()


def only_material(asset, folder):
    return asset.read(folder).objects[0].material


def test_a_primitive_without_a_material_is_as_the_specification_has_it(asset, tmp_path):
    made = only_material(asset, tmp_path)
    assert made.shading == "metallic-roughness"
    assert (made.base_color, made.roughness, made.metalness) == ((1, 1, 1), 1, 1)
    assert (made.alpha_mode, made.opacity, made.emission) == ("opaque", None, None)
    assert made.double_sided is False and not made.vertex_colors


def test_factors_are_constants(asset, tmp_path):
    asset.material(
        name="red",
        pbrMetallicRoughness={
            "baseColorFactor": [1, 0.25, 0, 0.5], "metallicFactor": 0.1, "roughnessFactor": 0.9,
        },
        emissiveFactor=[0.5, 0, 1], alphaMode="MASK", alphaCutoff=0.25, doubleSided=True,
        extensions={
            "KHR_materials_emissive_strength": {"emissiveStrength": 4},
            "KHR_materials_ior": {"ior": 1.33},
        },
    )  # fmt: skip
    made = only_material(asset, tmp_path)
    assert made.name == "red"
    assert (made.base_color, made.opacity) == ((1, 0.25, 0), 0.5)
    assert (made.metalness, made.roughness, made.ior) == (0.1, 0.9, 1.33)
    assert made.emission == (2, 0, 4)
    assert (made.alpha_mode, made.alpha_cutoff, made.double_sided) == ("mask", 0.25, True)


def test_textures_go_to_the_slots_and_channels_of_the_specification(asset, tmp_path, pixels):
    image = asset.texture(pixels)
    asset.material(
        pbrMetallicRoughness={
            "baseColorTexture": image, "metallicRoughnessTexture": image,
            "baseColorFactor": [1, 0.5, 0.25, 1], "roughnessFactor": 0.5, "metallicFactor": 0.75,
        },
        normalTexture={**image, "scale": -0.5}, occlusionTexture={**image, "strength": 0.25},
        emissiveTexture=image, emissiveFactor=[1, 1, 1],
    )  # fmt: skip
    made = only_material(asset, tmp_path)
    base = made.base_color
    assert (base.factor, base.channel, base.color) == ((1, 0.5, 0.25), None, True)
    # sRGB is decoded for colors alone, and opacity never is.
    linear = ((64 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(base.image.pixels[0, 0], [0, linear, (128 / 255 + 0.055) ** 2.4
                               / 1.055**2.4, 1], atol=1e-6)  # fmt: skip
    assert base.image.pixels[0, 1, 3] == pytest.approx(128 / 255)
    assert (made.roughness.channel, made.roughness.factor) == (1, 0.5)
    assert (made.metalness.channel, made.metalness.factor) == (2, 0.75)
    np.testing.assert_allclose(made.roughness.image.pixels[0, 0, 1], 64 / 255, atol=1e-7)
    assert made.roughness.image is made.metalness.image is made.normal_map.texture.image
    assert made.emission.image is base.image
    normal = made.normal_map
    assert (normal.space, normal.convention, normal.strength) == ("tangent", "opengl", -0.5)
    assert (made.occlusion.channel, made.occlusion_strength) == (0, 0.25)


def test_unlit_reads_nothing_but_the_base_color(asset, tmp_path, pixels):
    image = asset.texture(pixels)
    asset.material(
        pbrMetallicRoughness={"baseColorTexture": image, "metallicRoughnessTexture": image},
        normalTexture=image,
        extensions={"KHR_materials_unlit": {}},
    )
    made = only_material(asset, tmp_path)
    assert made.shading == "unlit"
    assert isinstance(made.base_color, ImageTexture)
    assert (made.normal_map, made.roughness) == (None, 0.5)


@pytest.mark.parametrize(("sampler", "name"), [
    (None, "trilinear"),
    ({}, "trilinear"),
    ({"magFilter": 9728, "minFilter": 9987}, "nearest"),
    ({"magFilter": 9729, "minFilter": 9729}, "bilinear"),
    ({"magFilter": 9729, "minFilter": 9986}, "trilinear"),
])  # fmt: skip
def test_filters(asset, tmp_path, pixels, sampler, name):
    asset.material(pbrMetallicRoughness={"baseColorTexture": asset.texture(pixels, sampler)})
    assert only_material(asset, tmp_path).base_color.filter == name


def test_images_beside_the_file_are_read_later(asset, tmp_path, pixels):
    asset.material(pbrMetallicRoughness={"baseColorTexture": asset.texture("pixels%2Epng")})
    assert only_material(asset, tmp_path).base_color.image == tmp_path / "pixels.png"
    (tmp_path / "pixels.png").unlink()
    with pytest.warns(ReadWarning, match=r"a\.glb: .*pixels\.png: there is no such"):
        scene = asset.read(tmp_path)
    assert scene.objects[0].material.base_color == (1.0, 1.0, 1.0) and scene.files == ()


def test_colors_of_vertices_stay_where_they_are(tmp_path):
    corners = np.concatenate([CORNERS, CORNERS])
    asset = Asset()
    asset.json["meshes"][0]["primitives"].clear()
    colors = np.repeat([[1, 0, 0, 1], [0, 0, 1, 0.5]], 3, axis=0)
    asset.add(POSITION=corners, COLOR_0=colors)
    item = asset.read(tmp_path).objects[0]
    assert item.material.vertex_colors
    # Both triangles lie on one place; their vertices are not one, because their colors differ.
    np.testing.assert_array_equal(item.mesh.colors[item.mesh.faces], colors.reshape(2, 3, 4))


def test_without_normals_it_is_flat_and_with_normals_tangents_count(tmp_path):
    bent = [[0, 0.6, 0.8]] * 3
    tangents = [[1, 0, 0, -1]] * 3
    item = Asset(TANGENT=tangents).read(tmp_path).objects[0]
    np.testing.assert_array_equal(item.mesh.normals[item.mesh.normal_faces], [[[0, 0, 1]] * 3])
    assert item.mesh.tangents is None
    item = Asset(NORMAL=bent, TANGENT=tangents).read(tmp_path).objects[0]
    np.testing.assert_allclose(item.mesh.normals[0], bent[0], atol=1e-7)
    np.testing.assert_array_equal(item.mesh.tangents, [tangents])


def test_each_node_places_each_primitive(asset, tmp_path):
    asset.add(POSITION=CORNERS + 5)
    asset.json["nodes"] = [
        {"mesh": 0, "name": "left"},
        {"name": "up", "translation": [0, 3, 0], "children": [2]},
        {"mesh": 0, "name": "mirror", "scale": [-1, 1, 1]},
        {"mesh": 0, "name": "hidden", "scale": [0, 0, 0]},
    ]
    scene = asset.read(tmp_path)
    assert [item.name for item in scene.objects] == ["left 0", "left 1", "mirror 0", "mirror 1"]
    assert scene.objects[0].mesh is scene.objects[2].mesh
    assert scene.objects[0].transform is None
    mirrored = place_mesh(scene.objects[2])
    np.testing.assert_array_equal(mirrored.bounds, [[-1, 3, 0], [0, 4, 0]])
    a, b, c = mirrored.positions[mirrored.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0  # still seen from the front
    (note,) = scene.notes
    assert note == "the node 'hidden' is scaled flat; it is left out"


def test_another_set_of_coordinates(tmp_path, pixels):
    asset = Asset(TEXCOORD_1=UVS * 0.5)
    image = asset.texture(pixels)
    second = {**image, "texCoord": 1}
    asset.material(
        pbrMetallicRoughness={"baseColorTexture": second},
        normalTexture={**image, "extensions": {"KHR_texture_transform": {"texCoord": 1}}},
    )
    item = asset.read(tmp_path).objects[0]
    np.testing.assert_array_equal(item.mesh.corner_uvs()[0], [[0, 1], [0.5, 1], [0, 0.5]])
    assert item.material.normal_map is not None

    asset.json["materials"][0]["occlusionTexture"] = image
    scene = asset.read(tmp_path)
    assert scene.notes == ()
    # The normal map, which tangents belong to, decides which set is the first.
    item = scene.objects[0]
    assert item.material.base_color.uv_set is None
    assert item.material.occlusion.uv_set == "TEXCOORD_0"
    np.testing.assert_array_equal(item.mesh.corner_uvs("TEXCOORD_0")[0], [[0, 1], [1, 1], [0, 0]])

    asset.json["materials"][0]["occlusionTexture"] = {**image, "texCoord": 2}
    scene = asset.read(tmp_path)
    assert scene.notes == ("'mesh 0' has no TEXCOORD_2; (0, 0) is used",)
    np.testing.assert_array_equal(scene.objects[0].mesh.corner_uvs("TEXCOORD_2")[0], [[0, 1]] * 3)


def test_lights(asset, tmp_path):
    asset.json["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "directional", "intensity": math.pi, "color": [1, 0.5, 0]},
        {"type": "point", "name": "bulb", "intensity": 2 * math.pi},
        {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}},
    ]}}  # fmt: skip
    half = math.sqrt(0.5)
    asset.json["nodes"] += [
        # Turned a quarter about x, -z points down.
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": [-half, 0, 0, half]},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}, "translation": [1, 2, 3]},
        {"extensions": {"KHR_lights_punctual": {"light": 2}}, "scale": [2, 2, 2]},
    ]
    sun, bulb, spot = asset.read(tmp_path).lighting.lights
    np.testing.assert_allclose(sun.direction, [0, -1, 0], atol=1e-15)
    assert (sun.intensity, sun.color) == (pytest.approx(1), (1, 0.5, 0))
    assert (bulb.name, bulb.position, bulb.intensity) == ("bulb", (1, 2, 3), pytest.approx(2))
    assert spot.direction == (0, 0, -1)
    assert math.radians(spot.angle) == pytest.approx(0.8)
    assert spot.blend == pytest.approx(0.75)


@pytest.mark.parametrize("seed", range(5))
def test_what_a_node_holds_stands_where_its_ancestors_put_it(asset, tmp_path, seed):
    """Random translations (to 1e8), rotations and scales place a mesh, light and camera."""
    rng, size = np.random.default_rng(seed), 10.0 ** (2 * seed)
    place, nodes = np.eye(4), []
    for i in range(3):
        turn, move, scale = rng.normal(size=4), size * rng.normal(size=3), rng.uniform(0.5, 2.0)
        turn /= np.linalg.norm(turn)
        local = np.eye(4)
        local[:3, :3] = scale * Rotation.from_quat(turn).as_matrix()
        local[:3, 3] = move
        place = place @ local
        nodes.append({"translation": move.tolist(), "rotation": turn.tolist(),
                      "scale": [scale] * 3, "children": [i + 1]})  # fmt: skip
    leaf = {"mesh": 0, "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}
    asset.json["nodes"] = [*nodes, leaf]
    asset.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.5}}]
    light = {"type": "spot", "range": 0.1, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}
    asset.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    scene = asset.read(tmp_path)
    right, up, back = place[:3, :3].T / np.linalg.norm(place[:3, 0])
    np.testing.assert_allclose(scene.objects[0].transform, place, atol=1e-12 * size)
    (lamp,) = scene.lighting.lights
    np.testing.assert_allclose(lamp.position, place[:3, 3], atol=1e-12 * size)
    np.testing.assert_allclose(lamp.direction, -back, atol=1e-12)
    np.testing.assert_allclose(lamp.up, up, atol=1e-12)
    assert (lamp.decay, lamp.blend) == (2.0, pytest.approx(0.6))
    camera = camera_of(scene, RenderOptions())
    np.testing.assert_allclose(camera.eye, place[:3, 3], atol=1e-12 * size)
    np.testing.assert_allclose(camera.axes, [right, up, back], atol=1e-12)
    assert (camera.near, camera.fov) == (0.5, pytest.approx(1.0))


@pytest.mark.parametrize(("cone", "wanted"), [
    ({}, (90.0, 1.0)),
    ({"outerConeAngle": math.pi / 2}, (179.9, 1.0)),
    ({"innerConeAngle": 0.3, "outerConeAngle": 0.3}, "a cone from 0.3 to 0.3 radians"),
    ({"outerConeAngle": 1.6}, "a cone from 0 to 1.6 radians"),
    ({"innerConeAngle": -0.1}, "'innerConeAngle' is -0.1, which is not a"),
])  # fmt: skip
def test_cones_are_those_of_the_extension(asset, tmp_path, cone, wanted):
    """By default from the axis to 45 degrees; the outer angle is at most a right angle."""
    lights = [{"type": "spot", "color": [-1, 2, 0], "spot": cone}]
    asset.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    asset.json["nodes"].append({"extensions": {"KHR_lights_punctual": {"light": 0}}})
    if isinstance(wanted, str):
        with pytest.raises(FileFormatError, match=rf"{wanted}.* valid"):
            asset.read(tmp_path)
        return
    (lamp,) = asset.read(tmp_path).lighting.lights
    assert (lamp.angle, lamp.blend) == pytest.approx(wanted)
    assert lamp.color == (0.0, 2.0, 0.0) and lamp.intensity == pytest.approx(1 / math.pi)


@pytest.mark.parametrize(("node", "content", "message"), [
    ({"light": 1}, {"type": "point"}, "it has no light 1"),
    ({"light": 0}, {"type": "area"}, "the light type 'area' is not known"),
    ({"camera": 0}, {"yfov": 0.0, "znear": 1}, "has no field of view, or no near plane"),
    ({"camera": 0}, {"yfov": 1.0, "znear": 0}, "has no field of view, or no near plane"),
    ({"camera": 0, "scale": [0, 0, 0]}, {"yfov": 1.0, "znear": 1}, "is scaled to nothing"),
])  # fmt: skip
def test_lights_and_cameras_that_cannot_be(asset, tmp_path, node, content, message):
    if "camera" in node:
        asset.json["cameras"] = [{"type": "perspective", "perspective": content}]
    else:
        asset.json["extensions"] = {"KHR_lights_punctual": {"lights": [content]}}
        node = {"extensions": {"KHR_lights_punctual": node}}
    asset.json["nodes"].append(node)
    with pytest.raises(FileFormatError, match=message):
        asset.read(tmp_path)


def test_only_the_first_perspective_camera_is_the_view(asset, tmp_path):
    asset.json["cameras"] = [
        {"type": "orthographic", "orthographic": {}, "name": "plan"},
        *({"type": "perspective", "perspective": {"yfov": yfov, "znear": 1}} for yfov in (0.5, 1)),
    ]
    asset.json["nodes"] += [{"camera": 0}, {"camera": 1}, {"camera": 2}]
    scene = asset.read(tmp_path)
    assert scene.view.fov == pytest.approx(math.degrees(0.5))
    assert scene.notes == (
        "the camera 'plan' is 'orthographic'; the renderer supports only perspective",
    )


def test_extensions(asset, tmp_path):
    asset.json["extensionsUsed"] = ["KHR_materials_unlit", "KHR_materials_clearcoat"]
    assert asset.read(tmp_path).notes == (
        "it uses KHR_materials_clearcoat, which the renderer does not support",
    )
    asset.json["extensionsRequired"] = ["KHR_materials_clearcoat", "EXT_materials_wax"]
    assert asset.read(tmp_path).notes == (
        "it uses KHR_materials_clearcoat, which the renderer does not support",
        "it uses EXT_materials_wax, which the renderer does not support",
    )
    asset.json["extensionsRequired"] = ["KHR_meshopt_compression"]
    with pytest.raises(FileFormatError, match="it needs KHR_meshopt_compression"):
        asset.read(tmp_path)


def test_a_scene_without_triangles(asset, tmp_path):
    asset.json["meshes"][0]["primitives"][0]["mode"] = 1
    with pytest.raises(MeshError, match="it has no faces"):
        asset.read(tmp_path)


def test_textures_without_coordinates_show_one_texel(tmp_path, pixels):
    asset = Asset()
    asset.json["meshes"][0]["primitives"].clear()
    asset.add(POSITION=CORNERS)
    asset.material(pbrMetallicRoughness={"baseColorTexture": asset.texture(pixels)})
    scene = asset.read(tmp_path)
    np.testing.assert_array_equal(scene.objects[0].mesh.corner_uvs(), [[[0, 1]] * 3])
    assert "has textures but no texture coordinates" in scene.notes[0]
