"""Perspective, and clipping in it, against rays met with the plane of the triangle."""

import numpy as np
import pytest

from texbake.rendering.camera import Camera
from texbake.rendering.fragments import fragment_rows, weights_at
from texbake.rendering.rasterize import CULL_BACK, SHOW_BACK, join_objects, rasterize

WIDTH, HEIGHT = 160, 120


def camera_at(eye, toward, near=1e-3):
    back = -np.asarray(toward, np.float64)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    return Camera(eye=np.asarray(eye, np.float64), axes=axes, fov=1.0, near=near)


def rays(camera):
    """(H, W, 3) directions through the centers of the samples, from the camera's axes alone."""
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    tall = np.tan(camera.fov / 2)
    x = (2 * columns / WIDTH - 1) * tall * WIDTH / HEIGHT
    y = (1 - 2 * rows / HEIGHT) * tall
    right, up, back = camera.axes
    return x[..., None] * right + y[..., None] * up - back


def seen(camera, positions, faces, back_faces="cull"):
    world = join_objects([(np.asarray(positions, np.float64), np.asarray(faces, np.int32))])
    modes = np.array([SHOW_BACK if back_faces == "show" else CULL_BACK], np.uint8)
    return rasterize(world, camera.clip_from_world(WIDTH / HEIGHT), WIDTH, HEIGHT, modes=modes)


def weights_of(visibility, camera, positions, faces, **options):
    """Weights, sides and changes of the covered samples, each a fragment of its own."""
    world = join_objects([(np.asarray(positions, np.float64), np.asarray(faces, np.int32))])
    rows = fragment_rows(visibility.face_ids, world, (0, HEIGHT), side=1)
    np.testing.assert_array_equal(rows.faces, visibility.face_ids[visibility.face_ids >= 0])
    matrix = camera.clip_from_world(WIDTH / HEIGHT)
    return weights_at(world, matrix, WIDTH, HEIGHT, rows.faces, rows.places, **options)


def points_of(visibility, camera, positions, faces):
    """(n, 3) points that the covered samples see."""
    covered = visibility.face_ids >= 0
    corners = np.asarray(positions)[np.asarray(faces)[visibility.face_ids[covered]]]
    weights = weights_of(visibility, camera, positions, faces)[0]
    weights = np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1)
    return np.einsum("nk,nkc->nc", weights, corners), covered


