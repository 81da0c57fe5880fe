"""Every scene of the catalog through the renderer, and through a bake of its light."""

import numpy as np
import pytest
from catalog.scenes import SMALL, checker, floor, looking, scene

import texbake
from texbake import Material, RenderOptions, SceneObject
from texbake.errors import UvError
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.options import BUFFERS
from texbake.rendering.render import plan_scene
from texbake.rendering.scene.material import NormalMap


def assert_sound(frame):
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0.0
    assert ((frame.coverage >= 0.0) & (frame.coverage <= 1.0)).all()


@pytest.mark.parametrize("interpolation", ["perspective", "affine", "scanline"])
def test_colors_are_finite_and_not_negative(scene_case, interpolation):
    options = RenderOptions(width=48, height=32, interpolation=interpolation)
    frame = texbake.render_scene(scene_case.make(), options, threads=1)
    assert_sound(frame)
    if "empty" in scene_case.traits:
        assert frame.coverage.max() == 0.0


@pytest.mark.parametrize("buffer", BUFFERS)
def test_buffers_are_finite_too(scene_case, buffer):
    options = RenderOptions(width=24, height=16, buffer=buffer)
    try:
        frame = texbake.render_scene(scene_case.make(), options, threads=1)
    except UvError:
        return  # there are no coordinates to show
    assert_sound(frame)


def test_threads_change_no_byte_of_a_picture(scene_case):
    made = scene_case.make()
    one = texbake.render_scene(made, SMALL, threads=1)
    three = texbake.render_scene(made, SMALL, threads=3)
    np.testing.assert_array_equal(one.color, three.color)


def test_the_plan_is_made_without_drawing(scene_case):
    assert plan_scene(scene_case.make(), SMALL).passes


def test_of_coplanar_faces_one_object_is_seen_everywhere():
    flat = {"shading": "unlit"}
    made = scene(
        SceneObject(mesh=floor(), material=Material(base_color=(1.0, 0.0, 0.0), **flat)),
        SceneObject(mesh=floor(), material=Material(base_color=(0.0, 1.0, 0.0), **flat)),
    )
    frame = texbake.render_scene(made, SMALL)
    seen = frame.color[frame.coverage == 1.0]
    assert len(seen) and (seen == seen[0]).all()


def test_ground_below_the_horizon_is_covered_and_above_it_not():
    """Closed form: an infinite plane fills the picture up to the horizon, the middle row."""
    made = scene(SceneObject(mesh=floor(1e6)), view=looking((0.0, 1.0, 0.0), (0.0, 1.0, -1.0)))
    frame = texbake.render_scene(made, RenderOptions(width=48, height=32, supersampling=1))
    assert (frame.coverage[:16] == 0.0).all() and (frame.coverage[17:] == 1.0).all()


@pytest.mark.parametrize("distance", [1.0, 1e3, 1e6])
def test_a_surface_a_millionth_in_front_hides_the_one_behind(distance):
    """With near planes of 1e-3 and so depths of 1e-9: reversed depth keeps them apart."""
    wall = plane()
    near, far = (
        wall.replace(positions=(wall.positions - [0.5, 0.5, 0.0]) * d * 9 - [0, 0, d])
        for d in (distance, distance * (1.0 + 1e-6))
    )
    red, green = (
        Material(shading="unlit", base_color=color) for color in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )
    view = texbake.CameraView(position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), near=1e-3)
    made = scene(
        SceneObject(mesh=far, material=green), SceneObject(mesh=near, material=red), view=view
    )
    frame = texbake.render_scene(made, SMALL)
    np.testing.assert_array_equal(
        frame.color[..., :3], np.broadcast_to(np.float32([1, 0, 0]), (32, 48, 3))
    )


def test_a_checker_to_the_horizon_tends_to_its_mean():
    made = scene(
        SceneObject(
            mesh=floor(1e6),
            material=Material(shading="unlit", base_color=checker(filter="ewa", scale=(1e6, 1e6))),
        ),
        view=looking((0.0, 1.0, 0.0), (0.0, 1.0, -1.0)),
    )
    frame = texbake.render_scene(made, RenderOptions(width=48, height=32, supersampling=1))
    # The first rows below the horizon see thousands of cells in each pixel.
    np.testing.assert_allclose(frame.color[17:19, :, :3], 0.5, atol=0.02)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_normal_maps_without_directions_leave_the_surface_as_it_is(value):
    nothing = texbake.ImageTexture(image=np.full((4, 4, 3), value, np.float32), color=False)
    options = RenderOptions(width=48, height=32, buffer="normals")
    bare, mapped = (
        texbake.render_scene(scene(SceneObject(mesh=uv_sphere(8, 16), material=material)), options)
        for material in (Material(), Material(normal_map=NormalMap(texture=nothing)))
    )
    np.testing.assert_allclose(mapped.color, bare.color, atol=1e-6)


def test_light_is_finite_not_negative_and_shown_again(scene_case):
    made = scene_case.make()
    try:
        baked = texbake.bake_light_maps(made, texbake.BakeOptions(size=16, threads=1))
    except UvError as error:
        assert "\n" not in str(error)
        return  # there are no coordinates to bake to
    for item in baked.maps:
        assert np.isfinite(item.values).all() and item.values.min() >= 0.0
        assert (item.values[~item.has_data] >= 0.0).all()
    options = texbake.RenderOptions(width=24, height=16)
    frame = texbake.render_scene(baked.shown_in(made), options, threads=1)
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0.0


def test_threads_change_no_byte_of_a_light_map(scene_case):
    made = scene_case.make()
    try:
        one, three = (
            texbake.bake_light_maps(made, texbake.BakeOptions(size=8, threads=n)) for n in (1, 3)
        )
    except UvError:
        return
    for ours, theirs in zip(one.maps, three.maps, strict=True):
        np.testing.assert_array_equal(ours.values, theirs.values)
