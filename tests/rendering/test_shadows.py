"""Shadows against closed forms, without light leaks or false shadows."""

import math

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake import Light, Lighting, Material, Mesh, RenderOptions, Scene, SceneObject
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import icosphere, plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effects.lights import PlacedLight
from texbake.rendering.effects.shadow_fit import may_shade
from texbake.rendering.scene.lights import Shadow
from texbake.rendering.scene.scene import corners_of, transform_matrix

WHITE = Material(shading="lambert", base_color=(1.0, 1.0, 1.0), double_sided=True)
ABOVE = Camera.looking_at((0, 8, 0.001), (0, 0, 0), up=(0, 0, -1), fov=math.radians(50), near=0.01)
OPTIONS = RenderOptions(width=160, height=160, supersampling=1, background=None)
SPHERE = icosphere(5)
# Its faces lie at most this far inside the unit sphere.
SAG = 1.0 - math.cos(math.radians(63.5 / 32 / math.sqrt(3)))


def floor(half=3.0, n=1, **more):
    """Square of half a side about the origin, facing up."""
    matrix = transform_matrix(scale=2 * half, rotate=(-90, 0, 0), translate=(-half, 0, half))
    return SceneObject(mesh=plane(n, n), material=WHITE, transform=matrix, name="floor", **more)


def ball(center, radius, **more):
    matrix = transform_matrix(scale=radius, translate=center)
    return SceneObject(mesh=SPHERE, material=WHITE, transform=matrix, name="ball", **more)


def quad(*corners):
    return Mesh(positions=np.array(corners, float), faces=np.array([[0, 1, 2], [0, 2, 3]]))


def light(kind="directional", size=256, radius=1.5, **more):
    shadow = Shadow(size=size, filter_radius=radius)
    return Light(kind=kind, decay=0.0, blend=0.0, shadow=shadow, **more)


def drawn(*objects, light, camera=ABOVE, options=OPTIONS, threads=None):
    scene = Scene(objects=objects, lighting=Lighting(lights=(light,)))
    return draw(prepare(scene, options, threads=threads), camera)


def share(*objects, light, camera=ABOVE):
    """(H, W): share of the light that shadows let through; NaN for pixels without light."""
    bare = Light(
        kind=light.kind, decay=0.0, blend=0.0, position=light.position, direction=light.direction,
        angle=light.angle,
    )  # fmt: skip
    shaded, lit = (drawn(*objects, light=item, camera=camera) for item in (light, bare))
    assert shaded.plan.has("shadow maps") and not lit.plan.has("shadow maps")
    full = lit.color[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(full > 0.0, shaded.color[..., 0] / full, np.nan)


def points(camera=ABOVE, height=0.0, options=OPTIONS):
    """(H, W, 3): where the middles of pixels see a level plane; NaN where they do not."""
    rays = pixel_rays(camera, options.width, options.height)
    along = (height - camera.eye[1]) / rays[..., 1]
    return np.where(along[..., None] > 0.0, camera.eye + along[..., None] * rays, np.nan)


def beside(at, source, center):
    """How far the line from points to a source (x, y, z, 1), or (x, y, z, 0), passes a center."""
    toward = source[:3] - at if source[3] else np.broadcast_to(source[:3], at.shape)
    toward = toward / np.linalg.norm(toward, axis=-1, keepdims=True)
    return np.asarray(np.linalg.norm(np.cross(np.array(center) - at, toward), axis=-1))


CENTER, RADIUS = (0.2, 1.0, -0.1), 0.6
SUN = (-0.5, -1.0, 0.3)
LAMP = (1.0, 4.0, 0.5)
SPOT_DIRECTION = (-0.9, -4.0, -0.5)
SOURCES = {
    "directional": (light(direction=SUN), np.array([0.5, 1.0, -0.3, 0.0])),
    "spot": (
        light("spot", position=LAMP, direction=SPOT_DIRECTION, angle=70.0), np.array([*LAMP, 1.0]),
    ),
    "wide spot": (
        light("spot", position=LAMP, direction=SPOT_DIRECTION, angle=150.0), np.array([*LAMP, 1.0]),
    ),
    "point": (light("point", size=512, position=LAMP), np.array([*LAMP, 1.0])),
}  # fmt: skip


def texel_at(source, distance):
    """Most that a texel is wide at a distance from a light, across the light."""
    inner = source.shadow.size - 2 * (math.ceil(source.shadow.filter_radius) + 1)
    if source.kind == "directional":
        # The fit is to the ball's bounding box, whose widest view is its diagonal.
        return 2.0 * math.sqrt(3.0) * RADIUS / inner
    half = math.radians(source.angle / 2 if source.angle <= 120 else 45.0)
    if source.kind == "point":
        half = math.radians(45.0)
    # A texel off the axis is seen at a slant, and farther away: at most by the diagonal.
    return 2.0 * math.tan(half) * distance / inner


@pytest.mark.parametrize("kind", SOURCES)
def test_a_ball_throws_the_shadow_of_the_cone_around_it(kind):
    source, place = SOURCES[kind]
    found = share(floor(), ball(CENTER, RADIUS), light=source)
    at = points()
    on_floor = (np.abs(at[..., [0, 2]]) < 2.95).all(axis=-1)
    # Not hidden by the ball from the camera.
    on_floor &= beside(at, np.array([*ABOVE.eye, 1.0]), CENTER) > RADIUS * 1.01
    passed = beside(at, place, CENTER)
    # The filter reaches over its radius along both axes, and a texel tells of its center alone.
    reach = (1.5 + 0.5) * math.sqrt(2.0) * texel_at(source, 3.5) + SAG * RADIUS
    assert reach < 0.15 * RADIUS
    known = on_floor & np.isfinite(found)
    dark, bright = known & (passed < RADIUS - reach), known & (passed > RADIUS + reach)
    assert dark.sum() > 100 and bright.sum() > 3000
    assert (found[dark] == 0.0).all() and (found[bright] == 1.0).all()


@pytest.mark.parametrize(("size", "radius", "elevation"), [
    (size, (0.0, 1.5, 6.0)[(i + j) % 3], elevation)  # all pairs of two
    for i, size in enumerate((1, 7, 64, 1024))
    for j, elevation in enumerate((90.0, 30.0, 3.0, 0.1))
])  # fmt: skip
def test_a_plane_is_lit_all_over_at_any_slope(size, radius, elevation):
    # The post makes the object no flat one, and stands, with its shadow, outside the picture.
    post = quad((20, -1, 20), (20, 1, 20), (20, 1, 20.1), (20, -1, 20.1))
    ground = quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9))
    both = SceneObject(mesh=join_meshes([ground, post]), material=WHITE)
    up = math.radians(elevation)
    sun = light(size=size, radius=radius, direction=(0.8 * math.cos(up), -math.sin(up), 0.6))
    found = share(both, light=sun)
    assert (found == 1.0).all()


