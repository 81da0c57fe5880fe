"""Images of materials, rearranged as glTF reads them."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.mesh.files.channels import SLOTS
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.texture.image import decode_image, write_image
from texbake.texture.material_images import gltf_images

RNG = np.random.default_rng(1)


def image_of(path, codes, components, **more):
    write_image(codes, path)
    return ChannelImage(data=path.read_bytes(), name=str(path), components=components, **more)


def codes(n, size=8, dtype=np.uint8):
    return RNG.integers(0, np.iinfo(dtype).max, (size, size, n), dtype, endpoint=True)


def rearranged(alpha_mode="opaque", **sources):
    channels = {name.replace("_", "-"): source for name, source in sources.items()}
    material = MeshMaterial(name="wood", channels=channels, alpha_mode=alpha_mode)
    found = gltf_images(Materials(face_materials=np.zeros(1, np.int32), materials=(material,)))
    assert all(slot.fits(found.materials[0]) for slot in SLOTS)
    return found


def texels(source):
    """Codes that a channel reads, as the file holds them."""
    found = decode_image(source.image.data, source.image.name, color=False)
    scale = 255 if found.bits == 8 else 65535
    pixels = np.rint(found.pixels * scale).astype(int)
    return pixels[..., list(source.image.components)]


def test_roughness_and_metallic_of_two_files_share_one(tmp_path):
    rough, metal = codes(3), codes(1)
    found = rearranged(
        roughness=ChannelSource((0.5,), image_of(tmp_path / "r.png", rough, (0,))),
        metallic=ChannelSource((1.0,), image_of(tmp_path / "m.png", metal, (0,))),
    ).materials[0]
    roughness, metallic = (found.channels[name] for name in ("roughness", "metallic"))
    assert roughness.image.data is metallic.image.data
    assert (roughness.factor, roughness.image.components) == ((0.5,), (1,))
    np.testing.assert_array_equal(texels(roughness), rough[..., :1])
    np.testing.assert_array_equal(texels(metallic), metal)


def test_a_factor_beside_an_image_stays_what_it_is(tmp_path):
    image = image_of(tmp_path / "r.png", codes(3), (0,))
    found = rearranged(
        roughness=ChannelSource((1.0,), image), metallic=ChannelSource((0.75,))
    ).materials[0]
    assert found.channels["metallic"].factor == (0.75,)
    assert (texels(found.channels["metallic"]) == 255).all()


def test_gray_images_stay_as_they_are(tmp_path):
    image = image_of(tmp_path / "r.png", codes(1), (0,))
    found = rearranged(roughness=ChannelSource((1.0,), image)).materials[0]
    assert found.channels["roughness"].image == replace(image, components=(1,))


@pytest.mark.parametrize("suffix, n", [("tga", 4), ("tif", 4), ("tif", 3), ("tif", 2), ("tga", 1)])
def test_other_formats_become_png_with_the_same_codes(tmp_path, suffix, n):
    given = codes(n)
    color = np.full((8, 8, 4), 255)
    color[..., :3] = given[..., : 3 if n > 2 else 1]
    color[..., 3:] = given[..., n - 1 :] if n in (2, 4) else 255
    image = image_of(tmp_path / f"c.{suffix}", given, (0, 1, 2))
    opacity = replace(image, components=(3,))
    found = rearranged(
        "blend",
        base_color=ChannelSource((1.0, 0.5, 1.0), image),
        alpha=ChannelSource((1.0,), opacity),
    ).materials[0]
    assert found.channels["base-color"].image.data.startswith(b"\x89PNG")
    np.testing.assert_array_equal(texels(found.channels["base-color"]), color[..., :3])
    np.testing.assert_array_equal(texels(found.channels["alpha"]), color[..., 3:])
    assert found.channels["base-color"].factor == (1.0, 0.5, 1.0)


def test_sixteen_bits_and_other_sizes(tmp_path):
    rough, metal = codes(3, 8, np.uint16), codes(3, 4)
    found = rearranged(
        roughness=ChannelSource((1.0,), image_of(tmp_path / "r.png", rough, (2,))),
        metallic=ChannelSource((1.0,), image_of(tmp_path / "m.png", metal, (0,))),
    ).materials[0]
    np.testing.assert_array_equal(texels(found.channels["roughness"]), rough[..., 2:])
    assert texels(found.channels["metallic"]).shape == (8, 8, 1)


def test_normals_with_green_down_are_turned_up(tmp_path):
    normals = codes(3)
    image = image_of(tmp_path / "n.png", normals, (0, 1, 2))
    found = rearranged(normal=ChannelSource((1.0, -1.0, 1.0), image)).materials[0]
    source = found.channels["normal"]
    assert source.factor == (1.0, 1.0, 1.0)
    ours, theirs = (2.0 * values / 255 - 1.0 for values in (texels(source), normals))
    theirs *= (1.0, -1.0, 1.0)
    theirs /= np.linalg.norm(theirs, axis=2, keepdims=True)
    np.testing.assert_allclose(ours, theirs, atol=1.0 / 255 + 1e-6)  # half a code


def test_what_cannot_be_placed_or_read_is_noted(tmp_path):
    image = image_of(tmp_path / "r.png", codes(3), (0,))
    other = image_of(tmp_path / "m.png", codes(3), (0,), wraps=("clamp", "clamp"))
    bad = ChannelImage(data=b"no image", name="bad.png")
    found = rearranged(
        roughness=ChannelSource((0.5,), image),
        metallic=ChannelSource((0.25,), other),
        emissive=ChannelSource(CHANNELS["specular-color"].default, bad),
    )
    assert found.materials[0].channels["metallic"].factor == (0.25,)
    assert [channel for channel, _ in found.missing] == ["metallic", "emissive"]
    assert "cannot place it apart" in found.missing[0][1] and "bad.png" in found.missing[1][1]
    assert found.materials[0].channels["emissive"].image is None


def test_opaque_materials_take_no_alpha_along(tmp_path):
    image = image_of(tmp_path / "c.tga", codes(4), (0, 1, 2))
    found = rearranged(base_color=ChannelSource((1.0,) * 3, image)).materials[0]
    assert (
        decode_image(found.channels["base-color"].image.data, "", color=True).pixels.shape[2] == 3
    )
