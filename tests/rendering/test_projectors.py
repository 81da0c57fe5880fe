"""Light cookies and pictures projected onto surfaces: where they fall, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake.errors import OptionError
from texbake.mesh.shapes import plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effects.projectors import load_cookie, project_onto
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.projected import ProjectedTexture, projector_matrix
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture

OPTIONS = RenderOptions(width=120, height=120, supersampling=1, background=None)
ABOVE = Camera.looking_at((0, 6, 0), (0, 0, 0), up=(0, 0, -1), fov=math.radians(50), near=0.01)
WHITE = Material(shading="lambert", base_color=(1.0, 1.0, 1.0))
GRAY = Material(shading="unlit", base_color=(0.5, 0.5, 0.5))
# Red, green over blue, yellow.
QUARTERS = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 0]]], np.float32)


def drawn(material, *lights, camera=ABOVE):
    """(H, W, 3): a level floor about the origin."""
    matrix = transform_matrix(scale=6, rotate=(-90, 0, 0), translate=(-3, 0, 3))
    item = SceneObject(mesh=plane(3, 3), material=material, transform=matrix)
    scene = Scene(objects=(item,), lighting=Lighting(lights=lights))
    return draw(prepare(scene, OPTIONS), camera).color[..., :3]


def floor_points(camera=ABOVE):
    """(H, W, 2): x and z where the middles of pixels see the floor's plane."""
    rays = pixel_rays(camera, 120, 120)
    return np.asarray((camera.eye - camera.eye[1] / rays[..., 1:2] * rays)[..., [0, 2]])


def spot(cookie, height=4.0, **more):
    profile = None if cookie is None else ImageTexture(image=cookie, filter="nearest")
    return Light(
        kind="spot", position=(0, height, 0), direction=(0, -2, 0), up=(0, 0, -1), angle=50.0,
        blend=0.0, decay=0.0, profile=profile, gate="round", **more,
    )  # fmt: skip


def test_a_cookie_colors_the_light_of_a_spot():
    bare, colored = (drawn(WHITE, spot(cookie)) for cookie in (None, QUARTERS))
    at = floor_points()
    lit = bare[..., 0] > 0.0
    # The cone's foot: 4 tan 25 degrees about the spot, and nothing outside.
    radius = np.hypot(at[..., 0], at[..., 1])
    assert (lit == (radius < 4.0 * math.tan(math.radians(25)))).mean() > 0.999
    # Upright along -z, seen from the lamp with +x to the right.
    expected = QUARTERS[(at[..., 1] > 0.0).astype(int), (at[..., 0] > 0.0).astype(int)]
    inside = lit & (np.abs(at) > 1e-9).all(axis=-1)
    assert inside.sum() > 2000
    np.testing.assert_array_equal(colored[inside], bare[inside] * expected[inside])
    assert (colored[~lit] == 0.0).all()


@pytest.mark.parametrize("size", [(32, 48), (48, 32), (40, 40)])
def test_a_white_cookie_is_a_rectangle_of_its_own_shape(size):
    """A cookie of 48 x 32 lights a rectangle of 3:2, whose longer side fills the angle."""
    cookie = replace(spot(np.ones((*size, 3), np.float32)), gate="rectangle", blend=0.3)
    found = drawn(WHITE, cookie)[..., 0] > 0.0
    height, width = 4.0 * math.tan(math.radians(25)) * np.array(size) / max(size)
    at = floor_points()
    expected = (np.abs(at[..., 0]) < width) & (np.abs(at[..., 1]) < height)
    np.testing.assert_array_equal(found, expected)
    x, z = (np.ptp(at[found], axis=0) + 0.0).tolist()
    # To the width of a pixel of 6 x 2 tan 25 / 120 on either side.
    assert x / z == pytest.approx(size[1] / size[0], abs=0.05)


def test_the_shape_of_a_cookie_may_be_given_and_its_gate_round():
    white = np.ones((32, 48, 3), np.float32)
    bare = drawn(WHITE, spot(None))
    # Without a cookie there is no gate but the cone; a cookie fills it with its shorter side.
    np.testing.assert_array_equal(drawn(WHITE, spot(white)), bare)
    np.testing.assert_array_equal(drawn(WHITE, replace(spot(white), aspect=1.0)), bare)
    given = drawn(WHITE, replace(spot(white), gate="rectangle", aspect=1.0))[..., 0] > 0.0
    limit = 4.0 * math.tan(math.radians(25))
    np.testing.assert_array_equal(given, (np.abs(floor_points()) < limit).all(axis=-1))


def test_light_profiles_are_left_out_where_nothing_asks():
    item = SceneObject(mesh=plane(), material=WHITE)

    def why(*lights):
        scene = Scene(objects=(item,), lighting=Lighting(lights=lights))
        camera = Camera.framing(item.mesh)
        left_out = plan_of(prepare(scene, OPTIONS), camera).left_out
        return [entry.why for entry in left_out if entry.name == "light profiles"]

    cookie = ImageTexture(image=QUARTERS)
    assert why(Light(kind="point")) == ["no light has a cookie"]
    assert why(Light(profile=cookie)) == ["only a spot holds a cookie, and it is directional"]
    assert (why(spot(QUARTERS, intensity=0.0)), why(spot(QUARTERS))) == (["it is dark"], [])


