"""Bump maps against normals known in closed form, at every pixel of a wall and on spheres."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.conftest import pixel_rays
from texbake import ImageTexture, Light, Lighting, Material, RenderOptions, Scene, SceneObject
from texbake.core import core
from texbake.errors import UvError
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.material import BumpMap, NormalMap
from texbake.rendering.scene.textures import ProcedureTexture

FORMS = ("blinn", "exact")
N = 1024
# Heights in the middle of texels, v up.
U, V = np.meshgrid((np.arange(N) + 0.5) / N, 1 - (np.arange(N) + 0.5) / N)


def bump(values, **fields):
    texture = ImageTexture(image=np.asarray(values, np.float32), filter="bilinear")
    return Material(shading="lambert", bump_map=BumpMap(texture=texture, **fields))


def normals_of(mesh, material, camera, options, transform=None):
    scene = Scene(objects=(SceneObject(mesh=mesh, material=material, transform=transform),))
    frame = draw(prepare(scene, options), camera, keep=("normals",))
    return frame.normals.astype(np.float64), frame.coverage == 1


FINE = {"width": 240, "height": 160}
SOME = slice(5, None, 10)


def on_wall(wall, material, mesh=None, transform=None, **options):
    """Normals at some pixels of a fine picture, or at all of one with other options."""
    chosen = replace(wall.options, **{**FINE, **options})
    normals, covered = normals_of(mesh or wall.mesh(), material, wall.camera, chosen, transform)
    assert covered.all()
    return normals if "width" in options else normals[SOME, SOME]


def points_of(wall):
    """(16, 24, 3): surface points at those pixels."""
    rays = pixel_rays(wall.camera, *FINE.values())[SOME, SOME]
    return wall.camera.eye - wall.camera.eye[2] / rays[..., 2:] * rays


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def tilted(slopes):
    """Normals of a wall whose height grows by slopes (..., 2) along x and y."""
    return unit(np.concatenate([-slopes, np.ones((*slopes.shape[:-1], 1))], axis=-1))


WAVES = np.sin(2 * np.pi * (3 * U + 2 * V))


def wave_slopes(wall, height):
    """Slopes of `WAVES`, where u and v grow by a tenth of a unit of length."""
    u, v = np.moveaxis(points_of(wall)[..., :2] / 10 + 0.5, -1, 0)
    slope = height * 2 * np.pi * np.cos(2 * np.pi * (3 * u + 2 * v)) / 10
    return np.stack([3 * slope, 2 * slope], axis=-1)


# Over a texel the wave turns by 2 pi 3.6 / 1024 = 0.022. A bilinear lookup leaves out up to 1/8 of
# the square of that, which over a step of about a texel is 0.003 of the slope.
WAVE_ERROR = 3e-3


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("height", [0.4, -1.5])
def test_on_a_plane_normals_follow_the_slope(wall, form, height):
    found = on_wall(wall, bump(WAVES, height=height, form=form))
    expected = tilted(wave_slopes(wall, height))
    assert np.ptp(expected[..., 0]) > 0.5
    np.testing.assert_allclose(found, expected, atol=WAVE_ERROR * abs(height) * 2.3)


@pytest.mark.parametrize("form", FORMS)
def test_a_ramp_has_one_slope_at_any_distance(wall, form):
    ramp = bump(2.0 * U + V, height=0.5, form=form)
    found = on_wall(wall, ramp)
    # float32 heights up to 3, over 1/1024.
    np.testing.assert_allclose(found, np.broadcast_to(tilted(np.array([0.1, 0.05])), found.shape),
                               atol=3e-5)  # fmt: skip
    # Seen over pixels that cover many texels, and through smaller levels of the image.
    smaller = Material(
        shading="lambert",
        bump_map=replace(ramp.bump_map, texture=replace(ramp.bump_map.texture, filter="trilinear")),
    )
    coarse = on_wall(wall, smaller, width=6, height=4)
    np.testing.assert_allclose(coarse, np.broadcast_to(found[0, 0], coarse.shape), atol=3e-5)


def test_within_a_texel_the_slope_is_smooth(wall):
    # A map of 8 x 8: a bilinear lookup alone has one slope along u in each texel. Differences over
    # a texel are means of two of those, so that no step is left between neighboring pixels.
    values = np.random.default_rng(1).random((8, 8))
    found = on_wall(wall, bump(values, height=2.0, form="blinn"), width=480, height=320)
    steps = np.abs(np.diff(found, axis=1)).max()
    assert np.ptp(found[..., 0]) > 0.2
    assert steps < 0.05


def test_mirrored_coordinates_change_nothing(wall):
    mirrored = wall.mesh()
    mirrored = mirrored.replace(uvs=mirrored.uvs * (-1, 1) + (1, 0))
    for form in FORMS:
        found = on_wall(wall, bump(WAVES[:, ::-1], height=0.4, form=form), mirrored)
        np.testing.assert_allclose(found, on_wall(wall, bump(WAVES, height=0.4, form=form)),
                                   atol=1e-4)  # fmt: skip


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_heights_are_in_units_of_the_object(wall, mirror):
    # The same wall, made small and placed large: its hills are large as well.
    scale = np.diag([mirror * 4.0, 4.0, 4.0, 1.0])
    mesh = wall.mesh()
    small = mesh.replace(positions=mesh.positions * (mirror / 4.0, 0.25, 0.25))
    if mirror < 0:
        small = small.replace(faces=mesh.faces[:, ::-1], uv_faces=mesh.uv_faces[:, ::-1])
    found = on_wall(wall, bump(WAVES, height=0.1), small, scale)
    np.testing.assert_allclose(found, on_wall(wall, bump(WAVES, height=0.4)), atol=1e-6)


@pytest.mark.parametrize("space", ["object", "world", "uv"])
@pytest.mark.parametrize("form", FORMS)
def test_procedures_have_their_own_slope(wall, space, form):
    # 1/2 + 1/2 sin(5 x)
    texture = ProcedureTexture(
        procedure="marble", parameters={"amount": 0.0, "frequency": 5.0}, space=space,
        filtered=False,
    )  # fmt: skip
    mesh = wall.mesh()
    if space != "uv":
        mesh = mesh.replace(uvs=None, uv_faces=None)
    material = Material(shading="lambert", bump_map=BumpMap(texture=texture, height=0.3, form=form))
    found = on_wall(wall, material, mesh)
    x = points_of(wall)[..., 0]
    turn = 1.0 if space != "uv" else 0.1
    slope = 0.15 * 5 * turn * np.cos(5 * (x * turn if space != "uv" else x / 10 + 0.5))
    # A pixel is up to 0.02 wide, over which the sine turns by 0.1 and its slope loses 1/24 of the
    # square; float32 values, taken 0.001 apart where (u, v) is told.
    np.testing.assert_allclose(found, tilted(np.stack([slope, 0 * slope], axis=-1)), atol=1e-3)


def test_seen_from_behind_hills_are_hollows(wall):
    mesh = wall.mesh()
    turned = mesh.replace(faces=mesh.faces[:, ::-1], uv_faces=mesh.uv_faces[:, ::-1])
    found = on_wall(wall, bump(WAVES, height=0.4), turned, back_faces="show")
    # Float32 widths of pixels, told from another corner of the triangle.
    np.testing.assert_allclose(found, on_wall(wall, bump(WAVES, height=-0.4)), atol=1e-5)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("values", [np.full((4, 4), 7.0), WAVES], ids=["flat", "waves"])
def test_without_texture_area_or_height_normals_stay(wall, form, values):
    mesh = wall.mesh((0.3, 0.2, 1.0))
    kept = on_wall(wall, Material(shading="lambert"), mesh)
    no_area = mesh.replace(uvs=np.full_like(mesh.uvs, 0.3))
    on_line = mesh.replace(uvs=mesh.uvs * (1.0, 0.0))
    for changed in no_area, on_line:
        np.testing.assert_array_equal(on_wall(wall, bump(values, form=form), changed), kept)
    np.testing.assert_allclose(
        on_wall(wall, bump(values, height=0.0, form=form), mesh), kept, atol=2e-7
    )


SPHERE = uv_sphere(96, 192)
CLOSE = RenderOptions(width=160, height=160, supersampling=1)
FACING = Camera.looking_at((0.0, -3.2, 0.4), (0, 0, 0), up=(0, 0, 1), fov=0.66, near=0.1)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("height", [-0.5, 0.5, 20.0])
def test_a_constant_height_leaves_the_normals_of_a_sphere(form, height):
    plain, covered = normals_of(SPHERE, Material(shading="lambert"), FACING, CLOSE)
    found, _ = normals_of(SPHERE, bump(np.ones((4, 4)), height=height, form=form), FACING, CLOSE)
    # float32, in the plane across the normal and back.
    np.testing.assert_allclose(found[covered], plain[covered], atol=3e-7)
    assert covered.sum() > 10_000


def test_the_exact_form_is_the_normal_of_the_displaced_sphere():
    # P' = (1 + d) r with d = 0.8 + 0.05 sin(2 pi 9 u) on the unit sphere, u = longitude / 2 pi.
    values = 0.8 + 0.05 * np.sin(2 * np.pi * 9 * U)
    options = replace(CLOSE, width=400, height=400)
    plain, covered = normals_of(SPHERE, Material(shading="lambert"), FACING, options)
    covered &= plain[..., 1] < -0.8  # away from the poles and the limb, where pixels are wide
    radial = plain[covered]
    longitude = np.arctan2(radial[:, 1], radial[:, 0])
    sine = np.hypot(radial[:, 0], radial[:, 1])
    east = np.stack([-np.sin(longitude), np.cos(longitude), 0 * longitude], axis=1)
    d = 0.8 + 0.05 * np.sin(9 * longitude)
    gradient = (0.45 * np.cos(9 * longitude) / sine)[:, None] * east
    errors = {}
    for form in FORMS:
        found, _ = normals_of(SPHERE, bump(values, height=1.0, form=form), FACING, options)
        for name, expected in (
            ("exact", unit((1 + d)[:, None] * radial - gradient)),
            ("blinn", unit(radial - gradient)),
        ):
            errors[form, name] = np.abs(found[covered] - expected).max()
    # The sphere's triangles are 0.03 wide, and their own derivatives differ by that much in turn.
    assert errors["exact", "exact"] < 0.02 and errors["blinn", "blinn"] < 0.02
    # d N_u and d N_v matter here: each form is far from the other's normal.
    assert errors["blinn", "exact"] > 0.1 and errors["exact", "blinn"] > 0.1


def test_a_bump_map_tilts_what_a_normal_map_gave(wall):
    lean = unit(np.array([0.3, 0.0, 1.0]))
    texels = np.broadcast_to(np.float32(lean), (4, 4, 3))
    leaning = NormalMap(texture=ImageTexture(image=texels, filter="bilinear"))
    found = on_wall(wall, replace(bump(V, height=1.0, form="blinn"), normal_map=leaning))
    # P_v lies across that normal already: N - d_v P_v.
    expected = unit(lean - (0.0, 0.1, 0.0))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-4)


def lamps(*directions, **fields):
    return Lighting(lights=tuple(Light(direction=d, **fields) for d in directions))


def test_embossing_never_takes_more_light_than_there_is(wall):
    steep = wall.light(bump(WAVES, height=50.0, form="emboss"), lamps((-1.0, 0.0, -0.2)))
    assert np.abs(steep.min()) < 1e-8  # what rounding leaves of the light that is taken back
    assert steep.max() > 1.0
    # Turned away from the lamp nothing is lit, whatever the slope.
    behind = lamps((-1.0, 0.0, 0.01))
    assert not wall.light(bump(WAVES, height=50.0, form="emboss"), behind).any()


SLANTED = (-0.6, 0.3, -1.0)


@pytest.mark.parametrize("space", ["world", "object"])
@pytest.mark.parametrize("height", [1.25, -2.0])
def test_normalized_embossing_is_the_light_on_the_tilted_wall(wall, height, space):
    """On a slope of 0.25 and one of 0.4, where the numerator alone is too bright."""
    slope = np.array([0.2 * height, 0.0])
    expected = 0.8 * max(tilted(slope) @ -unit(np.array(SLANTED)), 0.0)
    whole, numerator = (
        wall.light(bump(2.0 * U, height=height, form=form, light_space=space), lamps(SLANTED))
        for form in ("emboss-normalized", "emboss")
    )
    # float32 heights up to 2, over 1/1024.
    np.testing.assert_allclose(whole, expected, atol=2e-4)
    np.testing.assert_allclose(numerator, expected * np.sqrt(1.0 + slope @ slope), atol=2e-4)
    assert (numerator - expected).min() > 0.01


TURN = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])


def embossed_block(form, space, scale, seen_from=(0.4, 0.7, 3.0)):
    """A wavy wall under a turning and scaling transform, in light from one side."""
    transform = np.eye(4)
    transform[:3, :3] = TURN @ np.diag(scale)
    material = bump(WAVES, height=0.02, form=form, light_space=space)
    scene = Scene(
        objects=(SceneObject(mesh=plane(), material=material, transform=transform),),
        lighting=lamps((-0.5, -0.6, -np.sign(seen_from[2]))),
    )
    camera = Camera.looking_at(seen_from, (0.0, 0.0, 0.0), fov=0.3, near=0.01)
    frame = draw(prepare(scene, replace(CLOSE, back_faces="show")), camera)
    assert (frame.coverage == 1).any()
    return frame.color[frame.coverage == 1][:, 0].astype(np.float64)


@pytest.mark.parametrize("seen_from", [(0.4, 0.7, 3.0), (0.4, 0.7, -3.0)])
def test_normalized_embossing_is_blinn_also_where_scaled_and_from_behind(seen_from):
    scaled = (2.0, 1.0, 0.5)
    blinn = embossed_block("blinn", "world", scaled, seen_from)
    whole = embossed_block("emboss-normalized", "world", scaled, seen_from)
    # Seen at a slant, steps are several texels wide, and along the light other than along u and v.
    np.testing.assert_allclose(whole, blinn, atol=6e-3)
    assert np.ptp(blinn) > 0.05


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 1.0, 0.5), (0.5, 3.0, 1.0)])
def test_embossing_in_the_world_is_the_numerator_of_the_normal_of_the_scaled_wall(scale):
    """On a slope g in object space, M^-T (N - g) · L / |M^-T N|, with the lamp in world space."""
    matrix = TURN @ np.diag(scale)
    transform = np.eye(4)
    transform[:3, :3] = matrix
    material = bump(2.0 * U + V, height=0.6, form="emboss")
    scene = Scene(
        objects=(SceneObject(mesh=plane(), material=material, transform=transform),),
        lighting=lamps((-0.5, -0.6, -1.0)),
    )
    middle = matrix @ [0.5, 0.5, 0.0]
    eye = middle + np.array([0.4, 0.7, 3.0])
    camera = Camera.looking_at(eye, middle, fov=0.05, near=0.01)
    frame = draw(prepare(scene, CLOSE), camera)
    found = frame.color[frame.coverage == 1][:, 0]
    corners = plane().positions[plane().faces[0]][:, :2]
    heights = 0.6 * plane().corner_uvs()[0] @ [2.0, 1.0]
    slope = np.linalg.solve(corners[1:] - corners[0], heights[1:] - heights[0])
    inverse = np.linalg.inv(matrix).T
    normal = inverse @ [0.0, 0.0, 1.0]
    bent = normal - inverse @ [*slope, 0.0]
    to_light = unit(np.array([0.5, 0.6, 1.0]))
    expected = 0.8 * (bent @ to_light) / np.linalg.norm(normal)
    assert len(found) > 100 and abs((bent - normal) @ to_light) > 0.05 * np.linalg.norm(normal)
    # float32 heights up to 1.8, over 1/1024.
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_light_in_object_space_is_the_same_unless_axes_are_scaled_apart():
    for form in "emboss", "emboss-normalized":
        evenly = [embossed_block(form, space, (1.7,) * 3) for space in ("world", "object")]
        np.testing.assert_allclose(*evenly, atol=1e-5)
        apart = [embossed_block(form, space, (2.0, 1.0, 0.5)) for space in ("world", "object")]
        assert np.abs(apart[0] - apart[1]).max() > 0.02


def test_a_point_light_embosses_from_where_it_is(wall):
    position = np.array([1.0, 0.5, 1.5])
    lighting = Lighting(
        lights=(Light(kind="point", position=tuple(position), decay=0.0, intensity=1.0),)
    )
    found = wall.light(bump(2.0 * U + V, height=0.5, form="emboss"), lighting)[..., 0]
    to_light = unit(position - wall.points)
    expected = to_light[..., 2] - 0.5 * (0.2 * to_light[..., 0] + 0.1 * to_light[..., 1])
    np.testing.assert_allclose(found, 0.8 * np.maximum(expected, 0.0), atol=2e-4)


def test_what_cannot_be_a_bump_map_is_one_line():
    with pytest.raises(UvError):
        normals_of(cube(), bump(WAVES), FACING, CLOSE)


@pytest.mark.parametrize("space", ["uv", "object"])
def test_differences_on_one_side_are_of_first_order_and_central_ones_of_second(space):
    """A sine over x: the slope of each difference, and its error for a step of half the size."""
    errors = {name: [] for name in ("central", "forward", "backward")}
    for width in (64, 128):
        options = RenderOptions(width=width, height=8, supersampling=1)
        # Straight on, at the distance at which the picture is one unit wide.
        away = 0.5 / math.tan(math.radians(10.0)) * 8 / width
        camera = Camera.looking_at((0.5, 0.5, away), (0.5, 0.5, 0), fov=math.radians(20), near=0.01)
        u = (np.arange(width) + 0.5) / width
        step = 1.0 / width
        for name, found in errors.items():
            waves = ProcedureTexture(
                procedure="stripes", parameters={"profile": "sine"}, space=space, filtered=False
            )
            holder = BumpMap(texture=waves, height=0.02, difference=name)
            material = Material(shading="lambert", bump_map=holder)
            scene = Scene(objects=(SceneObject(mesh=plane(), material=material),))
            frame = draw(prepare(scene, options), camera, keep=("normals",))
            normals = frame.normals[4]
            slopes = -normals[:, 0] / normals[:, 2]
            low, high = {"central": (-0.5, 0.5), "forward": (0, 1), "backward": (-1, 0)}[name]
            heights = [
                0.02 * (0.5 + 0.5 * np.sin(2 * np.pi * (u + end * step))) for end in (low, high)
            ]
            inside = slice(4 if space == "uv" else width // 2 + 4, width - 4)
            np.testing.assert_allclose(
                slopes[inside], ((heights[1] - heights[0]) / step)[inside], atol=2e-5
            )
            exact = 0.02 * np.pi * np.cos(2 * np.pi * u)
            found.append(np.abs(slopes - exact)[inside].max())
    assert errors["central"][0] < 0.1 * errors["forward"][0]
    for name, order in (("forward", 2.0), ("backward", 2.0), ("central", 4.0)):
        assert errors[name][0] / errors[name][1] == pytest.approx(order, rel=0.2)


def test_a_step_along_the_light_is_half_the_longest_and_0_where_it_has_no_direction():
    """On triangles of the plane z = 0: the light is projected onto it, in units of u and v."""
    n, rng = 40, np.random.default_rng(3)
    points = np.append(rng.normal(size=(n, 3, 2)), np.zeros((n, 3, 1)), axis=2)
    points[-1] = points[-1, 0]  # no area
    faces = np.arange(3 * n, dtype=np.int32).reshape(n, 3)
    normal = np.array([[0.0, 0.0, 1.0]])
    growth, longest = rng.normal(size=(n, 2, 2)), rng.uniform(0.01, 0.1, (n, 2))
    light = rng.normal(size=(n, 3)).astype(np.float32)
    light[:2] = [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]
    shifts, lengths = np.full((n, 2), np.nan), np.full(n, np.nan)
    core.find_light_steps(
        points.reshape(-1, 3), faces, normal, np.zeros_like(faces), growth.reshape(n, 4),
        np.eye(3), np.arange(n, dtype=np.int32), np.zeros((n, 2)),
        np.repeat(normal.astype(np.float32), n, axis=0), np.zeros(n, bool), light, np.eye(3),
        longest, shifts, lengths,
    )  # fmt: skip
    nowhere = [0, 1, n - 1]
    np.testing.assert_array_equal(shifts[nowhere], 0.0)
    np.testing.assert_array_equal(lengths[nowhere], 0.0)
    along = growth @ (points[:, 1:] - points[:, :1])  # the directions of u and v
    for i in range(2, n - 1):
        toward = -light[i, :2] / np.linalg.norm(light[i])
        step = np.linalg.solve(along[i, :, :2].T, toward)
        expected = 0.5 * step / (np.abs(step) / longest[i]).max()
        np.testing.assert_allclose(shifts[i], expected, rtol=1e-6)
        np.testing.assert_allclose(shifts[i], step * lengths[i], rtol=1e-6)
