"""Where objects stand, and cameras that look at them."""

import numpy as np
import pytest

from texbake import CameraView, OptionError, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import cube, plane
from texbake.rendering.camera import Camera
from texbake.rendering.scene.scene import (
    camera_of,
    outline,
    place_mesh,
    transform_matrix,
    turntable_cameras,
)

OPTIONS = RenderOptions(width=640, height=360)


def scene(view=None, **changes):
    block = SceneObject(mesh=cube(), transform=transform_matrix(translate=(3, 1, 0), scale=2))
    return Scene(objects=(block, SceneObject(mesh=plane())), view=view, **changes)


def test_an_object_without_a_transform_is_its_mesh():
    item = SceneObject(mesh=cube())
    assert place_mesh(item) is item.mesh and outline(item) is item.mesh


@pytest.mark.parametrize("axis", range(3))
def test_turns_go_counter_clockwise_seen_from_where_the_axis_points(axis):
    following, last = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    turn = transform_matrix(rotate=tuple(30.0 * np.eye(3)[axis]))[:3, :3]
    expected = np.cos(np.pi / 6) * following + np.sin(np.pi / 6) * last
    np.testing.assert_allclose(turn @ following, expected, atol=1e-15)


@pytest.mark.parametrize("angle", [-90, 90, 180, 270, 360, 450])
def test_quarter_turns_are_exact(angle):
    turn = transform_matrix(rotate=(angle, angle, angle))[:3, :3]
    assert set(np.abs(turn).ravel()) == {0.0, 1.0}


@pytest.mark.parametrize(("matrix", "message"), [
    (np.diag([1.0, 1.0, 0.0, 1.0]), "transform: it is singular"),
    (np.diag([1e9, 1.0, 1e-9, 1.0]), "transform: it is singular"),
    (np.zeros((4, 4)), "transform: its last row is not"),
    (np.eye(3), "transform: it is not 4 x 4"),
    (np.diag([1.0, np.nan, 1.0, 1.0]), "transform: it is not 4 x 4 finite"),
])  # fmt: skip
def test_what_is_no_transform(matrix, message):
    with pytest.raises(OptionError, match=message):
        SceneObject(mesh=cube(), transform=matrix)


def test_small_and_large_transforms_are_not_singular():
    for size in 1e-200, 1e-9, 1e9, 1e100:
        item = SceneObject(mesh=cube(), transform=transform_matrix(scale=size))
        assert place_mesh(item).diagonal == pytest.approx(size * cube().diagonal)
    item = SceneObject(mesh=cube(), transform=transform_matrix(scale=(1e-6, 1e6, 1.0)))
    assert place_mesh(item).diagonal == pytest.approx(1e6 * np.ptp(cube().positions[:, 1]))


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_view_of_angles_frames_what_is_placed(up):
    options = RenderOptions(width=640, height=360, up=up)
    camera = camera_of(scene(CameraView(angles=(40, 10), fov=50)), options)
    meshes = [place_mesh(item) for item in scene().objects]
    framed = Camera.framing(
        *meshes, options=RenderOptions(width=640, height=360, up=up, view=(40, 10), fov=50)
    )
    np.testing.assert_allclose(camera.eye, framed.eye, rtol=1e-15)
    np.testing.assert_array_equal(camera.axes, framed.axes)
    assert camera.fov == framed.fov


def test_objects_that_are_not_seen_are_not_framed():
    hidden = SceneObject(mesh=cube(), transform=transform_matrix(scale=1e3), visible=False)
    only = Scene(objects=(SceneObject(mesh=cube()), hidden))
    np.testing.assert_array_equal(
        camera_of(only, OPTIONS).eye, Camera.framing(cube(), options=OPTIONS).eye
    )


@pytest.mark.parametrize("position", [(4, 3, 5), (-1, -2, 0.1), (0, 0, 1e9), (1e-9, 0, 0)])
def test_a_camera_at_a_position_has_its_target_in_the_middle(position):
    target = (0, 0, 0.0)
    camera = camera_of(scene(CameraView(position=position, target=target)), OPTIONS)
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    clip = camera.clip_from_world(16 / 9) @ [*target, 1]
    np.testing.assert_allclose(clip[:2] / clip[3], 0, atol=1e-12)
    assert clip[3] == pytest.approx(np.linalg.norm(position))
    # Upright: what is up in the world is not to the side in the picture, and not below.
    assert camera.axes[0, 1] == pytest.approx(0, abs=1e-15)
    assert camera.axes[1, 1] >= 0
    # Nearer than the target, whatever the size of the scene.
    assert 0 < camera.near <= 1e-3 * np.linalg.norm(position)


