"""Each model against its formula, evaluated in plain Python at every pixel of a wall."""

import math

import numpy as np
import pytest

from texbake import Ambient, ImageTexture, Light, Lighting, Material
from texbake.rendering.effects.shading_models import LEAST_ALPHA

# Light is float32, and gathered over two lamps and ambient light.
CLOSE = {"rtol": 2e-6, "atol": 1e-7}
TO_LIGHTS = ((0.3, 0.5, 1.0), (-0.8, 0.1, 0.4))
LAMPS = Lighting(
    lights=(
        Light(name="a", direction=tuple(-x for x in TO_LIGHTS[0]), color=(1.0, 0.9, 0.7)),
        Light(
            name="b", direction=tuple(-2 * x for x in TO_LIGHTS[1]), color=(0.1, 0.4, 0.9),
            intensity=1.5,
        ),
    ),
    ambient=Ambient(color=(0.05, 0.06, 0.07)),
)  # fmt: skip
RADIANCES = np.array([[1.0, 0.9, 0.7], [0.15, 0.6, 1.35]])
NORMAL = np.array((0.2, -0.3, 1.0)) / math.sqrt(1.13)
BASE = np.array((0.7, 0.4, 0.1))


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


def test_lambert_is_the_cosine(wall):
    found = wall.light(Material(shading="lambert", base_color=tuple(BASE)), LAMPS, normal=NORMAL)
    expected = BASE * (
        np.array((0.05, 0.06, 0.07))
        + sum(
            radiance * (NORMAL @ unit(to_light))
            for radiance, to_light in zip(RADIANCES, TO_LIGHTS, strict=True)
        )
    )
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), **CLOSE)


@pytest.mark.parametrize("gloss", [None, 0.4])
@pytest.mark.parametrize("exponent", [0.0, 1.0, 60.0])
def test_blinn_phong_is_its_formula(wall, exponent, gloss):
    # C = C_b I_a + sum I_L (C_b (N·L) + C_s (N·H)^e)
    specular = np.array((0.3, 0.5, 0.2))
    material = Material(
        shading="blinn-phong", base_color=tuple(BASE), specular=tuple(specular), exponent=exponent,
        gloss=gloss,
    )  # fmt: skip
    found = wall.light(material, LAMPS, normal=NORMAL)
    expected = np.zeros_like(found) + BASE * (0.05, 0.06, 0.07)
    for radiance, to_light in zip(RADIANCES, TO_LIGHTS, strict=True):
        to_light = unit(to_light)
        half = to_light + wall.to_eye
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        shine = (1.0 if gloss is None else gloss) * (half @ NORMAL)[..., None] ** exponent
        expected += radiance * (BASE * (NORMAL @ to_light) + specular * shine)
    # A power multiplies the rounding of the float32 cosine by the exponent.
    np.testing.assert_allclose(found, expected, rtol=2e-6 + 2e-7 * exponent)


def gltf_brdf(n, v, l, base, metallic, roughness):  # noqa: E741
    """Appendix B of glTF 2.0, `pi * material(...)`, in Python, but V height-correlated."""
    dot = lambda a, b: sum(x * y for x, y in zip(a, b, strict=True))  # noqa: E731
    h = [a + b for a, b in zip(l, v, strict=True)]
    length = math.sqrt(dot(h, h))
    h = [x / length for x in h]
    alpha = roughness**2
    d = alpha**2 / (math.pi * (dot(n, h) ** 2 * (alpha**2 - 1) + 1) ** 2)
    lam = lambda c: 0.5 * (math.sqrt(1 + alpha**2 * (1 - c * c) / (c * c)) - 1)  # noqa: E731
    masking = 1 / (1 + lam(dot(n, l)) + lam(dot(n, v)))
    specular = masking * d / (4 * dot(n, l) * dot(n, v))

    def conductor_fresnel(f0):
        return specular * (f0 + (1 - f0) * (1 - abs(dot(v, h))) ** 5)

    def fresnel_mix(color):
        fresnel = 0.04 + (1 - 0.04) * (1 - abs(dot(v, h))) ** 5
        return (1 - fresnel) * color / math.pi + fresnel * specular

    return [
        math.pi * ((1 - metallic) * fresnel_mix(c) + metallic * conductor_fresnel(c)) for c in base
    ]