QUAD = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], np.float64)
SPLIT = [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("eye", [(0, 0, 6), (3.5, 1, 2), (5, -3, 1.5)])
def test_a_plane_is_seen_where_rays_meet_it(eye):
    camera = camera_at(eye, -np.array(eye) + (0.1, 0.2, 0))
    visibility = seen(camera, QUAD, SPLIT)
    points, covered = points_of(visibility, camera, QUAD, SPLIT)
    assert covered.mean() > 0.02
    directions = rays(camera)[covered]
    distances = -camera.eye[2] / directions[:, 2]
    expected = camera.eye + distances[:, None] * directions
    # Texture coordinates (x + 2) / 4 of the plane to 1e-5: a sample that snapping brought in is
    # moved back to the edge, by 1/512 of a sample at most.
    assert np.abs(points - expected).max() / 4 < 1e-5
    # The direction of a ray is one unit deep, so that its length is the distance in depth. Depths
    # are those of the snapped triangle: off by what depth changes within 1/512 of a sample, which
    # at the steepest here is 1e-4 of it.
    np.testing.assert_allclose(camera.near / visibility.depths[covered], distances, rtol=1e-4)


def test_a_floor_under_the_camera_reaches_the_horizon_whole():
    # Two triangles, both through the plane of the eye and beyond it; far greater than the guard.
    for size in 10.0, 1e7:
        floor = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * size
        camera = camera_at((0.3, 1.0, 0.2), (0.2, -0.1, -1.0))
        both = seen(camera, floor, SPLIT)
        alone = [seen(camera, floor, [face]).face_ids == 0 for face in SPLIT]
        assert not (alone[0] & alone[1]).any()
        np.testing.assert_array_equal(alone[0] | alone[1], both.face_ids >= 0)
        directions = rays(camera)
        with np.errstate(divide="ignore"):
            met = camera.eye + (-1.0 / directions[..., 1:2]) * directions
        inside = (directions[..., 1] < 0) & (np.abs(met[..., [0, 2]]).max(axis=-1) < size)
        # The rim of the small floor and the horizon of the large one may snap either way: their
        # samples lie within 1/256 of the edge, which no sample does by chance here.
        np.testing.assert_array_equal(both.face_ids >= 0, inside)
        points, covered = points_of(both, camera, floor, SPLIT)
        near = np.abs(met[covered]).max(axis=1) < 10.0
        assert near.sum() > 1000
        # In units of the floor: places of samples are float32.
        assert np.abs(points - met[covered])[near].max() / size < 1e-6


def test_a_triangle_through_the_eye_is_cut_at_the_near_plane():
    # It lies in a plane through the eye, edge-on: no sample, no error; then a bit beside it.
    camera = camera_at((0, 0, 0), (0, 0, -1), near=0.1)
    edge_on = [[0, -1, 1], [0, 1, 1], [0, 0, -5]]
    assert (seen(camera, edge_on, [[0, 1, 2]], back_faces="show").face_ids == -1).all()
    beside = np.array(edge_on) + np.array([0.05, 0, 0])
    visibility = seen(camera, beside, [[0, 1, 2]], back_faces="show")
    covered = visibility.face_ids == 0
    assert covered.any()
    assert np.isfinite(weights_of(visibility, camera, beside, [[0, 1, 2]])[0]).all()
    depths = camera.near / visibility.depths[covered]
    directions = rays(camera)[covered]
    np.testing.assert_allclose(depths, 0.05 / directions[:, 0], rtol=1e-3)
    # Cut at the near plane, and reaching it.
    assert camera.near <= depths.min() < 1.2 * camera.near


@pytest.mark.parametrize(
    "triangle",
    [
        [[-1, -1, 1], [1, -1, 1], [0, 1, 1]],  # behind
        [[-1, -1, 0], [1, -1, 0], [0, 1, 0]],  # in the plane of the eye
        [[-1, -1, -0.05], [1, -1, -0.05], [0, 1, -0.05]],  # before the near plane
        [[1e9, 0, -1], [1e9, 1, -1], [1e9, 0, -2]],  # beside
        [[1e308, 0, -1e308], [0, 1e308, -1e308], [-1e308, 0, 1e308]],  # beyond float64
    ],
)
def test_nothing_is_seen_of_what_is_not_in_front(triangle):
    camera = camera_at((0, 0, 0), (0, 0, -1), near=0.1)
    for face in [0, 1, 2], [2, 1, 0]:
        assert (seen(camera, triangle, [face], back_faces="show").face_ids == -1).all()


def test_a_camera_inside_a_closed_mesh_sees_it_all_around():
    from texbake.mesh.shapes import cube

    mesh = cube()
    for toward in np.random.default_rng(1).normal(size=(8, 3)):
        camera = camera_at((0.1, -0.2, 0.3), toward)
        visibility = seen(camera, mesh.positions, mesh.faces, back_faces="show")
        assert (visibility.face_ids >= 0).all()
        assert weights_of(visibility, camera, mesh.positions, mesh.faces)[1].all()
        points, _ = points_of(visibility, camera, mesh.positions, mesh.faces)
        # On the cube's surface, whatever place on a face a weight tells.
        np.testing.assert_allclose(np.abs(points).max(axis=1), 0.5, atol=1e-12)


def test_changes_are_differences_of_neighboring_pixels():
    camera = camera_at((1.5, 1, 2), (-1.4, -0.8, -2))
    visibility = seen(camera, QUAD, [[0, 1, 2]])
    world = join_objects([(QUAD, np.array([[0, 1, 2]], np.int32))])
    rows = fragment_rows(visibility.face_ids, world, (0, HEIGHT), side=1)
    inside = (rows.places > 20).all(axis=1) & (rows.places < (140, 100)).all(axis=1)
    places = rows.places[inside]
    assert len(places) > 1000

    def weights(step):
        moved = (places + np.float32(step)).astype(np.float32)
        return weights_at(
            world, camera.clip_from_world(WIDTH / HEIGHT), WIDTH, HEIGHT,
            rows.faces[inside], moved, wants_changes=True,
        )  # fmt: skip

    _, _, changes = weights((0.0, 0.0))
    for axis, step in enumerate([(1 / 64, 0), (0, 1 / 64)]):
        ahead, behind = weights(step)[0], weights(-np.array(step))[0]
        kept = ((ahead > 0) & (behind > 0)).all(axis=1)
        central = (ahead - behind)[kept] * 32
        # Central differences over 1/32 of a pixel: off by their third derivative, 1e-6 of it.
        np.testing.assert_allclose(
            changes[kept, 2 * axis : 2 * axis + 2], central, rtol=1e-4, atol=1e-7
        )


def test_affine_weights_are_linear_on_the_screen():
    camera = camera_at((2.5, 1, 2), (-2.4, -0.8, -2))
    visibility = seen(camera, QUAD, SPLIT)
    world = join_objects([(QUAD, np.array(SPLIT, np.int32))])
    rows = fragment_rows(visibility.face_ids, world, (0, HEIGHT), side=1)
    affine, _, _ = weights_of(visibility, camera, QUAD, SPLIT, affine=True)
    correct, _, _ = weights_of(visibility, camera, QUAD, SPLIT)
    x, y = rows.places.T.astype(np.float64)
    for face in 0, 1:
        own = rows.faces == face
        system = np.stack([x[own], y[own], np.ones(own.sum())], axis=1)
        for k in range(2):
            fit, *_ = np.linalg.lstsq(system, affine[own, k], rcond=None)
            inside = ((affine[own] > 0).all(axis=1)) & (affine[own].sum(axis=1) < 1)
            np.testing.assert_allclose((system @ fit)[inside], affine[own, k][inside], atol=2e-3)
    assert np.abs(affine - correct).max() > 0.05
