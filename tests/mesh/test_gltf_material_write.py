"""Materials in GLB files: what is written is what was given, and nothing is written twice."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.errors import OptionError, UvError
from texbake.mesh.files import write_mesh
from texbake.mesh.files.channels import FILE_CHANNELS
from texbake.mesh.files.gltf import read_gltf
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import (
    CHANNELS,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    read_materials,
)
from texbake.mesh.options import SimplifyOptions
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.texture.png_files import png_parts
from texbake.verbs.simplify import simplify_file


def png(value=128, n=4):
    return b"".join(png_parts(np.full((4, 4, n), value, np.uint8)))


SIX = (0.5, 0.25, 1.0)
# A rotation by 30 degrees, scaled and moved, as the reader makes it of a texture transform.
COS, SIN = np.cos(np.pi / 6), np.sin(np.pi / 6)
TURNED = ((2 * COS, -0.5 * SIN, 0.25), (2 * SIN, 0.5 * COS, -0.5))


def full_material(name, **image):
    """Every channel of glTF, each with a factor of its own and an image."""
    channels = {}
    textures = {where.texture: png(10 + i) for i, where in enumerate(FILE_CHANNELS.values())}
    for where in FILE_CHANNELS.values():
        source = ChannelImage(data=textures[where.texture], components=where.components, **image)
        factor = SIX[: len(CHANNELS[where.name].default)]
        channels[where.name] = ChannelSource(factor, source)
    channels["normal"] = replace(channels["normal"], factor=(0.75, 0.75, 1.0))
    channels["occlusion"] = replace(channels["occlusion"], factor=(0.5,), offset=0.5)
    channels["emissive"] = replace(channels["emissive"], factor=(8.0, 4.0, 1.0))
    return MeshMaterial(name=name, channels=channels, alpha_mode="blend", is_double_sided=True)


def sphere_of(*materials):
    """A sphere whose faces have the materials by turns, and those with a second UV set."""
    mesh = uv_sphere(6, 8)
    ids = np.sort(np.arange(mesh.n_faces) % len(materials)).astype(np.int32)
    return mesh, Materials(
        face_materials=ids, materials=materials, uv_sets={1: 1.0 - 0.5 * mesh.uvs}
    )


def assert_equal(back, given):
    plain = {"channels": {}}
    assert replace(back, **plain) == replace(given, **plain)
    assert back.channels.keys() == given.channels.keys()
    for name, source in given.channels.items():
        found = back.channels[name]
        assert found.factor == source.factor and found.offset == source.offset, name
        if source.image is None:
            assert found.image is None, name
            continue
        np.testing.assert_allclose(found.image.placing, source.image.placing, atol=1e-12)
        same = {"name": "", "placing": ()}
        assert replace(found.image, **same) == replace(source.image, **same), name


@pytest.mark.parametrize(
    "image",
    [
        {},
        {"wraps": ("clamp", "mirror"), "is_nearest": True},
        {"uv_set": 1},
        {"placing": TURNED},
        {"placing": ((0.0, 2.0, 0.5), (-3.0, 0.0, 0.0)), "uv_set": 1},
    ],
)
def test_every_channel_comes_back(tmp_path, image):
    given = full_material("all", **image), MeshMaterial(
        name="glass", alpha_mode="mask", alpha_cutoff=0.25, is_unlit=True
    )  # fmt: skip
    mesh, materials = sphere_of(*given)
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    read = read_gltf(tmp_path / "a.glb")
    back = read_materials(tmp_path / "a.glb", read)
    assert back.missing == () and not back.has_vertex_colors
    np.testing.assert_array_equal(back.face_materials, materials.face_materials)
    assert_equal(back.materials[0], given[0])
    factors = {name: source.factor for name, source in back.materials[1].channels.items()}
    assert factors == {
        name: CHANNELS[name].default for name in ("base-color", "alpha", "roughness", "metallic")
    }
    assert (back.materials[1].alpha_cutoff, back.materials[1].is_unlit) == (0.25, True)
    if 1 in back.uv_sets:
        sets = [m.uv_sets[1][r.uv_faces] for m, r in ((back, read), (materials, mesh))]
        np.testing.assert_allclose(*sets, atol=1e-7)  # as float32
    again = tmp_path / "b.glb"
    write_glb(mesh, again, materials=materials, name="a")
    assert again.read_bytes() == (tmp_path / "a.glb").read_bytes()


def test_groups_and_materials_are_told_apart(tmp_path):
    red, blue = (
        MeshMaterial(name=name, channels={"base-color": ChannelSource(color)})
        for name, color in (("red", (1.0, 0.0, 0.0)), ("blue", (0.0, 0.0, 1.0)))
    )
    mesh, materials = sphere_of(red, blue, MeshMaterial(name="of no face"))
    ids = np.arange(mesh.n_faces) // 2 % 2
    groups = (np.arange(mesh.n_faces) > 30).astype(np.int32)
    mesh = mesh.replace(face_groups=groups, group_names=("front", "back"))
    materials = replace(materials, face_materials=ids.astype(np.int32))
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    read = read_gltf(tmp_path / "a.glb")
    back = read_materials(tmp_path / "a.glb", read)
    assert read.group_names == ("front 0", "front 1", "back 0", "back 1")
    assert back.names == ("red", "blue")
    order = np.lexsort((np.arange(mesh.n_faces), ids, groups))
    np.testing.assert_array_equal(back.face_materials, ids[order])
    corners = [m.positions[m.faces].astype(np.float32) for m in (read, mesh)]
    np.testing.assert_array_equal(corners[0], corners[1][order])


def test_one_image_is_embedded_once(tmp_path):
    """Occlusion, roughness and metallic of one file, by two materials."""
    image = ChannelImage(data=png())
    channels = {
        name: ChannelSource((1.0,), replace(image, components=(component,)))
        for component, name in enumerate(("occlusion", "roughness", "metallic"))
    }
    materials = [MeshMaterial(name=name, channels=channels) for name in ("a", "b")]
    mesh, given = sphere_of(*materials)
    write_mesh(mesh, tmp_path / "a.glb", materials=given)
    document = read_document(tmp_path / "a.glb")
    assert len(document.items("images")) == len(document.items("textures")) == 1
    material = document.items("materials")[1]
    assert material["occlusionTexture"] == {"index": 0}
    assert material["pbrMetallicRoughness"]["metallicRoughnessTexture"] == {"index": 0}


def test_vertex_colors_are_written_where_they_count(tmp_path):
    mesh, materials = sphere_of(MeshMaterial(name="plain"))
    mesh = mesh.replace(colors=np.linspace(0, 1, 3 * mesh.n_vertices).reshape(-1, 3))
    for has_colors in False, True:
        given = replace(materials, has_vertex_colors=has_colors)
        write_glb(mesh, tmp_path / "a.glb", materials=given)
        read = read_gltf(tmp_path / "a.glb")
        back = read_materials(tmp_path / "a.glb", read)
        assert (read.colors is not None) == back.has_vertex_colors == has_colors


def test_webp_is_embedded_and_required(tmp_path):
    data = b"RIFF\x00\x00\x00\x00WEBPVP8 "
    color = ChannelSource((1.0, 1.0, 1.0), ChannelImage(data=data))
    mesh, materials = sphere_of(MeshMaterial(name="a", channels={"base-color": color}))
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    document = read_document(tmp_path / "a.glb")
    assert document.texts("extensionsRequired") == ["EXT_texture_webp"]
    back = read_materials(tmp_path / "a.glb", read_gltf(tmp_path / "a.glb"))
    assert back.materials[0].channels["base-color"].image.data == data


def with_image(channel, **fields):
    image = ChannelImage(**{"data": png(), "components": (0, 1, 2), **fields})
    source = ChannelSource(CHANNELS[channel].default, image)
    return MeshMaterial(name="wood", channels={channel: source})


@pytest.mark.parametrize(
    ("material", "error", "message"),
    [
        (with_image("roughness", components=(0,)), OptionError, "wood: glTF has no place"),
        (with_image("base-color", data=b"BM"), OptionError, "texbake.gltf_images"),
        (with_image("base-color", uv_set=2), UvError, "texture coordinates 2"),
        (with_image("base-color", placing=((1, 1, 0), (0, 1, 0))), OptionError, "sheared"),
    ],
)
def test_what_gltf_cannot_hold_is_an_error(tmp_path, material, error, message):
    mesh, materials = sphere_of(material)
    with pytest.raises(error, match=message):
        write_glb(mesh, tmp_path / "a.glb", materials=materials)
    assert list(tmp_path.iterdir()) == []


def test_materials_must_be_those_of_the_mesh_and_alone(tmp_path):
    mesh, materials = sphere_of(MeshMaterial(name="a"))
    with pytest.raises(OptionError, match="without levels"):
        write_glb(mesh, tmp_path / "a.glb", materials=materials, levels=[plane()])
    with pytest.raises(OptionError, match="has 2"):
        write_glb(plane(), tmp_path / "a.glb", materials=materials)
    mesh, materials = sphere_of(with_image("base-color"))
    with pytest.raises(UvError, match="no texture coordinates"):
        write_glb(mesh.replace(uvs=None, uv_faces=None), tmp_path / "a.glb", materials=materials)


@pytest.mark.parametrize(
    ("placing", "turned_by"),
    [
        (((2.0, 0.0, 0.1), (0.0, 2.0, 0.2)), 0.0),
        (((0.0, -1.0, 1.0), (1.0, 0.0, 0.0)), -90.0),
        (((-1.0, 0.0, 1.0), (0.0, -1.0, 1.0)), 180.0),
    ],
)
def test_tangents_are_those_of_the_image_as_it_lies(tmp_path, placing, turned_by):
    mesh = plane()
    material = with_image("normal", placing=placing)
    ids = np.zeros(mesh.n_faces, np.int32)
    write_glb(
        mesh, tmp_path / "a.glb", materials=Materials(face_materials=ids, materials=(material,))
    )
    tangents = read_gltf(tmp_path / "a.glb").tangents
    angle = np.radians(turned_by)
    along_u, along_v = mesh.positions[[1, 2]] - mesh.positions[0]
    along_v -= along_u * (along_u @ along_v) / (along_u @ along_u)
    expected = np.cos(angle) * along_u / np.linalg.norm(along_u)
    expected += np.sin(angle) * along_v / np.linalg.norm(along_v)
    np.testing.assert_allclose(tangents[..., :3], np.broadcast_to(expected, (2, 3, 3)), atol=1e-6)
    np.testing.assert_array_equal(tangents[..., 3], 1.0)


def test_extensions_that_are_not_baked_are_carried_along(tmp_path):
    image = ChannelImage(png(), "thickness.png")
    volume = {"attenuationColor": [1.0, 0.5, 0.0], "thicknessFactor": 0.5}
    material = MeshMaterial(
        name="glass",
        extensions={
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_volume": {**volume, "thicknessTexture": image},
        },
    )
    mesh = plane()
    ids = np.zeros(mesh.n_faces, np.int32)
    materials = Materials(face_materials=ids, materials=(material,))
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    made = read_materials(tmp_path / "a.glb", read_gltf(tmp_path / "a.glb"))
    assert made.missing == () and made.has_images
    (glass,) = made.materials
    assert glass.extensions["KHR_materials_ior"] == {"ior": 1.33}
    kept = dict(glass.extensions["KHR_materials_volume"])
    assert kept.pop("thicknessTexture").data == image.data and kept == volume
    (bare,) = made.without_images().materials
    assert bare.extensions["KHR_materials_volume"] == volume


def test_images_on_further_coordinates_stay_where_nothing_changes_and_else_emit_nothing(tmp_path):
    mesh = cube().replace(uvs=cube().positions[:, :2] + 0.5, uv_faces=cube().faces)
    image = ChannelImage(png(), "glow.png", uv_set=1)
    glow = MeshMaterial(name="glow", channels={"emissive": ChannelSource((1.0,) * 3, image)})
    ids = np.zeros(mesh.n_faces, np.int32)
    materials = Materials(face_materials=ids, materials=(glow,), uv_sets={1: 2.0 * mesh.uvs})
    write_glb(mesh, tmp_path / "a.glb", materials=materials)
    for n_faces, warned in ((12, False), (8, True)):
        options = SimplifyOptions(n_faces=n_faces)
        done = simplify_file(tmp_path / "a.glb", tmp_path / "b.glb", options)
        assert any("further texture coordinates" in line for line in done.warnings) == warned
        low = read_gltf(tmp_path / "b.glb")
        found = read_materials(tmp_path / "b.glb", low)
        if warned:
            assert found is None or "emissive" not in found.materials[0].channels
        else:
            np.testing.assert_allclose(found.uv_sets[1], 2.0 * low.uvs, atol=1e-6)
            assert found.materials[0].channels["emissive"].image.data == image.data
