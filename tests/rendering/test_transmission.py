"""A sheet of glass that fills the picture, in front of a wall whose colors grow along x and y."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import ImageTexture, Light, Lighting, Material, Scene, SceneObject
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.material import Transmission
from texbake.rendering.scene.scene import transform_matrix

DEPTH = 3.0  # of the wall behind the sheet
CLEAR = Material(base_color=(1.0, 1.0, 1.0), roughness=0.0, ior=1.0, transmission=Transmission())
COLORS = np.array([[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]], np.float32)


def behind_glass(wall, glass, lighting=None, *, visible=True, texture=None):
    """(16, 24, 3) float64: light of a picture."""
    mesh = wall.mesh(colors=COLORS)
    back = Material(shading="unlit", base_color=(1.0, 1.0, 1.0), vertex_colors=texture is None)
    if texture is not None:
        back = replace(back, base_color=ImageTexture(image=texture, filter="nearest", color=False))
    far = transform_matrix(translate=(0.0, 0.0, -DEPTH), scale=3.0)
    objects = (
        SceneObject(mesh=mesh, material=back, transform=far),
        SceneObject(mesh=wall.mesh(), material=glass, visible=visible),
    )
    scene = Scene(objects=objects, lighting=lighting or Lighting())
    return draw(prepare(scene, wall.options), wall.camera).color[..., :3].astype(np.float64)


def unmirrored(wall, least=0.0):
    """(16, 24, 1): what Schlick's approximation leaves to come through."""
    return (1.0 - least) * (1.0 - (1.0 - wall.to_eye[..., 2:]) ** 5)


def test_a_clear_sheet_shows_what_lies_behind_it(wall):
    expected = unmirrored(wall) * behind_glass(wall, CLEAR, visible=False)
    np.testing.assert_allclose(behind_glass(wall, CLEAR), expected, rtol=1e-5)


def test_a_sheet_tints_what_it_does_not_mirror(wall):
    color = np.array((0.9, 0.5, 0.2))
    glass = replace(
        CLEAR, base_color=tuple(color), ior=1.5, transmission=Transmission(strength=0.75)
    )
    expected = 0.75 * color * unmirrored(wall, 0.04) * behind_glass(wall, glass, visible=False)
    np.testing.assert_allclose(behind_glass(wall, glass), expected, rtol=1e-5)


def test_what_comes_through_is_taken_from_what_is_scattered(wall):
    sun = Lighting(lights=(Light(kind="directional", direction=(0.2, 0.1, -1.0)),))
    base = np.array((0.8, 0.6, 0.4))
    glass = Material(base_color=tuple(base), roughness=0.0, transmission=Transmission(strength=0.3))
    opaque = replace(glass, base_color=tuple(0.7 * base), transmission=None)
    dark = behind_glass(wall, glass)
    expected = dark + behind_glass(wall, opaque, sun)
    np.testing.assert_allclose(behind_glass(wall, glass, sun), expected, rtol=1e-5)


def test_a_volume_bends_by_snell_and_absorbs(wall):
    thickness, index, color = 0.8, 1.4, np.array((0.25, 0.5, 1.0))
    volume = Transmission(
        thickness=thickness, attenuation_color=tuple(color), attenuation_distance=0.4
    )
    glass = replace(CLEAR, ior=index, transmission=volume)
    across = -wall.to_eye[..., :2] / index
    depth = np.sqrt(1.0 - (across**2).sum(axis=-1, keepdims=True))
    ends = wall.points + thickness * np.concatenate([across, -depth], axis=-1)
    way = ends - wall.camera.eye
    seen = wall.camera.eye + way * ((-DEPTH - wall.camera.eye[2]) / way[..., 2:])
    uv = seen[..., :2] / 30.0 + 0.5
    behind = np.concatenate([uv, np.full_like(uv[..., :1], 0.5)], axis=-1)
    passed = unmirrored(wall, ((index - 1.0) / (index + 1.0)) ** 2)
    found = behind_glass(wall, glass)
    # The picture is looked up between pixels, where perspective is not quite linear; its border
    # is what lies outside.
    inner = (slice(3, -3), slice(3, -3))
    np.testing.assert_allclose(found[inner], (passed * color**2 * behind)[inner], atol=2e-3)
    thin = behind_glass(wall, replace(glass, transmission=replace(volume, thickness=0.0)))
    assert np.abs(thin - found)[inner].max() > 0.05


def test_roughness_blurs_what_lies_behind(wall):
    checks = np.indices((64, 64)).sum(axis=0)[..., None].repeat(3, axis=2) % 2
    glass = replace(CLEAR, ior=1.5)
    spread = [
        behind_glass(wall, replace(glass, roughness=value), texture=checks.astype(np.float32)).std()
        for value in (0.0, 0.3, 0.6, 1.0)
    ]
    assert spread[0] > 1.3 * spread[1] > 1.3**2 * spread[2] and spread[2] > spread[3]


def test_an_image_says_where_light_comes_through(wall):
    halves = np.zeros((1, 2, 1), np.float32)
    halves[:, 1] = 1.0
    image = ImageTexture(image=halves, filter="nearest", color=False)
    found = behind_glass(wall, replace(CLEAR, transmission=Transmission(strength=image)))
    clear = wall.uvs[..., 0] > 0.5
    assert 50 < clear.sum() < clear.size - 50
    np.testing.assert_array_equal(found[clear], behind_glass(wall, CLEAR)[clear])
    assert not found[~clear].any()


@pytest.mark.parametrize(
    "fields", [{"metalness": 1.0}, {"shading": "lambert"}, {"base_color": (0.0, 0.0, 0.0)}]
)
def test_nothing_comes_through_what_scatters_nothing(wall, fields):
    sun = Lighting(lights=(Light(kind="directional", direction=(0.2, 0.1, -1.0)),))
    glass = replace(CLEAR, ior=1.5, roughness=0.4, **fields)
    found = behind_glass(wall, glass, sun)
    np.testing.assert_array_equal(found, behind_glass(wall, replace(glass, transmission=None), sun))


def test_glass_is_not_seen_through_glass(wall):
    red = replace(CLEAR, base_color=(1.0, 0.0, 0.0))
    objects = tuple(
        SceneObject(
            mesh=wall.mesh(colors=COLORS),
            material=material,
            transform=transform_matrix(translate=(0.0, 0.0, z), scale=3.0),
        )
        for material, z in (
            (Material(shading="unlit", vertex_colors=True, base_color=(1.0, 1.0, 1.0)), -DEPTH),
            (red, -1.0),
            (CLEAR, 0.0),
        )
    )
    frame = draw(prepare(Scene(objects=objects), wall.options), wall.camera)
    expected = unmirrored(wall) * behind_glass(wall, CLEAR, visible=False)
    np.testing.assert_allclose(frame.color[..., :3], expected, rtol=1e-5)
