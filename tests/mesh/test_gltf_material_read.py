"""glTF materials as data, which the materials of meshes and of scenes are made from."""

import math
import re
from pathlib import Path

import pytest

from tests.mesh.test_materials import gltf_with
from texbake.errors import FileFormatError, ReadWarning
from texbake.mesh.files import read_mesh
from texbake.mesh.files.contents import read_contents
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_materials import GltfSource, GltfTexture, image_bytes, read_material
from texbake.mesh.materials import read_materials
from texbake.rendering.scene.read import read_scene

PIXEL = {"uri": "data:image/png;base64,YW4gaW1hZ2U="}


def document_with(material, **content):
    return Document(Path("a.gltf"), {"materials": [material], **content}, None)


def test_the_default_material_is_that_of_the_specification():
    found = read_material(document_with({}), None)
    assert found.name == "material"
    assert (found.alpha_mode, found.alpha_cutoff, found.ior) == ("opaque", 0.5, 1.5)
    assert not found.is_double_sided
    assert not found.is_unlit
    assert found.channels == {
        "base-color": GltfSource((1.0, 1.0, 1.0)),
        "alpha": GltfSource((1.0,)),
        "roughness": GltfSource((1.0,)),
        "metallic": GltfSource((1.0,)),
        "normal": GltfSource((1.0,)),
        "occlusion": GltfSource((1.0,)),
        "emissive": GltfSource((0.0, 0.0, 0.0)),
    }


def test_everything_that_a_texture_says_is_kept():
    moved = {"offset": [0.25, 0.5], "rotation": -0.5, "scale": [2, -4], "texCoord": 1}
    info = {"index": 1, "texCoord": 3, "scale": -2, "extensions": {"KHR_texture_transform": moved}}
    document = document_with(
        {"normalTexture": info, "occlusionTexture": {"index": 0, "strength": 4}},
        images=[PIXEL, PIXEL],
        textures=[
            {"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}},
            {"source": 0, "sampler": 0},
        ],
        samplers=[{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9729}],
    )
    found = read_material(document, 0).channels
    assert found["normal"] == GltfSource(
        (-2.0,),
        GltfTexture(
            image=0,
            wraps=("clamp", "mirror"),
            is_nearest=True,
            has_mip_levels=False,
            uv_set=1,
            scale=(2.0, -4.0),
            rotation=-0.5,
            offset=(0.25, 0.5),
        ),
    )
    assert found["occlusion"] == GltfSource((1.0,), GltfTexture(image=1))
    assert image_bytes(document, 0) == b"an image"


def test_extensions_that_are_not_used_have_no_channels():
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    clear = {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}, "KHR_materials_unlit": {}}
    material = {"emissiveFactor": [1, 0.5, 0], "extensions": {**strong, **clear}}
    found = read_material(document_with(material), 0)
    assert found.is_unlit
    assert found.channels["emissive"].factor == (4.0, 2.0, 0.0)
    assert found.channels["clearcoat"].factor == (0.5,)
    assert "transmission" not in found.channels


LONG = 10**400  # an integer that no float holds
TURNED = {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": LONG}}}


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ({"alphaMode": []}, r"alphaMode \[\]"),
        ({"alphaCutoff": LONG}, "'alphaCutoff' is 1000"),
        ({"alphaCutoff": math.nan}, "'alphaCutoff' is nan"),
        ({"pbrMetallicRoughness": {"roughnessFactor": -0.5}}, "'roughnessFactor' is -0.5"),
        ({"pbrMetallicRoughness": {"roughnessFactor": "x"}}, "'roughnessFactor' is 'x'"),
        ({"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}, "'baseColorFactor' is not 4"),
        ({"pbrMetallicRoughness": 3}, "'pbrMetallicRoughness' is not an object"),
        ({"alphaMode": "GLASS"}, "the alphaMode 'GLASS' of 'material 0' is not known"),
        ({"emissiveFactor": [1, -1, 0]}, "'emissiveFactor' is below 0"),
        ({"pbrMetallicRoughness": {"baseColorTexture": TURNED}}, "'rotation' is 1000"),
        ({"pbrMetallicRoughness": {"baseColorTexture": {"index": []}}}, r"no textures\[\[\]\]"),
        ({"emissiveTexture": {"index": 1}}, r"it has no images\[\[\]\]"),
        ({"emissiveTexture": {"index": 2}}, "images.0. is not base64"),
    ],
)
def test_damage_is_one_clear_line_for_meshes_and_scenes(tmp_path, material, message):
    images = [{"uri": "data:,\u00e9"}]
    textures = [{"source": 0, "sampler": 0}, {"source": []}, {"source": 0}]
    # Emission is not read where it is black.
    material = {"emissiveFactor": [1, 1, 1], **material}
    path = gltf_with(tmp_path, material, images=images, textures=textures, samplers=[{}])
    mesh = read_mesh(path)
    for read in read_scene, lambda path: read_materials(path, mesh):
        with pytest.raises(FileFormatError, match=message) as caught:
            read(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("texture", [{"source": 0}, {}])
def test_scenes_and_meshes_warn_alike_of_a_missing_image(tmp_path, texture):
    material = {"name": "skin", "normalTexture": {"index": 0}}
    path = gltf_with(tmp_path, material, images=[{"uri": "none.png"}], textures=[texture])
    found = read_materials(path, read_mesh(path))
    assert "normal" not in found.materials[0].channels
    (note,) = found.notes()
    assert note.startswith("skin: ")
    with pytest.warns(ReadWarning, match=re.escape(f"{path}: {note}")):
        scene = read_scene(path)
    assert scene.objects[0].material.normal_map is None


def test_contents_name_an_image_in_webp(tmp_path):
    images = [{"uri": "old.png"}, {"uri": "new.webp"}]
    textures = [{"extensions": {"EXT_texture_webp": {"source": 1}}}]
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    path = gltf_with(tmp_path, material, images=images, textures=textures)
    channels = read_contents(path).materials[0].channels
    assert channels == {"roughness": "new.webp", "metallic": "new.webp"}
