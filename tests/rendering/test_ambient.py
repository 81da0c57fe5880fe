import math
from dataclasses import replace

import numpy as np
import pytest

from texbake.rendering.scene.lights import Ambient, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.textures import ImageTexture

SKY, GROUND = np.array((0.2, 0.5, 0.9)), np.array((0.4, 0.1, 0.05))
BASE = np.array((0.3, 0.6, 0.9))
CLOSE = {"rtol": 1e-6, "atol": 1e-7}  # float32 light


def everywhere(value):
    return np.broadcast_to(value, (16, 24, 3))


@pytest.mark.parametrize("shading", ["lambert", "blinn-phong", "metallic-roughness"])
def test_ambient_light_is_the_base_color_times_it(wall, shading):
    material = Material(shading=shading, base_color=tuple(BASE), metalness=0.7)
    found = wall.light(material, Lighting(ambient=Ambient(color=tuple(SKY))))
    np.testing.assert_allclose(found, everywhere(BASE * SKY), **CLOSE)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.8])
def test_a_hemisphere_is_weighted_by_how_far_the_normal_points_up(wall, up, tilt):
    normal = np.array((0.3, tilt, 1.0)) / math.sqrt(1.09 + tilt**2)
    found = wall.light(
        Material(shading="lambert", base_color=tuple(BASE)),
        Lighting(ambient=Ambient(color=tuple(SKY), ground=tuple(GROUND))),
        normal=normal,
        options=replace(wall.options, up=up),
    )
    above = 0.5 + 0.5 * normal[1 if up == "y" else 2]
    np.testing.assert_allclose(
        found, everywhere(BASE * (above * SKY + (1 - above) * GROUND)), **CLOSE
    )


def test_emission_is_added_and_needs_no_light(wall):
    glowing = (2.0, 0.5, 0.25)
    for shading in "unlit", "lambert":
        found = wall.light(
            Material(shading=shading, base_color=tuple(BASE), emission=glowing),
            Lighting(ambient=Ambient(color=tuple(SKY))),
        )
        seen = BASE if shading == "unlit" else BASE * SKY
        np.testing.assert_allclose(found, everywhere(seen + glowing), **CLOSE)


@pytest.mark.parametrize("metalness", [None, 0.25])
def test_a_light_map_is_scattered_by_the_dull_part(wall, metalness):
    rng = np.random.default_rng(1)
    texels = rng.random((5, 7, 3)).astype(np.float32)
    material = Material(
        shading="lambert" if metalness is None else "metallic-roughness",
        base_color=tuple(BASE),
        metalness=metalness or 0.0,
        light_map=ImageTexture(image=texels, filter="nearest"),
    )
    found = wall.light(material)
    columns = np.floor(wall.uvs[..., 0] * 7).astype(int)
    rows = np.floor((1 - wall.uvs[..., 1]) * 5).astype(int)
    expected = texels[rows, columns] * BASE * (1 - (metalness or 0.0))
    np.testing.assert_allclose(found, expected, **CLOSE)


@pytest.mark.parametrize("strength", [1.0, 0.5, 0.0])
def test_an_occlusion_map_holds_back_light_from_everywhere_alone(wall, strength):
    material = Material(
        shading="lambert",
        base_color=tuple(BASE),
        occlusion=0.3,
        occlusion_strength=strength,
        emission=(0.1, 0.1, 0.1),
        light_map=0.5,
    )
    found = wall.light(material, Lighting(ambient=Ambient(color=tuple(SKY))))
    share = 1 + strength * (0.3 - 1)
    np.testing.assert_allclose(found, everywhere(BASE * (share * SKY + 0.5) + 0.1), **CLOSE)
