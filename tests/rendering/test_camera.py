import math

import numpy as np
import pytest

from texbake import Mesh, RenderOptions
from texbake.errors import MeshError
from texbake.mesh.compose import transformed
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.rendering.camera import Camera, fill_picture


def ndc(camera, points, aspect):
    points = np.atleast_2d(points)
    clip = np.c_[points, np.ones(len(points))] @ camera.clip_from_world(aspect).T
    return clip[:, :3] / clip[:, 3:]


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("view", [(0, 0), (30, 20), (200, -70), (90, 90), (45, -90)])
def test_axes_are_a_right_handed_frame_that_looks_at_the_center(view, up):
    camera = Camera.framing(cube(), options=RenderOptions(view=view, up=up))
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    np.testing.assert_allclose(ndc(camera, [0, 0, 0], 1.5)[0, :2], 0.0, atol=1e-15)
    # Upright: the world's up axis points up in the picture and not to the side.
    axis = {"y": 1, "z": 2}[up]
    assert camera.axes[0, axis] == pytest.approx(0.0, abs=1e-15)
    assert camera.axes[1, axis] == pytest.approx(math.cos(math.radians(view[1])), abs=1e-15)


@pytest.mark.parametrize(
    ("up", "azimuth", "toward"),
    [("y", 0, (0, 0, 1)), ("y", 90, (1, 0, 0)), ("z", 0, (0, -1, 0)), ("z", 90, (1, 0, 0))],
)
def test_azimuth_goes_counter_clockwise_from_the_front(up, azimuth, toward):
    camera = Camera.framing(cube(), options=RenderOptions(view=(azimuth, 0), up=up))
    np.testing.assert_allclose(camera.axes[2], toward, atol=1e-15)
    np.testing.assert_allclose(
        camera.eye, np.array(toward) * np.linalg.norm(camera.eye), atol=1e-12
    )


@pytest.mark.parametrize("size", [(640, 360), (300, 300), (200, 700)])
def test_the_bounding_sphere_fills_the_shorter_side(size):
    width, height = size
    mesh = icosphere(4).replace(positions=icosphere(4).positions * 3 + (10, -20, 5))
    camera = Camera.framing(mesh, options=RenderOptions(width=width, height=height))
    seen = ndc(camera, mesh.positions, width / height)
    assert np.abs(seen[:, :2]).max() < 1.0
    # 3 % of room; the sphere's outline is an ellipse that reaches as far on both sides.
    assert np.abs(seen[:, 0 if width < height else 1]).max() > 0.94


def test_meshes_are_framed_together():
    left = cube()
    right = left.replace(positions=left.positions + np.array([10.0, 0, 0]))
    camera = Camera.framing(left, right, options=RenderOptions(view=(0, 0)))
    np.testing.assert_allclose(camera.eye[:2], [5, 0], atol=1e-12)
    assert np.abs(ndc(camera, [[-0.5, 0, 0], [10.5, 0, 0]], 16 / 9)[:, :2]).max() < 1.0


def test_a_distance_is_kept():
    camera = Camera.framing(cube(), options=RenderOptions(view=(12, 34, 7.5)))
    assert np.linalg.norm(camera.eye) == pytest.approx(7.5)


def test_depth_is_one_at_the_near_plane_and_falls_to_zero():
    camera = Camera.framing(cube(), options=RenderOptions(view=(0, 0, 2.0)))
    z = camera.eye[2] - camera.near * np.array([1.0, 2.0, 1e6])
    points = np.c_[np.zeros((3, 2)), z]
    np.testing.assert_allclose(ndc(camera, points, 1.0)[:, 2], [1.0, 0.5, 1e-6], rtol=1e-9)


def test_view_rays_go_where_the_clip_matrix_says():
    camera = Camera.framing(cube(), options=RenderOptions(view=(40, -15)))
    width, height = 320, 200
    origin, along, down = camera.view_rays(width, height)
    for column, row in (0, 0), (320, 0), (17.5, 120.25):
        point = camera.eye + 3.0 * (origin + column * along + row * down)
        x, y, _ = ndc(camera, point, width / height)[0]
        assert (x + 1) / 2 * width == pytest.approx(column, abs=1e-9)
        assert (1 - y) / 2 * height == pytest.approx(row, abs=1e-9)


BALL = uv_sphere(16, 32)
BOTH = pytest.mark.parametrize(
    "frame", [Camera.framing, lambda mesh: fill_picture([mesh], RenderOptions())[0]]
)


@BOTH
def test_unused_vertices_are_not_framed_and_a_mesh_too_large_is_an_error(frame):
    more = BALL.replace(positions=np.r_[BALL.positions, [[1e6, 0, 0]]])
    np.testing.assert_array_equal(frame(BALL).eye, frame(more).eye)
    with pytest.raises(MeshError, match=r"h\.obj: it is too large to render"):
        frame(stretched(1e300, 1e300, 1.0).replace(name="h.obj"))


def stretched(*sizes):
    return transformed(cube(), np.diag([*sizes, 1.0]))


@pytest.mark.parametrize("size", [(320, 180), (180, 320), (256, 256)])
@pytest.mark.parametrize("view", [(30.0, 20.0), (200.0, -50.0), (0.0, 90.0)])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_mesh_fills_the_picture(size, view, up, scale):
    options = RenderOptions(width=size[0], height=size[1], view=view, up=up)
    mesh = stretched(scale, 1.5 * scale, 0.8 * scale)
    camera = fill_picture([mesh], options)[0]
    seen = ndc(camera, mesh.positions, size[0] / size[1])
    assert (seen[:, 2] < 1.0).all()  # beyond the near plane
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    assert 0.7 < np.abs([low, high]).max() < 0.9 + 1e-9
    np.testing.assert_allclose(low + high, 0.0, atol=0.15)  # perspective moves the middle


def test_a_rod_toward_the_camera_is_not_exaggerated():
    rod = stretched(1.0, 1.0, 100.0)
    options = RenderOptions(view=(0.0, 0.0))
    camera = fill_picture([rod], options)[0]
    assert camera.eye[2] > 2.0 * np.abs(rod.positions).max()


def with_stray(mesh, triangle):
    n = mesh.n_vertices
    return Mesh(
        positions=np.concatenate([mesh.positions, triangle]),
        faces=np.concatenate([mesh.faces, [[n, n + 1, n + 2]]]).astype(np.int32),
    )


FAR = np.array([[500.0, 0.0, 0.0], [500.1, 0.0, 0.0], [500.0, 0.1, 0.0]])


@pytest.mark.parametrize("triangle", [FAR, np.repeat(FAR[:1], 3, axis=0)], ids=["small", "point"])
@pytest.mark.parametrize("mesh", [cube(), BALL, uv_sphere(256, 512)], ids=["cube", "ball", "fine"])
def test_strays_do_not_count(mesh, triangle):
    options = RenderOptions()
    alone, none = fill_picture([mesh], options)
    found, one = fill_picture([with_stray(mesh, triangle)], options)
    assert (none, one) == (0, 1)
    np.testing.assert_array_equal(found.eye, alone.eye)


def test_large_or_near_parts_are_no_strays():
    options = RenderOptions()
    for triangle in FAR * (1.0, 500.0, 1.0), FAR - (495.0, 0.0, 0.0):
        assert fill_picture([with_stray(BALL, triangle)], options)[1] == 0


def test_a_mesh_without_extent_has_a_camera():
    point = Mesh(positions=np.ones((3, 3)), faces=[[0, 1, 2]])
    camera = fill_picture([point], RenderOptions())[0]
    assert np.linalg.norm(camera.eye - 1.0) == pytest.approx(2.2)
