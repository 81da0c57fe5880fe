"""Light maps: closed forms, and the same picture with lights and with their light maps."""

import math
from dataclasses import replace

import numpy as np
import pytest

from texbake.baking.options import BakeOptions
from texbake.errors import OptionError, UvError
from texbake.jobs.light_maps import bake_light_maps
from texbake.mesh.mesh import Mesh, UvSet
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.lights import Ambient, Light, Lighting, Shadow
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import read_image

SIZE = 128
LAMBERT = Material(shading="lambert", base_color=(0.7, 0.6, 0.5))
# A floor of 6 x 6 about the origin: texel (row, column) lies at the x and z of `floor_points`.
FLOOR = SceneObject(
    mesh=plane(), material=LAMBERT,
    transform=transform_matrix(scale=6, rotate=(-90, 0, 0), translate=(-3, 0, 3)), name="floor",
)  # fmt: skip
CENTER, RADIUS = np.array([0.3, 1.2, -0.2]), 0.7
BALL = SceneObject(
    mesh=uv_sphere(48, 96),
    material=LAMBERT,
    transform=transform_matrix(scale=RADIUS, rotate=(-90, 0, 0), translate=tuple(CENTER)),
    name="ball",
)
SHADOW = Shadow(size=1024, filter_radius=0.5)


def baked(*objects, lights=(), **more):
    ambient = more.pop("ambient", Ambient())
    scene = Scene(objects=objects, lighting=Lighting(lights=lights, ambient=ambient))
    options = {"size": SIZE, "padding": 2} | more
    return bake_light_maps(scene, BakeOptions(**options)).maps


def floor_points(size=SIZE):
    """(H, W, 3): centers of the floor's texels."""
    along = (np.arange(size) + 0.5) / size * 6.0 - 3.0
    x, z = np.meshgrid(along, along)
    return np.stack([x, np.zeros_like(x), z], axis=-1)


def test_a_point_light_falls_off_as_the_square_of_its_distance():
    position = np.array([0.5, 2.0, -1.0])
    lamp = Light(kind="point", position=tuple(position), color=(1.0, 0.5, 0.25), intensity=3.0)
    (map_,) = baked(FLOOR, lights=(lamp,))
    offset = position - floor_points()
    squared = (offset**2).sum(axis=-1)
    expected = 3.0 / squared * offset[..., 1] / np.sqrt(squared)
    assert map_.has_data.all()
    # float32 directions and products: a few units in the last place
    np.testing.assert_allclose(
        map_.values, expected[..., None] * np.array([1.0, 0.5, 0.25]), rtol=1e-6
    )


def test_a_shadow_is_exactly_where_rays_are_blocked():
    lamp = Light(kind="point", position=(1.0, 4.0, 0.5), decay=0.0, shadow=SHADOW)
    lit = baked(FLOOR, BALL, lights=(replace(lamp, shadow=None),))[0].values[..., 0]
    found = baked(FLOOR, BALL, lights=(lamp,))[0].values[..., 0] / lit
    toward = np.array(lamp.position) - floor_points()
    toward /= np.linalg.norm(toward, axis=-1, keepdims=True)
    passed = np.linalg.norm(np.cross(CENTER - floor_points(), toward), axis=-1)
    # The ball's faces lie inside it, by less than the sag of an edge of a 48th of a half turn.
    sag = RADIUS * (1.0 - math.cos(math.pi / 48))
    assert (found[passed < RADIUS - sag] == 0.0).all()
    assert (found[passed > RADIUS] == 1.0).all() and (found == 0.0).sum() > 500


