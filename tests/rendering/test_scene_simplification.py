"""What declares that it changes no pixel: its passes are not in the plan, its files are not read.

Every image here is missing, so that reading one is an error. Each case comes with a value that
counts, for which that error must come.
"""

import os
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene

from texbake.errors import FileError
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effect import Effect
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Ambient, Environment, Light, Lighting, Shadow
from texbake.rendering.scene.material import (
    EMBOSS_FORMS,
    BumpMap,
    Material,
    NormalMap,
    Parallax,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.projected import ProjectedTexture
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject, camera_of
from texbake.rendering.scene.textures import ImageTexture

N_RANDOM_SCENES = int(os.environ.get("TEXBAKE_RANDOM_SCENES", "16"))
OPTIONS = RenderOptions(width=32, height=24)
IMAGE = ImageTexture(image="missing.png")
LIGHT = Light(direction=(0.3, -0.4, -1.0))
COLORED = ImageTexture(image=np.full((2, 2, 3), 0.5, np.float32))
UNLIT = {"shading": "unlit"}
LAMBERT = {"shading": "lambert"}
MATRIX = np.eye(4)


def scene_of(lighting, **material):
    objects = (SceneObject(mesh=uv_sphere(6, 8), material=Material(**material), name="ball"),)
    return Scene(objects=objects, lighting=lighting)


def normal_map(**given):
    return NormalMap(texture=IMAGE, space="tangent", convention="opengl", **given)


AMBIENT = Lighting(lights=(LIGHT,), ambient=Ambient(color=(0.2, 0.2, 0.2)))
NOTHING = Effect(name="nothing", does="nothing", left_out="nothing needs it")
EVEN = Lighting(ambient=Ambient(color=(0.2, 0.2, 0.2)))
AROUND = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32)
SKY = Lighting(lights=(LIGHT,), environment=Environment(image=AROUND))
BLINN = {"shading": "blinn-phong"}
OPAQUE = {"base_color": IMAGE, "alpha_mode": "opaque"}
BLACK = (0.0, 0.0, 0.0)
# The light, the material, and what makes the missing image count: a light or another material.
HIDDEN: dict[str, tuple[Lighting, dict[str, Any], Lighting, dict[str, Any]]] = {
    "an unlit normal map": (AMBIENT, UNLIT | {"normal_map": normal_map()}, AMBIENT, LAMBERT),
    "an unlit bump map": (AMBIENT, UNLIT | {"bump_map": BumpMap(texture=IMAGE)}, AMBIENT, LAMBERT),
    "parallax that moves no texture": (
        AMBIENT, LAMBERT | {"parallax": Parallax(texture=IMAGE)}, AMBIENT, {"base_color": COLORED},
    ),
    "a roughness of factor 0": (
        AMBIENT, {"roughness": replace(IMAGE, factor=0.0)}, AMBIENT, {"roughness": IMAGE},
    ),
    "a base color of factor 0": (
        AMBIENT, {"base_color": replace(IMAGE, factor=0.0), "alpha_mode": "opaque"},
        AMBIENT, {"alpha_mode": "blend"},
    ),
    "a reflection by an image with a factor of 0": (
        AMBIENT, LAMBERT | {"reflection": Reflection(strength=replace(IMAGE, factor=0.0))},
        AMBIENT, {"reflection": Reflection(strength=replace(IMAGE, factor=0.1), fresnel=True)},
    ),
    "occlusion of strength 0": (
        AMBIENT, {"occlusion": IMAGE, "occlusion_strength": 0.0}, AMBIENT,
        {"occlusion_strength": 1.0},
    ),
    "a projected picture of strength 0": (
        AMBIENT,
        LAMBERT | {"projected": (ProjectedTexture(texture=IMAGE, matrix=MATRIX, strength=0.0),)},
        AMBIENT, {"projected": (ProjectedTexture(texture=IMAGE, matrix=MATRIX),)},
    ),
    "the color of a perfect mirror": (
        SKY, OPAQUE | {"reflection": Reflection()}, SKY, {"reflection": Reflection(strength=0.9)},
    ),
    "the color of clear glass": (
        SKY, OPAQUE | {"refraction": Refraction()}, SKY, {"refraction": Refraction(strength=0.9)},
    ),
    "glass behind a perfect mirror": (
        SKY, {"reflection": Reflection(), "refraction": Refraction(strength=IMAGE)},
        SKY, {"reflection": Reflection(strength=0.9)},
    ),
    "a mirror in the dark": (
        EVEN, {"base_color": BLACK, "reflection": Reflection(strength=IMAGE)}, SKY, {},
    ),
    "the color where there is no light": (Lighting(), LAMBERT | OPAQUE, EVEN, {}),
    "the exponent of black highlights": (
        AMBIENT, BLINN | {"specular": BLACK, "exponent": IMAGE}, AMBIENT, {"specular": (0.1,) * 3},
    ),
    "highlights of gloss 0": (
        AMBIENT, BLINN | {"specular": IMAGE, "gloss": 0.0}, AMBIENT, {"gloss": 0.1},
    ),
    "highlights without lamps": (EVEN, BLINN | {"specular": IMAGE}, AMBIENT, {}),
    "roughness without highlights": (EVEN, {"roughness": IMAGE}, AMBIENT, {}),
    "metalness without highlights": (EVEN, {"metalness": IMAGE}, AMBIENT, {}),
    "a light map on a black surface": (
        AMBIENT, LAMBERT | {"base_color": BLACK, "light_map": IMAGE}, AMBIENT,
        {"base_color": (0.1, 0.0, 0.0)},
    ),
    "occlusion of a black surface": (
        AMBIENT, LAMBERT | {"base_color": BLACK, "occlusion": IMAGE}, AMBIENT,
        {"base_color": (0.1, 0.0, 0.0)},
    ),
    "the opacity of an opaque material": (
        AMBIENT, {"opacity": IMAGE, "alpha_mode": "opaque"}, AMBIENT, {"alpha_mode": "mask"},
    ),
    "the color of what has no opacity": (
        AMBIENT, {"base_color": IMAGE, "opacity": 0.0}, AMBIENT, {"opacity": 0.1},
    ),
    "the color of what a mask leaves out": (
        AMBIENT, {"base_color": IMAGE, "opacity": 0.4, "alpha_mode": "mask"}, AMBIENT,
        {"alpha_cutoff": 0.3},
    ),
    "normals in light from all sides": (
        EVEN, LAMBERT | {"normal_map": normal_map()},
        Lighting(ambient=Ambient(color=(0.2,) * 3, ground=(0.1,) * 3)), {},
    ),
    "bumps in light from all sides": (
        EVEN, LAMBERT | {"bump_map": BumpMap(texture=IMAGE)}, AMBIENT, {},
    ),
    "normals of a mirror in one color all around": (
        Lighting(environment=Environment(color=(0.2, 0.5, 0.9))),
        UNLIT | {"normal_map": normal_map(), "reflection": Reflection(strength=0.5)}, SKY, {},
    ),
    "normals of a mirror that shows nothing": (
        EVEN, UNLIT | {"normal_map": normal_map(), "reflection": Reflection(strength=0.5)}, SKY, {},
    ),
    "parallax that moves nothing but normals in even light": (
        EVEN, LAMBERT | {"normal_map": normal_map(), "parallax": Parallax(texture=IMAGE)},
        AMBIENT, {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HIDDEN)
def test_nothing_is_read_or_computed_for_what_changes_no_pixel(name):
    lighting, material, other_lighting, counts = HIDDEN[name]
    scene = scene_of(lighting, **material)
    camera = camera_of(scene, OPTIONS)
    seen = draw(prepare(scene, OPTIONS), camera)
    with pytest.raises(FileError, match=r"missing\.png"):
        draw(prepare(scene_of(other_lighting, **(material | counts)), OPTIONS), camera)
    # An effect of the caller's own keeps the material as it is; with an image that exists, the
    # picture is the same.
    present = replace(IMAGE, image=np.full((2, 2, 3), 0.7, np.float32))
    whole = scene_of(
        lighting, **{key: _with_image(part, present) for key, part in material.items()}
    )
    drawn = draw(prepare(whole, OPTIONS, effects=(*EFFECTS, NOTHING)), camera)
    np.testing.assert_array_equal(seen.color, drawn.color)
    np.testing.assert_array_equal(seen.coverage, drawn.coverage)


def _with_image(part, image):
    """Return a part of a material with another image in the place of the missing one."""
    if part is IMAGE:
        return image
    held = (
        [f.name for f in fields(part) if getattr(part, f.name) is IMAGE]
        if is_dataclass(part)
        else []
    )
    return replace(part, **dict.fromkeys(held, image)) if held else part


@pytest.mark.parametrize("field", ["normal_map", "bump_map"])
def test_normals_that_the_caller_keeps_count(field):
    maps = {"normal_map": normal_map(), "bump_map": BumpMap(texture=IMAGE)}
    scene = scene_of(AMBIENT, **UNLIT, **{field: maps[field]})
    with pytest.raises(FileError, match=r"missing\.png"):
        draw(prepare(scene, OPTIONS), camera_of(scene, OPTIONS), keep=("normals",))


@pytest.mark.parametrize(
    "environment", [Environment(image=AROUND), Environment(faces=(AROUND[:, :4],) * 6)]
)
def test_an_unlit_mirror_needs_its_normal_map(environment):
    around = replace(AMBIENT, environment=environment)
    scene = scene_of(around, **UNLIT, normal_map=normal_map(), reflection=Reflection())
    with pytest.raises(FileError, match=r"missing\.png"):
        draw(prepare(scene, OPTIONS), camera_of(scene, OPTIONS))


@pytest.mark.parametrize("gate", ["round", "rectangle"])
@pytest.mark.parametrize(
    ("degrees", "meets"), [(0.0, True), (49.0, True), (90.0, False), (180.0, False)]
)
def test_a_spot_that_shines_past_all_objects_is_dark(degrees, meets, gate):
    # The ball's bounding sphere, of radius sqrt(3), is seen from 4 units away under 25.7 degrees
    # to each side; the light has 20 to each side, and 27.2 to the corners of its cookie.
    radians = np.radians(degrees)
    spot = Light(
        kind="spot", position=(0.0, 0.0, 4.0), angle=40.0, gate=gate, profile=IMAGE, aspect=1.0,
        direction=(float(np.sin(radians)), 0.0, -float(np.cos(radians))), shadow=Shadow(size=8),
    )  # fmt: skip
    meets = meets and (degrees < 45.0 or gate == "rectangle")
    scene = scene_of(Lighting(lights=(LIGHT, spot)), **LAMBERT)
    prepared, camera = prepare(scene, OPTIONS), camera_of(scene, OPTIONS)
    if meets and degrees < 45.0:
        with pytest.raises(FileError, match=r"missing\.png"):
            draw(prepared, camera)
        return
    alone = scene_of(Lighting(lights=(LIGHT,)), **LAMBERT)
    np.testing.assert_array_equal(
        draw(prepared, camera).color, draw(prepare(alone, OPTIONS), camera).color
    )
    plan = plan_of(prepared, camera)
    if meets:  # the corner of a cookie of any shape would; this one reaches no pixel
        assert plan.has("light profiles")
        return
    told = [item.why for item in plan.left_out if item.name == "lights"]
    assert told == ["its cone meets no object"]
    assert not plan.has("light profiles") and not plan.has("shadow maps")


FRONT = CameraView(position=(0.0, 0.0, 6.0), target=(0.0, 0.0, 0.0))
BEHIND = Light(name="lamp", kind="spot", position=(0.0, 0.0, -5.0), direction=(0.0, 0.0, 1.0))
# A lamp whose cookie, a wide band, falls below the ball.
BELOW = replace(BEHIND, position=(0.0, 0.0, 10.0), direction=(0.0, -3.0, -10.0), angle=40.0,
                profile=ImageTexture(image=np.ones((8, 64, 3), np.float32)))  # fmt: skip
RELIEF = ImageTexture(image=np.random.default_rng(0).random((16, 16, 1)).astype(np.float32))


@pytest.mark.parametrize(("light", "material", "n_maps"), [
    (BEHIND, LAMBERT, 0),
    (replace(BEHIND, kind="point"), LAMBERT, 0),
    (replace(BEHIND, kind="directional"), LAMBERT, 0),
    *((replace(BEHIND, kind=kind), {**LAMBERT, "bump_map": BumpMap(texture=RELIEF, form=form)},
       0) for kind in ("spot", "directional") for form in EMBOSS_FORMS),
    (BELOW, LAMBERT, 0),
    (replace(BELOW, direction=(0.0, 0.0, -1.0)), LAMBERT, 1),
    (replace(BELOW, aspect=1.0), LAMBERT, 1),
])  # fmt: skip
def test_only_lamps_that_reach_a_visible_pixel_get_a_shadow_map(light, material, n_maps):
    light = replace(light, shadow=Shadow(size=64))
    lighting = Lighting(lights=(light,), ambient=Ambient(color=(0.1, 0.1, 0.1)))
    scene = replace(scene_of(lighting, **material), view=FRONT)
    frame = render_scene(scene, OPTIONS)
    # Depths and triangles, of four bytes each.
    assert frame.costs.by_name["shadow maps"].n_bytes == n_maps * 64 * 64 * 8
    dark = replace(lighting, lights=(replace(light, intensity=0.0),))
    is_same = np.array_equal(
        frame.color, render_scene(replace(scene, lighting=dark), OPTIONS).color
    )
    assert is_same == (n_maps == 0)


METAL = {"shading": "metallic-roughness", "metalness": 1.0}


@pytest.mark.parametrize(("fields", "scatters"), [
    (METAL, False),
    (METAL | {"metalness": 0.99}, True),
    (METAL | {"metalness": ImageTexture(image=np.ones((2, 2, 1), np.float32))}, True),
    (METAL | {"metalness": 0.0, "base_color": (0.0, 0.0, 0.0)}, False),
    (LAMBERT | {"metalness": 1.0}, True),
])  # fmt: skip
def test_only_surfaces_that_scatter_need_irradiance(fields, scatters):
    """In an environment of one color; other tests compare the mirrors of pure metals."""
    around = Environment(color=(0.2, 0.5, 0.9), lighting=True, background=False, size=8)
    scene = scene_of(Lighting(environment=around), **fields)
    camera = camera_of(scene, OPTIONS)
    frame = draw(prepare(scene, OPTIONS), camera)
    assert frame.plan.has("irradiance") == scatters
    assert ("irradiance" in frame.costs.by_name) == scatters
    lit = frame.color[frame.coverage == 1, :3]
    assert len(lit) > 0 and (lit > 0.0).all()
    if not scatters:  # compared with the same object beside one that needs irradiance
        other = replace(scene.objects[0], material=Material(shading="lambert"), name="other")
        both = replace(scene, objects=(*scene.objects, other))
        np.testing.assert_array_equal(draw(prepare(both, OPTIONS), camera).color, frame.color)


def test_baked_light_falls_on_a_surface_whose_model_reads_no_metalness():
    scene = scene_of(Lighting(), **LAMBERT, metalness=1.0, light_map=(0.5, 0.25, 1.0))
    color = draw(prepare(scene, OPTIONS), camera_of(scene, OPTIONS)).color[12, 16, :3]
    np.testing.assert_allclose(color, np.multiply(0.8, (0.5, 0.25, 1.0)), rtol=1e-6)


@pytest.mark.parametrize(("alpha", "covered"), [(0.7, False), (0.95, True)])
def test_opacity_above_the_cutoff_counts_beside_that_of_an_image(alpha, covered):
    image = np.full((2, 2, 4), alpha, np.float32)
    scene = scene_of(
        AMBIENT, **LAMBERT, base_color=ImageTexture(image=image), opacity=0.6, alpha_mode="mask"
    )
    frame = draw(prepare(scene, OPTIONS), camera_of(scene, OPTIONS))
    bare = scene_of(AMBIENT, **LAMBERT, alpha_mode="opaque")
    behind = draw(prepare(bare, OPTIONS), camera_of(bare, OPTIONS))
    middle = frame.color[12, 16, :3] != frame.color[0, 0, :3]
    assert middle.any() == covered
    assert (behind.color[12, 16, :3] != behind.color[0, 0, :3]).any()


def test_a_black_or_perfect_mirror_keeps_its_bumps():
    heights = np.random.default_rng(1).random((8, 8, 1)).astype(np.float32)
    bumps = BumpMap(texture=ImageTexture(image=heights), height=0.2)
    for mirror in (Reflection(strength=0.5), Reflection()):
        material = LAMBERT | {"base_color": BLACK, "reflection": mirror, "bump_map": bumps}
        scene = scene_of(SKY, **material)
        camera = camera_of(scene, OPTIONS)
        found = draw(prepare(scene, OPTIONS), camera).color
        whole = draw(prepare(scene, OPTIONS, effects=(*EFFECTS, NOTHING)), camera).color
        np.testing.assert_array_equal(found, whole)
        flat = scene_of(SKY, **(material | {"bump_map": None}))
        assert np.abs(found - draw(prepare(flat, OPTIONS), camera).color).max() > 0.05


def test_simpler_materials_look_the_same(images):
    """An effect of the caller's own keeps materials as they are."""
    for seed in range(N_RANDOM_SCENES):
        scene, options = random_scene(seed, images)
        camera = camera_of(scene, options)
        masks = any(item.material.alpha_mode == "mask" for item in scene.objects)
        if masks and scene.lighting.occlusion is not None:
            continue  # what is opaque by its mask hides ambient light, too
        found, whole = (
            draw(prepare(scene, options, effects=effects, threads=1), camera)
            for effects in (EFFECTS, (*EFFECTS, NOTHING))
        )
        np.testing.assert_allclose(found.color, whole.color, atol=1e-6, err_msg=str(seed))
        np.testing.assert_array_equal(found.coverage, whole.coverage, str(seed))
