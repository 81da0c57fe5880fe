"""What effects contribute, against pictures drawn by hand with and without them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake.mesh.shapes import plane, uv_sphere
from texbake.pages.picture_pages import write_contributions_page
from texbake.rendering.compare_models import contributions_of
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Ambient, Light, Lighting, Shadow
from texbake.rendering.scene.material import BumpMap, Material
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.encoding import quantize_srgb

OPTIONS = RenderOptions(width=64, height=48)
FLAT = BumpMap(texture=ImageTexture(image=np.full((4, 4, 1), 0.5, np.float32)))
NOISE = ProcedureTexture(procedure="noise", scale=4.0)


def scene() -> Scene:
    """A ball over a floor: a shadow, ambient light, bumps on the ball and none on the floor."""
    floor = transform_matrix(scale=6.0, rotate=(-90, 0, 0), translate=(-3, -1, 3))
    ball = Material(shading="lambert", base_color=NOISE)
    return Scene(
        objects=(
            SceneObject(mesh=uv_sphere(16, 32), material=ball),
            SceneObject(
                mesh=plane(), material=Material(shading="lambert", bump_map=FLAT), transform=floor
            ),
        ),
        lighting=Lighting(
            lights=(Light(direction=(-0.5, -1.0, -0.3), shadow=Shadow(size=256)),),
            ambient=Ambient(color=(0.2, 0.2, 0.3)),
        ),
    )


def codes(of: Scene) -> np.ndarray:
    frame = render_scene(of, OPTIONS)
    return np.asarray(quantize_srgb(frame.color[..., :3], 8)).astype(int)


def test_pixels_that_change_are_those_of_pictures_with_and_without() -> None:
    given = scene()
    found = {item.name: item for item in
             contributions_of(given, OPTIONS, render_scene(given, OPTIONS))}  # fmt: skip
    lighting = given.lighting
    unshadowed = tuple(replace(light, shadow=None) for light in lighting.lights)
    plain = tuple(
        replace(item, material=replace(item.material, base_color=(0.8, 0.8, 0.8)))
        for item in given.objects
    )
    others = {
        "shadow maps": replace(given, lighting=replace(lighting, lights=unshadowed)),
        "ambient": replace(given, lighting=replace(lighting, ambient=Ambient())),
        "procedures": replace(given, objects=plain),
    }
    whole = codes(given)
    for name, other in others.items():
        difference = np.abs(whole - codes(other))
        item = found[name]
        assert item.pixels == difference.any(axis=2).sum() > 0
        assert item.largest == difference.max()
        assert item.share == item.pixels / (64 * 48)
        np.testing.assert_array_equal(item.difference, difference)
        assert item.milliseconds >= 0.0
    assert found["shadow maps"].n_bytes > 0


def test_an_effect_that_changes_nothing_shows_itself() -> None:
    given = scene()
    found = {item.name: item.pixels for item in
             contributions_of(given, OPTIONS, render_scene(given, OPTIONS))}  # fmt: skip
    assert (found["bump map"], found["images"]) == (0, 0)
    assert min(found["lights"], found["shadow maps"], found["procedures"]) > 0


def test_the_page_shows_each_contribution(tmp_path: Path) -> None:
    given = scene()
    frame = render_scene(given, OPTIONS)
    found = contributions_of(given, OPTIONS, frame)
    write_contributions_page(tmp_path / "page.html", "<b>ball", frame, found, "texbake preview")
    page = (tmp_path / "page.html").read_text()
    assert "&lt;b&gt;ball" in page and "<b>ball" not in page
    pictures = re.findall(r'<img src="data:image/png;base64,[^"]+"[^>]*alt="([^"]*)"', page)
    changed = [f"Contribution of {item.name}" for item in found if item.pixels]
    assert pictures == ["The picture", *changed]
    assert page.count("<strong>changed nothing</strong>") == 2


def test_the_command_prints_what_changes(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        "[fog]\nmode = 'exp'\ndensity = 0.2\n"
        "[[lights]]\nkind = 'directional'\ndirection = [0, -1, -1]\n"
        "[[objects]]\nshape = 'sphere'\n"
    )
    picture, page = tmp_path / "picture.png", tmp_path / "page.html"
    words = ["preview", str(path), "-o", str(picture), "--size", "64x48"]
    words += ["--explain", "changes", "--html", str(page), "--report", str(tmp_path / "r.json")]
    result = CliRunner().invoke(texbake, words)
    assert result.exit_code == 0, result.output
    assert re.search(r"effect +pixels changed", result.output)
    assert re.search(r"fog +[\d,]+ ", result.output)
    assert page.exists() and '"effects"' in (tmp_path / "r.json").read_text()
    result = CliRunner().invoke(texbake, [*words, "--filter", "nearest,bilinear"])
    assert result.exit_code == 2 and "contributions: they are those of one picture" in result.output