def test_more_samples_give_the_share_of_a_texel_that_is_lit():
    # A wall's shadow ends, at the foot of the sun's slope, in the middle of a column of texels.
    column = 42
    top = 3.0 - 6.0 * (column + 0.5) / SIZE
    wall = SceneObject(
        mesh=Mesh(
            positions=np.array([[0, 0, 9], [0, 0, -9], [0, top, -9], [0, top, 9]], float),
            faces=np.array([[0, 1, 2], [0, 2, 3]]),
        ),
        material=LAMBERT,
    )
    sun = Light(direction=(-1.0, -1.0, 0.0), shadow=SHADOW)
    found = baked(FLOOR, wall, lights=(sun,), samples=16)[0].values[..., 0] * math.sqrt(2.0)
    assert found[:, column + 1 : SIZE // 2].max() == 0.0
    np.testing.assert_allclose(found[:, column], 0.5, rtol=1e-6)
    np.testing.assert_allclose(found[:, :column], 1.0, rtol=1e-6)


def test_ambient_light_is_that_of_the_side_a_normal_points_to():
    ambient = Ambient(color=(0.3, 0.4, 0.5), ground=(0.1, 0.0, 0.2))
    floor, ball = baked(FLOOR, BALL, ambient=ambient)
    sky = np.broadcast_to((0.3, 0.4, 0.5), floor.values.shape)
    np.testing.assert_allclose(floor.values, sky, atol=1e-7)
    # From the south pole at the bottom row to the north at the top.
    assert ball.values[-1].mean(axis=0) == pytest.approx([0.1, 0.0, 0.2], abs=0.01)
    assert ball.values[0].mean(axis=0) == pytest.approx([0.3, 0.4, 0.5], abs=0.01)


VIEW = CameraView(position=(3, 4, 5), target=(0, 0.4, 0), fov=45.0)
LAMPS = {
    "sun": Light(direction=(-0.5, -1.0, -0.4), shadow=SHADOW),
    "spot": Light(
        kind="spot", position=(2, 4, 1), direction=(-2, -4, -1), angle=60.0, intensity=15.0,
        blend=0.5, shadow=SHADOW,
    ),
    "point": Light(kind="point", position=(-1.5, 2.5, 1.0), intensity=5.0, shadow=SHADOW),
    "no shadow": Light(kind="point", position=(-1.5, 2.5, 1.0), intensity=5.0),
}  # fmt: skip


@pytest.mark.parametrize("kind", LAMPS)
def test_a_picture_with_maps_is_that_with_lamps(kind):
    ambient = Ambient(color=(0.1, 0.12, 0.15), ground=(0.05, 0.04, 0.03))
    scene = Scene(
        objects=(FLOOR, BALL), lighting=Lighting(lights=(LAMPS[kind],), ambient=ambient), view=VIEW,
    )  # fmt: skip
    maps = bake_light_maps(scene, BakeOptions(size=512, padding=2))
    assert maps.warnings == ()
    shown = maps.shown_in(scene)
    options = RenderOptions(width=240, height=180, supersampling=1)
    dynamic, still = render_scene(scene, options), render_scene(shown, options)
    names = {item.name for item in still.plan.passes}
    assert "light map" in names and not names & {"lights", "lambert", "shadow maps", "ambient"}
    apart = np.abs(dynamic.color - still.color)[..., :3].max(axis=-1)
    # A texel is 6 / 512 wide. Light bends least at the rims of the spot, where over a texel it is
    # off a straight line by less than 2e-3; normals of the ball differ as chord and arc do.
    assert np.percentile(apart, 95) < 3e-3
    # Only the outlines of shadows and of the ball, a texel or two wide, differ more.
    assert (apart > 1e-2).mean() < 0.03


def test_a_cookie_is_baked_with_its_spot():
    cookie = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 0]]], np.float32)
    spot = Light(
        kind="spot", position=(0, 4, 0), direction=(0, -1, 0), up=(0, 0, -1), angle=50.0,
        blend=0.0, profile=ImageTexture(image=cookie, filter="nearest"),
    )  # fmt: skip
    (found,) = baked(FLOOR, lights=(spot,))
    (white,) = baked(FLOOR, lights=(replace(spot, profile=None),))
    at = floor_points()
    # Bilinear there, so that only what lies nearest to the cookie's corners has its texels' colors.
    half = 4.0 * math.tan(math.radians(25))
    plain = (np.abs(at[..., [0, 2]]) > half / 2).all(axis=-1) & (white.values[..., 0] > 0)
    colors = cookie[(at[..., 2] > 0).astype(int), (at[..., 0] > 0).astype(int)]
    assert plain.sum() > 100
    np.testing.assert_allclose(found.values[plain], (white.values * colors)[plain], rtol=1e-6)