def test_up_is_as_the_view_says_else_as_the_options():
    view = CameraView(position=(5, 0, 0), target=(0, 0, 0))
    tilted = CameraView(position=(5, 0, 0), target=(0, 0, 0), up=(0, 2, 2))
    options = RenderOptions(up="z")
    np.testing.assert_array_equal(camera_of(scene(view), OPTIONS).axes[1], [0, 1, 0])
    np.testing.assert_array_equal(camera_of(scene(view), options).axes[1], [0, 0, 1])
    np.testing.assert_allclose(
        camera_of(scene(tilted), options).axes[1], np.array([0, 1, 1]) / 2**0.5
    )


@pytest.mark.parametrize(("eye", "target", "changes", "message"), [
    ((1, 2, 3), (1, 2, 3), {}, "position: it is the same as the target"),
    ((1e9, 0, 0), (1e9 + 1e-7, 0, 0), {}, "position: it is the same as the target"),
    ((0, 5, 0), (0, 0, 0), {}, "up: it is parallel to the view"),
    ((0, -5, 0), (0, 0, 0), {"up": (0, 1e-3, 0)}, "up: it is parallel to the view"),
    ((0, 0, 5), (0, 0, 0), {"up": (0, 0, 0)}, "up: it has no length"),
    ((0, 0, np.nan), (0, 0, 0), {}, "position: .* is not three finite numbers"),
    ((0, 0, 5), (0, 0, 0), {"fov": 0.0}, "fov: 0 is out of range"),
    ((0, 0, 5), (0, 0, 0), {"fov": np.pi}, "fov: 180 is out of range"),
    ((0, 0, 5), (0, 0, 0), {"near": 0.0}, "near: 0 is not above 0"),
])  # fmt: skip
def test_what_is_no_camera(eye, target, changes, message):
    with pytest.raises(OptionError, match=message):
        Camera.looking_at(eye, target, **{"fov": 1.0, "near": 0.1, **changes})


def test_a_turn_by_angles_is_a_turn_of_the_azimuth():
    cameras = turntable_cameras(scene(CameraView(angles=(30, 20))), OPTIONS, 5)
    assert len(cameras) == 5
    for i, camera in enumerate(cameras):
        stepped = camera_of(scene(CameraView(angles=(30 + 72 * i, 20))), OPTIONS)
        np.testing.assert_allclose(camera.eye, stepped.eye, atol=1e-12)
        np.testing.assert_allclose(camera.axes, stepped.axes, atol=1e-14)
        assert (camera.fov, camera.near) == (stepped.fov, stepped.near)


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_turn_of_a_position_goes_around_the_middle(up):
    options = RenderOptions(up=up)
    view = CameraView(position=(9, 4, 7), target=(3, 1, 0), up=(0.1, 1, 0.2))
    cameras = turntable_cameras(scene(view), options, 4)
    center, _ = Camera.sphere_around(*(place_mesh(item) for item in scene().objects))
    axis = {"y": 1, "z": 2}[up]
    first = cameras[0].axes @ (center - cameras[0].eye)
    for camera in cameras:
        # The middle of the scene stays where it is in the picture; the height stays.
        np.testing.assert_allclose(camera.axes @ (center - camera.eye), first, atol=1e-12)
        assert camera.eye[axis] == pytest.approx(cameras[0].eye[axis])
        assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    np.testing.assert_allclose(cameras[0].eye + cameras[2].eye, 2 * center + 2 * np.eye(3)[axis] * (
        cameras[0].eye - center)[axis], atol=1e-12)  # fmt: skip


def test_a_turn_of_no_views():
    with pytest.raises(OptionError, match="turntable: 0 views is out of range"):
        turntable_cameras(scene(), OPTIONS, 0)
