"""Legends over a position and over a distance, and an image's values as colors."""

import numpy as np
import pytest

from texbake.baking.texture.options import SolidOptions
from texbake.baking.texture.solid import bake_solid
from texbake.errors import FileFormatError, OptionError
from texbake.mesh.shapes import plane
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture
from texbake.texture.image import write_image
from texbake.texture.lookup import ramp_lookup
from texbake.texture.procedures import evaluate

WRAPPED = {
    "clamp": lambda x: np.clip(x, 0, 1),
    "repeat": lambda x: x % 1.0,
    "mirror": lambda x: 1 - abs(1 - x % 2.0),
}
LEGEND = ((0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (1.0, 0.2, 0.0))


@pytest.mark.parametrize("wrap", WRAPPED)
def test_gradients_and_distances_are_linear_between_their_marks(wrap):
    points = np.random.default_rng(1).uniform(-5, 5, (500, 3))
    parameters = {"direction": (3, 0, 4), "start": 0.5, "end": -1.5, "wrap": wrap}
    expected = WRAPPED[wrap]((0.5 - points @ (0.6, 0.0, 0.8)) / 2.0)
    found = evaluate("gradient", points, parameters=parameters)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-6)
    parameters = {"center": (1, 2, 3), "start": 1.0, "end": 2.5, "wrap": wrap}
    expected = WRAPPED[wrap]((np.linalg.norm(points - (1, 2, 3), axis=1) - 1.0) / 1.5)
    found = evaluate("radial", points, parameters=parameters)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-6)


@pytest.mark.parametrize("wrap", WRAPPED)
def test_a_wide_pixel_shows_the_mean(wrap):
    """Against the sum of many points."""
    centers = np.random.default_rng(1).uniform(-3, 4, 100)
    steps = (np.arange(4000) + 0.5) / 4000 - 0.5
    for width in 0.01, 0.7, 3.2:
        expected = WRAPPED[wrap](centers[:, None] + width * steps).mean(axis=1)
        points = np.stack([centers, 0 * centers, 0 * centers], axis=1)
        parameters = {"direction": (1, 0, 0), "wrap": wrap}
        found = evaluate("gradient", points, np.full(100, width), parameters=parameters)
        np.testing.assert_allclose(found[:, 0], expected, atol=1e-3)  # of the sum, at the jumps


def test_a_legend_without_length_is_refused():
    with pytest.raises(OptionError, match=r"gradient\.end: it is that of the start"):
        evaluate("gradient", [[0.0, 0.0, 0.0]], parameters={"start": 1.0})


def test_bake_texture_measures_in_model_units():
    mesh = plane(4, 4)
    mesh = mesh.replace(positions=10.0 * mesh.positions)
    options = SolidOptions(
        procedure="gradient", parameters={"start": 2.0, "end": 7.0}, colors=LEGEND, size=40,
        samples=1, padding=0,
    )  # fmt: skip
    heights = 10.0 * (1.0 - (np.arange(40) + 0.5) / 40)
    expected = ramp_lookup(np.array(LEGEND), ((heights - 2.0) / 5.0).astype(np.float32))
    found = bake_solid(mesh, options).values
    # A sample is as wide as 0.05 of the legend, over whose stops the mean is not linear.
    np.testing.assert_allclose(found[:, 7], expected, atol=0.02)


def drawn(material):
    view = CameraView(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 0.0), fov=15.0)
    scene = Scene(objects=(SceneObject(mesh=plane(), material=material),), view=view)
    return render_scene(scene, RenderOptions(width=32, height=32, supersampling=1)).color[..., :3]


def test_an_image_of_temperatures_has_a_legend():
    degrees = np.linspace(15.0, 95.0, 32, dtype=np.float32)[None, :, None].repeat(4, axis=0)
    heat = ImageTexture(image=degrees, filter="bilinear", colors=LEGEND, range=(20.0, 80.0))
    shown = drawn(Material(shading="unlit", base_color=heat))
    plain = drawn(Material(shading="unlit", base_color=ProcedureTexture(
        procedure="gradient", colors=LEGEND, filtered=False,
        parameters={"direction": (1, 0, 0), "start": (5 / 80 * 31 + 0.5) / 32,
                    "end": (65 / 80 * 31 + 0.5) / 32})))  # fmt: skip
    np.testing.assert_allclose(shown, plain, atol=2e-3)
    with pytest.raises(OptionError, match=r"opacity\.colors: it takes numbers"):
        drawn(Material(opacity=heat))


def test_the_colors_of_a_ramp_may_be_the_first_row_of_an_image(tmp_path):
    codes = np.array([[[0, 0, 128], [0, 128, 0], [255, 60, 0]], [[9, 9, 9]] * 3], np.uint8)
    write_image(codes, tmp_path / "ramp.png")
    write_image(codes[:, :1], tmp_path / "dot.png")
    text = "[[objects]]\nshape = 'plane'\n[objects.material]\nshading = 'unlit'\nbase_color = "
    ramp = "{procedure = 'gradient', direction = [1, 0, 0], colors = %s}\n"

    def picture(colors):
        (tmp_path / "scene.toml").write_text(text + ramp % colors)
        scene = read_scene(tmp_path / "scene.toml")
        return render_scene(scene, RenderOptions(width=32, height=32)).color

    listed = picture("['#000080', '#008000', '#ff3c00']")
    np.testing.assert_allclose(picture("'ramp.png'"), listed, atol=1e-6)
    with pytest.raises(FileFormatError, match="it is one pixel wide; a ramp needs two colors"):
        picture("'dot.png'")
    with pytest.raises(FileFormatError, match=r"no\.png"):
        picture("'no.png'")