def test_only_static_lights_are_baked_and_removed():
    moving = Light(direction=(0, -1, 0), static=False)
    hung = Light(direction=(0, 0, -1), follows_camera=True)
    scene = Scene(objects=(FLOOR,), lighting=Lighting(lights=(moving, hung)))
    maps = bake_light_maps(scene, BakeOptions(size=8))
    assert maps.maps[0].values.max() == 0.0
    assert maps.warnings[0].startswith("scene: its light maps are black")
    assert maps.warnings[1:] == (
        "light light: it follows the camera and is left out of the light maps",
    )
    assert maps.shown_in(scene).lighting.lights == (moving, hung)


def test_objects_cast_and_receive_shadows_as_in_pictures():
    sun = Light(direction=(0.0, -1.0, 0.0), shadow=SHADOW)
    below = np.hypot(*(floor_points() - CENTER)[..., [0, 2]].T) < 0.9 * RADIUS

    def light(floor, ball, lamp):
        return baked(floor, ball, lights=(lamp,))[0].values[..., 0].T[below]

    assert (light(FLOOR, BALL, sun) == 0.0).all()
    assert (light(replace(FLOOR, receives_shadows=False), BALL, sun) == 1.0).all()
    assert (light(FLOOR, replace(BALL, casts_shadows=False), sun) == 1.0).all()
    assert (light(FLOOR, replace(BALL, visible=False), sun) == 0.0).all()
    assert (light(FLOOR, BALL, replace(sun, shadow=None)) == 1.0).all()


@pytest.mark.parametrize("elevation", [90.0, 20.0, 1.0])
@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e5])
def test_a_lit_plane_has_no_speck(elevation, scale):
    up = math.radians(elevation)
    sun = Light(direction=(0.8 * math.cos(up), -math.sin(up), 0.6), shadow=SHADOW)
    matrix = transform_matrix(scale=scale, rotate=(20, 0, 30)) @ FLOOR.transform
    sun = replace(
        sun, direction=tuple(transform_matrix(rotate=(20, 0, 30))[:3, :3] @ sun.direction)
    )
    (map_,) = baked(replace(FLOOR, transform=matrix), lights=(sun,))
    assert map_.values.min() > 0.99 * map_.values.max() > 0.0


def test_threads_change_no_byte():
    lamps = tuple(LAMPS.values())
    one, more = (baked(FLOOR, BALL, lights=lamps, samples=4, threads=threads) for threads in (1, 3))
    for a, b in zip(one, more, strict=True):
        assert a.values.tobytes() == b.values.tobytes()


def test_padding_extends_charts_and_the_background_is_black():
    mesh = plane()
    item = replace(FLOOR, mesh=mesh.replace(uvs=0.25 + 0.5 * mesh.uvs))
    (map_,) = baked(item, lights=(Light(direction=(0, -1, 0)),))
    covered = np.zeros((SIZE, SIZE), bool)
    covered[32:96, 32:96] = True
    np.testing.assert_array_equal(map_.has_data, covered)
    assert (map_.values[31:97, 32:96] == 1.0).all() and (map_.values[:29] == 0.0).all()


