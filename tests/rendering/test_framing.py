"""Cameras that fill the picture with a surface and ignore strays."""

import numpy as np
import pytest

from texbake.errors import MeshError
from texbake.mesh.compose import transformed
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, uv_sphere
from texbake.rendering.camera import fill_picture
from texbake.rendering.options import RenderOptions

BALL = uv_sphere(16, 32)


def extent(mesh, camera, options):
    """(x, y) of the lower left and the upper right corner, from -1 to 1 in the picture."""
    matrix = camera.clip_from_world(options.width / options.height)
    points = mesh.positions[np.unique(mesh.faces)]
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    assert (clip[:, 3] > camera.near).all()
    flat = clip[:, :2] / clip[:, 3:]
    return flat.min(axis=0), flat.max(axis=0)


def stretched(*sizes):
    return transformed(cube(), np.diag([*sizes, 1.0]))


@pytest.mark.parametrize("size", [(320, 180), (180, 320), (256, 256)])
@pytest.mark.parametrize("view", [(30.0, 20.0), (200.0, -50.0), (0.0, 90.0)])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_mesh_fills_the_picture(size, view, up, scale):
    options = RenderOptions(width=size[0], height=size[1], view=view, up=up)
    mesh = stretched(scale, 1.5 * scale, 0.8 * scale)
    low, high = extent(mesh, fill_picture([mesh], options).camera, options)
    assert 0.7 < np.abs([low, high]).max() < 0.9 + 1e-9
    np.testing.assert_allclose(low + high, 0.0, atol=0.15)  # perspective moves the middle


def test_a_rod_toward_the_camera_is_not_exaggerated():
    rod = stretched(1.0, 1.0, 100.0)
    options = RenderOptions(view=(0.0, 0.0))
    camera = fill_picture([rod], options).camera
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
    alone, found = (
        fill_picture([mesh], options),
        fill_picture([with_stray(mesh, triangle)], options),
    )
    assert (alone.n_strays, found.n_strays) == (0, 1)
    np.testing.assert_array_equal(found.camera.eye, alone.camera.eye)


def test_large_or_near_parts_are_no_strays():
    options = RenderOptions()
    for triangle in FAR * (1.0, 500.0, 1.0), FAR - (495.0, 0.0, 0.0):
        assert fill_picture([with_stray(BALL, triangle)], options).n_strays == 0


def test_vertices_without_faces_do_not_count():
    options = RenderOptions()
    more = Mesh(positions=np.concatenate([BALL.positions, FAR]), faces=BALL.faces)
    found = fill_picture([more], options).camera.eye
    np.testing.assert_array_equal(found, fill_picture([BALL], options).camera.eye)


def test_a_mesh_without_extent_has_a_camera():
    point = Mesh(positions=np.ones((3, 3)), faces=[[0, 1, 2]])
    camera = fill_picture([point], RenderOptions()).camera
    assert np.linalg.norm(camera.eye - 1.0) == pytest.approx(2.2)


def test_a_mesh_beyond_float64_is_one_error():
    with pytest.raises(MeshError, match="too large to render"):
        fill_picture([stretched(1e200, 1e200, 1e200)], RenderOptions())