def texture_of(pixels, **more):
    return ImageTexture(image=pixels.astype(np.float32), filter="nearest", **more)


SLANTED = projector_matrix(position=(2, 3, 1), target=(0.2, 0, 0.1), fov=30, aspect=1.5)


def places(matrix, at):
    """s/q, t/q and q of places on the floor."""
    x, z = at[..., 0], at[..., 1]
    s, t, _, q = (row[0] * x + row[2] * z + row[3] for row in matrix)
    return s / q, t / q, q


def test_a_picture_replaces_the_base_color_inside_its_square():
    found = drawn(
        replace(GRAY, projected=(ProjectedTexture(texture=texture_of(QUARTERS), matrix=SLANTED),))
    )
    s, t, q = places(SLANTED, floor_points())
    inside = (s > 0) & (s < 1) & (t > 0) & (t < 1) & (q > 0)
    expected = np.full((120, 120, 3), 0.5, np.float32)
    expected[inside] = QUARTERS[(t < 0.5).astype(int), (s > 0.5).astype(int)][inside]
    on_floor = (np.abs(floor_points()) < 2.99).all(axis=-1)
    # Within rounding of a border either side is right.
    far = np.min([np.abs(v - edge) for v in (s, t) for edge in (0.0, 0.5, 1.0)], axis=0) > 1e-9
    assert (inside & on_floor).sum() > 800
    np.testing.assert_array_equal(found[on_floor & far], expected[on_floor & far])


@pytest.mark.parametrize("matrix", [np.eye(3), np.full((3, 4), np.nan), np.eye(4)[None]])
def test_other_matrices_are_refused(matrix):
    with pytest.raises(OptionError, match="it is not 4 x 4 or 3 x 4 finite numbers"):
        ProjectedTexture(texture=ImageTexture(image=QUARTERS), matrix=matrix)


def test_opacity_and_strength_mix_pictures_over_one_another():
    clear = np.zeros((1, 1, 4))
    half = np.array([[[0.0, 1.0, 0.0, 0.5]]])
    full = np.array([[[1.0, 0.0, 0.0]]])
    matrix = projector_matrix(position=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1), fov=100)
    pictures = [
        ProjectedTexture(texture=texture_of(pixels), matrix=matrix, strength=strength)
        for pixels, strength in ((full, 0.25), (clear, 1.0), (half, 0.5))
    ]
    found = drawn(replace(GRAY, projected=tuple(pictures)))[60, 60]
    first = 0.75 * np.array([0.5, 0.5, 0.5]) + 0.25 * np.array([1.0, 0.0, 0.0])
    expected = 0.75 * first + 0.25 * np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_nothing_is_thrown_behind_the_projector():
    # Below the floor and looking down: the floor lies behind, at mirrored (s/q, t/q) inside [0, 1].
    matrix = projector_matrix(position=(0, -3, 0), target=(0, -9, 0), up=(0, 0, -1), fov=90)
    s, t, q = places(matrix, floor_points())
    assert ((s > 0) & (s < 1) & (t > 0) & (t < 1) & (q < 0)).any()
    pictures = (ProjectedTexture(texture=texture_of(QUARTERS), matrix=matrix),)
    np.testing.assert_array_equal(drawn(replace(GRAY, projected=pictures)), drawn(GRAY))


def test_points_in_the_projector_and_far_away_get_nothing_that_is_not_finite():
    image = load_cookie(texture_of(QUARTERS), QUARTERS, filter_name="trilinear", name="cookie")
    points = np.array([[2.0, 3.0, 1.0], [1e300, -1e300, 0.0], [0.0, 0.0, 0.0]])
    steps = np.full((3, 2, 3), np.inf)
    found = project_onto(SLANTED, points, steps, image.filter)
    assert np.isfinite(found.values(image)).all() and np.isfinite(found.coverage).all()
    assert found.coverage[0] == 0.0


@pytest.mark.parametrize(
    "camera", [ABOVE, Camera.looking_at((1, 4, 4), (0, 0, 0), fov=0.9, near=0.1)]
)
def test_a_border_is_as_smooth_as_the_pixels_are_wide(camera):
    # With a filter over the pixel the border is the share of the pixel's width inside the square.
    # That width is what the derivatives say; here it is measured between neighboring pixels.
    texture = ImageTexture(image=np.ones((1, 1, 3), np.float32), filter="trilinear")
    black = Material(
        shading="unlit",
        base_color=(0.0, 0.0, 0.0),
        projected=(ProjectedTexture(texture=texture, matrix=SLANTED),),
    )
    found = drawn(black, camera=camera)[..., 0]
    s, t, q = places(SLANTED, floor_points(camera))
    expected = np.where(q > 0, 1.0, 0.0)
    for value in s, t:
        down, right = np.gradient(value)
        width = np.abs(right) + np.abs(down)
        inside = np.minimum(value + width / 2, 1.0) - np.maximum(value - width / 2, 0.0)
        expected *= np.clip(inside / width, 0.0, 1.0)
    on_floor = (np.abs(floor_points(camera)) < 2.9).all(axis=-1)
    soft = on_floor & (expected > 0.0) & (expected < 1.0)
    assert soft.sum() > 50
    # np.gradient is a mean over two pixels; s/q and t/q bend by less than 2 % of that there.
    np.testing.assert_allclose(found[on_floor], expected[on_floor], atol=0.02)


