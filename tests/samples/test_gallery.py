"""The gallery's scenes, pictures and page say the same, and show all that there is."""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import texbake
from texbake.jobs.preview_scene import open_preview
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import BUFFERS
from texbake.rendering.scene.material import SHADINGS
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.procedures.options import PROCEDURE_NAMES

SAMPLES = Path(__file__).parents[2] / "samples"
sys.path.insert(0, str(SAMPLES))
try:
    import gallery
finally:
    sys.path.remove(str(SAMPLES))

SHOTS = {shot.name: shot for shot in gallery.shots()}


@cache
def passes_named(name, passes=gallery.passes):
    return passes(SHOTS[name])


gallery.passes = lambda shot: passes_named(shot.name)  # a scene is read and planned once
# Texels of what is rendered or prefiltered here: enough for a picture as small.
ENVIRONMENT = 16


def small(scene):
    """Return the scene with small environments, which decide nothing about its passes."""
    around = scene.lighting.environment
    if around is not None:
        around = replace(around, size=ENVIRONMENT)
        scene = replace(scene, lighting=replace(scene.lighting, environment=around))
    objects = []
    for item in scene.objects:
        material = item.material
        for name in "reflection", "refraction":
            mirror = getattr(material, name)
            if mirror is not None:
                material = replace(material, **{name: replace(mirror, size=ENVIRONMENT)})
        objects.append(replace(item, material=material))
    return replace(scene, objects=tuple(objects))


@pytest.mark.parametrize("name", SHOTS)
def test_a_scene_is_drawn_by_the_passes_that_the_page_names(name):
    shot = SHOTS[name]
    scene, ways = gallery.opened(shot, width=60, height=40)
    assert scene.notes == ()
    ran = []
    for _, options in ways:
        frame = texbake.render_scene(small(scene), options)
        assert np.isfinite(frame.color).all()
        # Something is seen, and it is not all of one color.
        assert frame.coverage.any() and np.ptp(frame.color[..., :3]) > 0.1
        ran += [item.name for item in frame.plan.passes]
    assert list(dict.fromkeys(ran)) == gallery.passes(shot)


def test_the_page_is_what_the_script_writes():
    assert gallery.PAGE.read_text() == gallery.page()


def test_every_scene_and_every_picture_is_on_the_page():
    assert {path.stem for path in gallery.SCENES.glob("*.toml")} == {
        shot.scene for shot in SHOTS.values()
    }
    assert {path.stem for path in gallery.PICTURES.iterdir()} == set(SHOTS)


def test_every_effect_is_called_for():
    shown = {name for shot in SHOTS.values() for name in gallery.passes(shot)}
    assert shown == {effect.name for effect in EFFECTS}


def test_baked_light_is_that_of_the_lamps_and_takes_none():
    passes = gallery.passes(SHOTS["light_map"])
    assert not set(passes) & {"lights", "shadow maps", "shadows", "ambient"}
    lamps, baked = (
        np.asarray(gallery.draw(SHOTS[name])).astype(float)
        for name in ("light_map_room", "light_map")
    )
    # In codes of 255. What differs is the edges of shadows, as wide as a texel of the maps.
    assert np.abs(baked - lamps).mean() < 0.4
    assert (np.abs(baked - lamps).max(axis=2) > 8).mean() < 0.015


def test_every_slot_shading_procedure_and_buffer_is_shown():
    scenes = [open_preview(path)[0] for path in sorted(gallery.SCENES.glob("*.toml"))]
    materials = [item.material for scene in scenes for item in scene.objects]
    default = texbake.Material()
    for name in type(default).__dataclass_fields__:
        if name in ("name", "alpha_cutoff", "occlusion_strength"):
            continue
        assert any(getattr(item, name) != getattr(default, name) for item in materials), name
    assert {item.shading for item in materials} == set(SHADINGS)
    textures = [
        value
        for item in materials
        for slot in vars(item).values()
        for value in (slot, getattr(slot, "texture", None))
    ]
    procedures = [value.procedure for value in textures if type(value) is ProcedureTexture]
    assert set(procedures) == set(PROCEDURE_NAMES)
    wraps = {value.wrap for value in textures if isinstance(value, ImageTexture)}
    assert wraps >= {"repeat", "mirror", "clamp", "border"}
    assert {shot.name for shot in SHOTS.values() if shot.name.startswith("buffer_")} == {
        f"buffer_{buffer}" for buffer in BUFFERS
    }
    forms = {item.bump_map.form for item in materials if item.bump_map is not None}
    assert forms == {"blinn", "exact", "emboss", "emboss-normalized"}
    assert {item.bump_map.light_space for item in materials if item.bump_map is not None} == {
        "world",
        "object",
    }


@pytest.mark.parametrize(
    "name", ["orange_colored", "marble", "shadow_spot", "buffer_normals", "affine"]
)
def test_pictures_are_those_in_the_repository(name):
    shot = SHOTS[name]
    with Image.open(shot.picture_file) as kept:
        expected = np.asarray(kept).astype(int)
    drawn = np.asarray(gallery.draw(shot)).astype(int)
    assert drawn.shape == expected.shape
    # The same codes on the machine that drew them; sines and powers of another processor's
    # mathematical functions differ in their last bit, which can turn one rounding to a code.
    assert np.abs(drawn - expected).max() <= 1
