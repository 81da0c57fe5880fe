"""Cards with images placed by glTF files, against images placed by the specification's formulas.

The card has as many pixels as the second image has texels, so that both pictures are equal except
at pixels on a border between texels.
"""

import math

import numpy as np
import pytest

from tests.rendering.test_gltf_scene import Asset
from tests.rendering.test_khronos_models import drawn
from texbake.texture.image import write_image

N = 64  # pixels of a card, and of the picture
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1.0]])
FLAT = np.append(SQUARE, np.zeros((6, 1)), axis=1)
REPEAT, CLAMP, MIRROR = 10497, 33071, 33648
NEAREST = {"magFilter": 9728, "minFilter": 9728}
PLACES = {
    "as it is": {},
    "repeat": {"wraps": (REPEAT, REPEAT), "scale": (2.0, 3.0), "offset": (-0.3, 0.6)},
    "clamp": {"wraps": (CLAMP, CLAMP), "scale": (2.0, 3.0), "offset": (-0.5, -1.2)},
    "mirror": {"wraps": (MIRROR, MIRROR), "scale": (3.0, 2.0), "offset": (-1.2, -0.4)},
    "both": {"wraps": (MIRROR, CLAMP), "scale": (2.5, 1.5), "offset": (0.2, -0.25)},
    "turned": {"rotation": 0.4, "scale": (0.5, -0.75), "offset": (0.1, 0.9)},
    "second set": {"rotation": -2.0, "scale": (2.0, 2.0), "uv_set": 1},
}
SLOTS = {
    "base color": lambda image: {"pbrMetallicRoughness": {"baseColorTexture": image}},
    "emission": lambda image: {"emissiveTexture": image, "emissiveFactor": [1, 1, 1]},
    "normal": lambda image: {"normalTexture": image},
    "roughness": lambda image: {"pbrMetallicRoughness": {"metallicRoughnessTexture": image}},
    "occlusion": lambda image: {"occlusionTexture": image},
}


def placed_texels(codes, *, wraps=(REPEAT, REPEAT), offset=(0, 0), rotation=0.0, scale=(1, 1),
                  uv_set=0):  # fmt: skip
    """(N, N, C) texels that the pixels of a card show, after KHR_texture_transform and samplers."""
    v, u = (np.mgrid[:N, :N] + 0.5) / N  # downwards, as in glTF
    if uv_set:
        u, v = v, u
    u, v = u * scale[0], v * scale[1]
    cosine, sine = math.cos(rotation), math.sin(rotation)
    u, v = cosine * u + sine * v + offset[0], cosine * v - sine * u + offset[1]
    rows = []
    for values, wrap, n in ((v, wraps[1], codes.shape[0]), (u, wraps[0], codes.shape[1])):
        index = np.floor(values * n).astype(int)
        if wrap == MIRROR:
            index = np.where(index // n % 2, n - 1 - index % n, index % n)
        rows.append(np.clip(index, 0, n - 1) if wrap == CLAMP else index % n)
    return codes[tuple(rows)]


def picture_of(folder, codes, slot, place, **fields):
    """A card with an image in a slot, placed by an extension and a sampler of the file."""
    write_image(codes, folder / "card.png", color=False)
    sets = {"TEXCOORD_0": SQUARE * (1, -1) + (0, 1)}
    sets["TEXCOORD_1"] = sets["TEXCOORD_0"][:, ::-1]
    asset = Asset()
    asset.json["meshes"][0]["primitives"].clear()
    asset.add(POSITION=FLAT, NORMAL=0.0 * FLAT + [0, 0, 1], **sets)
    wraps = place.get("wraps", (REPEAT, REPEAT))
    extension = {name: place[name] for name in ("offset", "rotation", "scale") if name in place}
    extension["texCoord"] = place.get("uv_set", 0)
    info = asset.texture(
        (folder / "card.png").read_bytes(),
        {**NEAREST, "wrapS": wraps[0], "wrapT": wraps[1]},
        extensions={"KHR_texture_transform": extension},
    )
    asset.material(**SLOTS[slot](info), **fields)
    return drawn(asset.read(folder), (0.5, 0.5, 0.0), 1.0, N)


@pytest.fixture
def codes():
    """A small image without equal neighbors; as a normal map, it leans in all directions."""
    values = np.random.default_rng(10).integers(60, 196, (6, 8, 3))
    values[..., 2] = 220
    return values.astype(np.uint8)


@pytest.mark.parametrize(
    ("slot", "place"),
    # The relief of a normal map turns with its image.
    [(slot, name) for slot in SLOTS for name in PLACES
     if slot != "normal" or "rotation" not in PLACES[name]],
)  # fmt: skip
def test_a_card_shows_the_texels_of_the_specification(tmp_path, codes, slot, place):
    found = picture_of(tmp_path, codes, slot, PLACES[place])
    texels = placed_texels(codes, **PLACES[place])
    expected = picture_of(tmp_path, texels, slot, {"wraps": (CLAMP, CLAMP)})
    assert expected.std() > 0.01
    assert (np.abs(found - expected).max(axis=2) > 0.01).mean() < 0.005


@pytest.mark.parametrize("cutoff", [0.25, None, 0.75])
def test_texels_with_less_alpha_than_the_cutoff_are_transparent(tmp_path, codes, cutoff):
    codes = np.dstack([codes, np.linspace(0, 255, codes[..., 0].size).reshape(6, 8)])
    texels = placed_texels(codes.astype(np.uint8))
    fields = {"alphaMode": "MASK", "emissiveFactor": [1, 1, 1]}
    fields |= {} if cutoff is None else {"alphaCutoff": cutoff}
    found = picture_of(tmp_path, texels, "base color", {"wraps": (CLAMP, CLAMP)}, **fields)
    expected = texels[..., 3] / 255 >= (cutoff or 0.5)
    assert ((found > 0.99).all(axis=2) == expected).mean() > 0.995