@pytest.mark.parametrize(("bend", "direction", "size", "n"), [
    ((0.2, -0.2)[(i + j) % 2], direction, size, (12, 150)[i % 2])  # all pairs of two
    for i, size in enumerate((24, 64, 500))
    for j, direction in enumerate(((0.0, -1.0, 0.0), (0.4, -1.0, 0.3), (0.0, -1.0, 0.9)))
])  # fmt: skip
def test_a_bent_surface_does_not_shade_itself(bend, direction, size, n):
    # Its steepest slope, 0.8 bend, is far below the sun's: all of it is lit.
    mesh = plane(n, n, lambda u, v: bend * ((2 * u - 1) ** 2 + (2 * v - 1) ** 2))
    matrix = transform_matrix(scale=(6, 6, 2), rotate=(-90, 0, 0), translate=(-3, 0, 3))
    item = SceneObject(mesh=mesh, material=WHITE, transform=matrix)
    for source in light(size=size, direction=direction), light("point", size, position=(0, 6, 0)):
        found = share(item, light=source)
        assert (found[np.isfinite(found)] == 1.0).all()


@pytest.mark.parametrize("size", [32, 256, 1024])
@pytest.mark.parametrize("is_one", [False, True], ids=["two objects", "one object"])
def test_a_shadow_begins_at_the_foot_of_a_wall(size, is_one):
    wall = quad((0, 0, 2), (0, 0, -2), (0, 1, -2), (0, 1, 2))
    ground = quad((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    meshes = [join_meshes([wall, ground])] if is_one else [wall, ground]
    objects = [SceneObject(mesh=mesh, material=WHITE) for mesh in meshes]
    found = share(*objects, light=light(size=size, direction=(-1.0, -1.0, 0.0)))
    at = points()
    x = at[..., 0]
    near_it = (np.abs(at[..., 2]) < 1.0) & (np.abs(x) < 2.9) & np.isfinite(found)
    # The light sees 4 of the wall, or 6 of all; on the floor, texels are stretched by the slope of
    # the sun. Within one object the surface might climb as steeply as the wall over the filter,
    # as far again.
    texel = (6.0 if is_one else 4.0) / (size - 6) * math.sqrt(2.0)
    reach = (1.5 + 0.5) * texel * (2.0 if is_one else 1.0)
    lit_side, behind = near_it & (x > 0.03), near_it & (x < -reach) & (x > -1 + reach)
    assert (found[lit_side] == 1.0).all() and (found[behind] == 0.0).all()
    assert (found[near_it & (x < -1 - reach)] == 1.0).all()
    assert lit_side.sum() > 100 and (size == 32 or behind.sum() > 100)


@pytest.mark.parametrize("radius", [0.0, 0.5, 1.5, 3.25])
def test_the_filter_is_the_mean_over_its_square(radius):
    # The lid's edge, x = 0, lies between two texels, of which 8 are one unit.
    size = 16 + 2 * (math.ceil(radius) + 1)
    lid = SceneObject(
        mesh=quad((-1, 1, 1), (0, 1, 1), (0, 1, -1), (-1, 1, -1)), material=WHITE, visible=False
    )
    camera = Camera.looking_at((0, 4, 0), (0, 0, 0), up=(0, 0, -1), fov=0.6, near=0.01)
    sun = light(size=size, radius=radius, direction=(0.0, -1.0, 0.0))
    found = share(floor(), lid, light=sun, camera=camera)
    at = points(camera)
    # Farther from the lid's other edges than the filter reaches.
    reach = (radius + 0.5) / 8.0
    kept = (np.abs(at[..., 2]) < 1.0 - reach) & (at[..., 0] > reach - 1.0)
    found, x = found[kept], at[kept, 0]
    if radius == 0.0:
        expected = (x > 0.0).astype(float)
    else:
        expected = np.clip(0.5 + x * 8.0 / (2.0 * radius), 0.0, 1.0)
    assert 0.2 < expected.mean() < 0.8
    # float32 radiance, twice rounded
    np.testing.assert_allclose(found, expected, atol=3e-7)


def test_the_faces_of_a_point_light_meet_without_a_seam():
    # Balls on edges and corners of the cube, in a great ball that is seen from inside.
    ways = [(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 0.96, -0.3)]
    balls = [ball(tuple(1.5 * c for c in way), 0.3) for way in ways]
    shell = ball((0.0, 0.0, 0.0), 5.0, casts_shadows=False)
    camera = Camera.looking_at(
        (-1.5, -1.4, -1.3), (5, 5, 5), fov=math.radians(110), near=0.001
    )  # fmt: skip
    source = light("point", size=512, position=(0.0, 0.0, 0.0))
    scene = shell, *balls
    found = share(*scene, light=source, camera=camera)
    frame = drawn(*scene, light=source, camera=camera)
    on_shell = (frame.face_ids >= 0) & (frame.face_ids < shell.mesh.n_faces)
    at = camera.eye + frame.depths[..., None] * pixel_rays(camera, 160, 160)
    angles = [
        np.arccos(at @ np.array(w) / np.linalg.norm(at, axis=-1) / np.linalg.norm(w)) for w in ways
    ]
    # At most half a texel times sqrt(3) off its middle, along both axes of the filter.
    reach = (1.5 + 0.5) * math.sqrt(2.0) * 2.0 / (512 - 6)
    halves = [math.asin(0.3 / (1.5 * math.hypot(*way))) for way in ways]
    inside = np.any([a < h - reach - 0.3 * SAG for a, h in zip(angles, halves, strict=True)], 0)
    outside = np.all([a > h + reach for a, h in zip(angles, halves, strict=True)], 0)
    assert (on_shell & inside).sum() > 300 and (on_shell & outside).sum() > 5000
    assert (found[on_shell & inside] == 0.0).all()
    assert (found[on_shell & outside] == 1.0).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_size_and_place_change_nothing(scale):
    def scene(factor):
        matrix = transform_matrix(scale=factor)
        objects = [
            SceneObject(mesh=item.mesh, material=WHITE, transform=matrix @ item.transform)
            for item in (floor(), ball(CENTER, RADIUS))
        ]
        camera = Camera.looking_at(
            tuple(factor * ABOVE.eye), (0, 0, 0), up=(0, 0, -1), fov=ABOVE.fov, near=0.01 * factor
        )
        return share(*objects, light=light(direction=SUN), camera=camera)

    here, there = scene(1.0), scene(scale)
    # Rounding may move a texel's center over an edge; nothing else changes.
    known = np.isfinite(here) & np.isfinite(there)
    assert known.mean() > 0.5
    assert (np.abs(here - there)[known] > 1e-4).mean() < 0.002


def test_what_does_not_cast_or_receive_is_left_alone():
    at = points()
    below = beside(at, np.array([0.5, 1.0, -0.3, 0.0]), CENTER) < 0.5 * RADIUS
    sun = light(direction=SUN)
    aside = SceneObject(mesh=icosphere(1), transform=transform_matrix(translate=(2, 2, 2)))
    found = share(floor(), ball(CENTER, RADIUS, casts_shadows=False), aside, light=sun)
    assert (found[below & np.isfinite(found)] == 1.0).all()
    unseen = share(floor(), ball(CENTER, RADIUS, visible=False), light=sun)
    assert (unseen[below] == 0.0).all()
    kept = share(floor(receives_shadows=False), ball(CENTER, RADIUS), light=sun)
    assert (kept[below & np.isfinite(kept)] == 1.0).all()


def plan(*objects, light, camera=ABOVE):
    scene = Scene(objects=objects, lighting=Lighting(lights=(light,)))
    return plan_of(prepare(scene, OPTIONS), camera)


LEFT_OUT = {
    "dark": ((floor(), ball(CENTER, 0.5)), light(direction=SUN, intensity=0.0), "it is dark"),
    "no caster": (
        (floor(casts_shadows=False), ball(CENTER, 0.5, casts_shadows=False)), light(direction=SUN),
        "no object casts shadows",
    ),
    "no receiver": (
        (floor(receives_shadows=False), ball(CENTER, 0.5, receives_shadows=False)),
        light(direction=SUN), "nothing that receives shadows is in the picture",
    ),
    "flat": ((floor(),), light(direction=SUN), "its shadows fall on nothing"),
    "flat, many faces": ((floor(n=5),), light("point", position=LAMP), "its shadows fall on"),
    "aside": (
        (floor(), ball((40.0, 1.0, 0.0), 0.5)), light(direction=(0, -1, 0)),
        "its shadows fall on nothing",
    ),
    "behind": (
        (floor(), ball((0.0, -30.0, 0.0), 0.5, receives_shadows=False)),
        light(direction=(0, -1, 0)), "its shadows fall on nothing",
    ),
    "beyond the cone": (
        (floor(), ball((0.0, 2.0, 0.0), 0.5, receives_shadows=False)),
        light("spot", position=(0, 6, 0), direction=(0, 1, 0), angle=30.0),
        "no light casts shadows",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", LEFT_OUT)
def test_a_map_that_nothing_needs_is_left_out(case):
    objects, source, why = LEFT_OUT[case]
    found = plan(*objects, light=source)
    assert not found.has("shadow maps") and not found.has("shadows")
    told = [item.why for item in found.left_out if item.name == "shadow maps"]
    assert len(told) == 1 and told[0].startswith(why)


@pytest.mark.parametrize("kind", ["directional", "point", "spot"])
def test_objects_that_shade_others_are_not_left_out(kind):
    """Boxes at random places. One shades the other if lines from there to the light meet it."""
    random = np.random.default_rng(3)
    zero = np.zeros(3)
    n_shading = 0
    for _ in range(150):
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        cosines = (0.9, 0.0) if kind == "spot" else (-1.0, -1.0)
        placed = PlacedLight(kind, zero, zero, direction, np.eye(3)[1], cosines, 0.0)
        lows = random.uniform(-3.0, 3.0, (2, 3))
        highs = lows + random.uniform(0.1, 2.5, (2, 3))
        points = random.uniform(lows[1], highs[1], (30, 3))
        if kind == "spot":
            cosine = points @ direction / np.linalg.norm(points, axis=1)
            points = points[cosine > cosines[1]]
        steps = np.linspace(0.0, 1.0, 40)[:, None, None]
        back = -9.0 * direction if kind == "directional" else -points
        along = points + steps * back
        meets = ((along > lows[0]) & (along < highs[0])).all(axis=2).any()
        boxes = [corners_of(np.stack(ends)) for ends in zip(lows, highs, strict=True)]
        assert may_shade(placed, *boxes) or not meets
        n_shading += meets
    assert n_shading >= 5


def test_a_map_is_not_made_for_what_turns_out_hidden():
    # The receiver stands behind a wall that is not one.
    wall = SceneObject(
        mesh=quad((-5, 2, 5), (5, 2, 5), (5, 2, -5), (-5, 2, -5)),
        material=WHITE,
        receives_shadows=False,
    )
    frame = drawn(floor(), ball(CENTER, 0.5), wall, light=light(direction=SUN))
    assert frame.plan.has("shadow maps")
    assert frame.costs.by_name["shadow maps"].skipped.startswith("nothing that receives")
    assert frame.costs.by_name["shadow maps"].n_bytes == 0