def test_objects_without_coordinates_are_reported():
    bare = SceneObject(mesh=Mesh(positions=BALL.mesh.positions, faces=BALL.mesh.faces), name="bare")
    scene = Scene(objects=(FLOOR, bare), lighting=Lighting(lights=(Light(),)), name="room.toml")
    maps = bake_light_maps(scene, BakeOptions(size=8))
    assert [item.name for item in maps.maps] == ["floor"]
    assert maps.warnings == ("bare: it has no texture coordinates and gets no light map",)
    with pytest.raises(OptionError, match="bare has no light map"):
        maps.shown_in(scene)
    with pytest.raises(UvError, match=r"room\.toml: none of its lit objects has the texture"):
        bake_light_maps(replace(scene, objects=(bare,)))


def test_overlaps_and_tiles_are_reported():
    mesh = plane(2, 1)
    folded = mesh.replace(uvs=np.abs(mesh.uvs * [2.0, 1.0] - [1.0, 0.0]))
    tiled = mesh.replace(uvs=mesh.uvs * 2.0)
    scene = Scene(
        objects=(SceneObject(mesh=folded, name="folded"), SceneObject(mesh=tiled, name="tiled")),
        name="room.toml",
    )  # fmt: skip
    warnings = bake_light_maps(scene, BakeOptions(size=8)).warnings
    assert [text.split(":")[0] for text in warnings] == ["room.toml", "folded", "tiled"]
    assert "its light maps are black; add ambient light" in warnings[0]


def test_files_hold_light_beyond_1_or_end_there(tmp_path):
    (map_,) = baked(FLOOR, lights=(Light(direction=(0, -1, 0), intensity=2.5),), size=8)
    map_.write(tmp_path / "light.exr")
    map_.write(tmp_path / "light.png")
    assert (read_image(tmp_path / "light.exr", color=True).pixels == 2.5).all()
    assert (read_image(tmp_path / "light.png", color=True).pixels == 1.0).all()


def test_a_further_set_is_baked_as_if_it_were_the_only_one():
    lighting = Lighting(lights=(Light(kind="point", position=(0.4, 0.3, 0.5)),))
    options = BakeOptions(size=32, samples=4)

    def scene(*meshes):
        material = Material(shading="lambert")
        objects = tuple(SceneObject(mesh=mesh, material=material, name="floor") for mesh in meshes)
        return Scene(objects=objects, lighting=lighting)

    mesh = plane(2, 2)
    uvs = 0.1 + 0.8 * mesh.uvs
    both = mesh.replace(uv_sets={"lightmap": UvSet(uvs=uvs, faces=mesh.uv_faces)})
    only = mesh.replace(uvs=uvs)
    found = bake_light_maps(scene(both), options, uv_set="lightmap")
    expected = bake_light_maps(scene(only), options)
    np.testing.assert_array_equal(found.maps[0].values, expected.maps[0].values)
    assert (found.maps[0].uv_set, expected.maps[0].uv_set) == ("lightmap", None)
    # In pictures the map lies on its set.
    shown = found.shown_in(scene(both))
    slot = shown.objects[0].material.light_map
    assert isinstance(slot, ImageTexture) and slot.uv_set == "lightmap"
    first, second = (
        render_scene(each, RenderOptions(width=32, height=32)).color
        for each in (shown, expected.shown_in(scene(only)))
    )
    np.testing.assert_array_equal(first, second)
    mixed = bake_light_maps(scene(both, mesh), options, uv_set="lightmap")
    assert [item.uv_set for item in mixed.maps] == ["lightmap", None]
    # TEXCOORD_0 is the first set, unless a glTF file has put another one first.
    second = mesh.replace(uv_sets={"TEXCOORD_0": UvSet(uvs=uvs, faces=mesh.uv_faces)})
    named = bake_light_maps(scene(both, second), options, uv_set="TEXCOORD_0")
    assert [item.uv_set for item in named.maps] == [None, "TEXCOORD_0"]
    with pytest.raises(UvError, match="none of its lit objects has the texture coordinates atlas"):
        bake_light_maps(scene(both), options, uv_set="atlas")