def test_a_fine_picture_far_away_is_its_mean():
    # Stripes much finer than a pixel: without derivatives they would be black or white.
    stripes = np.zeros((1024, 1024, 3), np.float32)
    stripes[:, ::2] = 1.0
    matrix = projector_matrix(position=(0, 3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=20)

    def spread(kind):
        picture = ProjectedTexture(texture=ImageTexture(image=stripes, filter=kind), matrix=matrix)
        found = drawn(replace(GRAY, projected=(picture,)))
        s, t, _ = places(matrix, floor_points())
        return found[(np.abs(s - 0.5) < 0.4) & (np.abs(t - 0.5) < 0.4)][:, 0]

    assert np.abs(spread("trilinear") - 0.5).max() < 0.01
    assert np.abs(spread("nearest") - 0.5).min() == 0.5


def test_factors_and_their_faults():
    matrix = projector_matrix(position=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1), fov=100)
    white = np.ones((1, 1, 3))
    texture = texture_of(white, factor=(0.5, 0.25, 1.0))
    pictures = (ProjectedTexture(texture=texture, matrix=matrix),)
    found = drawn(replace(GRAY, projected=pictures))[60, 60]
    np.testing.assert_array_equal(found, np.array([0.5, 0.25, 1.0], np.float32))
    broken = replace(spot(None), profile=ImageTexture(image=np.ones((4, 4, 2, 2), np.float32)))
    with pytest.raises(OptionError, match="shape"):
        drawn(WHITE, broken)


def shelf_scene(**options):
    """(H, W, 3): a floor at 0 and a shelf of 1 x 1 at height 2, lit by a picture from height 4."""
    matrix = projector_matrix(position=(0, 4, 0), target=(0, 0, 0), up=(0, 0, -1), fov=60)
    white = ImageTexture(image=np.ones((2, 2, 3), np.float32), filter="nearest")
    thrown_on = replace(
        GRAY,
        double_sided=True,
        projected=(ProjectedTexture(texture=white, matrix=matrix, **options),),
    )
    floor = transform_matrix(scale=6, rotate=(-90, 0, 0), translate=(-3, 0, 3))
    shelf = transform_matrix(scale=1, rotate=(-90, 0, 0), translate=(-0.5, 2, 0.5))
    objects = tuple(
        SceneObject(mesh=plane(), material=thrown_on, transform=place) for place in (floor, shelf)
    )
    camera = Camera.looking_at((0, 1.0, 5), (0, 1.0, 0), fov=math.radians(50), near=0.01)
    return draw(prepare(Scene(objects=objects), OPTIONS), camera).color[..., :3]


def side_points(height):
    """(H, W, 2): x and z where pixels of that camera meet a level plane; NaN above the horizon."""
    camera = Camera.looking_at((0, 1.0, 5), (0, 1.0, 0), fov=math.radians(50), near=0.01)
    rays = pixel_rays(camera, 120, 120)
    along = (height - 1.0) / rays[..., 1:2]
    return np.where(along > 0.0, camera.eye + along * rays, np.nan)[..., [0, 2]]


def test_a_picture_is_not_thrown_on_what_is_hidden():
    """The shadow of a shelf half way down is twice as wide on the floor."""
    plain, hidden = shelf_scene(), shelf_scene(occlusion=True)
    widest = np.abs(side_points(0.0)).max(axis=-1)
    lit, dark = (widest > 1.1) & (widest < 2.2), widest < 0.9
    assert lit.sum() > 500 and dark.sum() > 300
    np.testing.assert_array_equal(plain[lit | dark], 1.0)
    np.testing.assert_array_equal(hidden[lit], 1.0)
    np.testing.assert_array_equal(hidden[dark], 0.5)


def test_a_picture_is_not_thrown_on_what_faces_away():
    """The camera sees the shelf from below and the floor from above."""
    plain, facing = shelf_scene(), shelf_scene(facing=True)
    below = np.abs(side_points(2.0)).max(axis=-1) < 0.48
    floor = np.abs(side_points(0.0)).max(axis=-1) < 2.2
    assert below.sum() > 50 and floor.sum() > 500
    np.testing.assert_array_equal(plain[below | floor], 1.0)
    np.testing.assert_array_equal(facing[below], 0.5)
    np.testing.assert_array_equal(facing[floor], 1.0)


def test_parallel_rays_have_no_projector_to_face():
    texture = texture_of(QUARTERS)
    ProjectedTexture(texture=texture, matrix=np.eye(4))
    for name in "facing", "occlusion":
        with pytest.raises(OptionError, match="its rays are parallel"):
            ProjectedTexture(texture=texture, matrix=np.eye(4), **{name: True})