@pytest.mark.parametrize("metalness", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.15, 0.5, 1.0])
def test_metallic_roughness_is_gltf(wall, roughness, metalness):
    material = Material(base_color=tuple(BASE), roughness=roughness, metalness=metalness)
    lamps = Lighting(lights=LAMPS.lights)
    found = wall.light(material, lamps, normal=NORMAL)
    expected = np.zeros_like(found)
    for radiance, to_light in zip(RADIANCES, TO_LIGHTS, strict=True):
        l = unit(to_light)  # noqa: E741
        for place in np.ndindex(found.shape[:2]):
            brdf = gltf_brdf(NORMAL, wall.to_eye[place], l, BASE, metalness, roughness)
            expected[place] += radiance * (NORMAL @ l) * np.array(brdf)
    # The narrow highlight of roughness 0.15 multiplies the rounding of (N·H)^2 near 1, 6e-8, by
    # 2 / alpha^2 = 4000.
    np.testing.assert_allclose(found, expected, rtol=5e-6 if roughness > 0.2 else 1e-3)


def test_metals_between_are_mixed_as_gltf_mixes_colors(wall):
    # Appendix B allows to mix F_0 and the diffuse color instead of the two results; they differ
    # only by products of the Fresnel term, so that the ends agree and the middle lies between.
    def seen(metalness):
        return wall.light(Material(base_color=(0.04,) * 3, metalness=metalness), LAMPS)

    dull, half, metal = seen(0.0), seen(0.5), seen(1.0)
    # With a base color of 0.04 F_0 is the same for both, and light is linear in the metalness but
    # for ambient light, which is the same.
    np.testing.assert_allclose(half, (dull + metal) / 2, rtol=1e-5)


def test_index_of_refraction_sets_what_is_reflected_head_on(wall):
    # Eye, light and normal in one line: D V = 1 / (4 pi alpha^2) there, F = F_0.
    l = unit(wall.camera.eye - wall.points[8, 12])  # noqa: E741
    lamps = Lighting(lights=(Light(direction=tuple(-l)),))
    for ior, expected in ((1.5, 0.04), (2.0, 1 / 9), (1.0, 0.0)):
        material = Material(base_color=(0.0,) * 3, roughness=1.0, ior=ior)
        found = wall.light(material, lamps, normal=l)[8, 12, 0]
        assert found == pytest.approx(expected / 4, rel=1e-4, abs=1e-7), ior


def test_light_from_behind_the_surface_adds_nothing(wall):
    behind = Lighting(lights=(Light(direction=(0.0, 0.1, 1.0)), Light(direction=(0, 1, 0))))
    for shading in "lambert", "blinn-phong", "metallic-roughness":
        assert not wall.light(Material(shading=shading), behind).any()


def test_a_smooth_mirror_stays_finite(wall):
    eye = unit(wall.camera.eye - wall.points[8, 12])
    mirrored = 2 * eye[2] * np.array((0, 0, 1.0)) - eye
    for normal, to_light in ((None, mirrored), (tuple(eye), tuple(eye))):
        lamps = Lighting(lights=(Light(direction=tuple(-np.asarray(to_light))),))
        found = wall.light(Material(roughness=0.0, metalness=1.0), lamps, normal=normal)
        # At most pi D V F (N·L) of alpha = 0.001 where all lie in one line: 1 / (4 alpha^2).
        assert np.isfinite(found).all() and found.max() <= 0.25 / LEAST_ALPHA**2 * 1.01
        assert found.max() > 100


def test_slots_of_a_model_come_from_images(wall):
    # Values that vary over the surface give what the constants give that stand there.
    levels = np.array([0.2, 0.9], np.float32)
    image = ImageTexture(
        image=np.tile(levels.repeat(4)[None, :, None], (8, 1, 1)), filter="nearest"
    )
    for shading, slot in (
        ("metallic-roughness", "roughness"),
        ("metallic-roughness", "metalness"),
        ("blinn-phong", "gloss"),
        ("blinn-phong", "exponent"),
    ):
        found = wall.light(Material(shading=shading, **{slot: image}), LAMPS, normal=NORMAL)
        low, high = (
            wall.light(Material(shading=shading, **{slot: float(level)}), LAMPS, normal=NORMAL)
            for level in levels
        )
        expected = np.where(wall.uvs[..., :1] < 0.5, low, high)
        np.testing.assert_allclose(found, expected, rtol=1e-6)
        assert np.abs(low - high).max() > 1e-3
