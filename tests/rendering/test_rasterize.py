import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane
from texbake.rendering.camera import Camera
from texbake.rendering.fragments import fragment_rows, weights_at
from texbake.rendering.options import RenderOptions
from texbake.rendering.rasterize import (
    BAND_ROWS,
    CULL_BACK,
    SHOW_BACK,
    SKIP,
    SUBPIXELS,
    VisibilityBuffer,
    Window,
    join_objects,
    rasterize,
    rasterize_scanlines,
)

# Clip space is (x, y) of the positions as they are, in front of the camera, z the depth itself.
FLAT = np.eye(4)


def drawn(positions, faces, matrix, width, height, back_faces="cull", **options):
    world = join_objects([(np.asarray(positions, np.float64), np.asarray(faces, np.int32))])
    modes = np.array([SHOW_BACK if back_faces == "show" else CULL_BACK], np.uint8)
    return rasterize(world, matrix, width, height, modes=modes, **options)


def from_grid(points, width, height, depth=0.5):
    """Positions that FLAT brings to these columns and rows in 1/256 of a sample, exactly."""
    columns, rows = np.asarray(points, np.float64).T / SUBPIXELS
    z = np.broadcast_to(depth, columns.shape)
    # Exact where width and height are powers of two.
    return np.stack([2 * columns / width - 1, 1 - 2 * rows / height, z], axis=1)


def owned(points, width, height):
    """Which samples lie in a triangle on the grid.

    Independent of edge biases: the sample is moved right by an infinitesimal and down by an
    infinitesimally smaller one, then it lies on no edge; what then is inside is just what the
    top-left rule owns.
    """
    a, b, c = (tuple(int(x) for x in point) for point in points)
    turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if turn < 0:
        b, c = c, b
    y, x = np.mgrid[:height, :width] * SUBPIXELS + SUBPIXELS // 2
    inside = np.full((height, width), turn != 0)
    for p, q in (a, b), (b, c), (c, a):
        side = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
        inside &= (side > 0) | ((side == 0) & ((p[1] - q[1], q[0] - p[0]) > (0, 0)))
    return inside


def flat_visibility(points, faces, width, height, **options):
    return drawn(
        from_grid(points, width, height), np.asarray(faces, np.int32), FLAT, width, height,
        back_faces="show", **options,
    )  # fmt: skip


# Half sample steps, so that many corners and edges run through samples; off the screen too; wide
# and narrow triangles, for both ways of finding the samples of a row.
half_samples = st.integers(-40, 104).map(lambda i: i * SUBPIXELS // 2)
anywhere = st.integers(-10 * SUBPIXELS, 42 * SUBPIXELS)
corner = st.tuples(half_samples | anywhere, half_samples | anywhere)


@settings(max_examples=200)
@given(st.tuples(corner, corner, corner))
def test_a_triangle_owns_the_samples_of_the_top_left_rule(points):
    visibility = flat_visibility(points, [[0, 1, 2]], 32, 32)
    np.testing.assert_array_equal(visibility.face_ids == 0, owned(points, 32, 32))


@pytest.mark.parametrize("direction", range(7))
def test_a_closed_mesh_shows_front_and_back_alike(direction):
    # A ray that enters a closed surface leaves it, and coverage is exact: with culling or without,
    # and from inside out, the same samples are covered.
    mesh = icosphere(3)
    options = RenderOptions(view=(51.0 * direction, -80.0 + 26.0 * direction))
    matrix = Camera.framing(mesh, options=options).clip_from_world(1.5)
    front, both, back = (
        drawn(mesh.positions, faces, matrix, 300, 200, back_faces=back_faces).face_ids >= 0
        for faces, back_faces in (
            (mesh.faces, "cull"),
            (mesh.faces, "show"),
            (np.ascontiguousarray(mesh.faces[:, ::-1]), "cull"),
        )
    )
    assert front.sum() > 10_000
    np.testing.assert_array_equal(front, both)
    np.testing.assert_array_equal(front, back)
    # Convex: every row is one run without a hole.
    assert (np.count_nonzero(np.diff(front.astype(int), axis=1), axis=1) <= 2).all()


def test_two_planes_that_cross_are_parted_where_they_cross():
    # Depths 0.25 + 0.5 s and 0.5 along the columns: equal in the middle of the screen.
    points = np.array([[0, 0], [0, 64], [64, 0], [64, 64]] * 2) * SUBPIXELS
    positions = from_grid(points, 64, 64, depth=np.array([0.25, 0.25, 0.75, 0.75] + [0.5] * 4))
    faces = np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]], np.int32)
    ids = drawn(positions, faces, FLAT, 64, 64).face_ids
    assert (ids[:, :32] >= 2).all() and (ids[:, 32:] < 2).all()


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_of_equal_depths_the_lower_index_is_seen(order):
    mesh = icosphere(2)
    matrix = Camera.framing(mesh).clip_from_world(1.0)
    # Four copies of each face, side by side in one list and mixed in another.
    copies = np.concatenate([np.roll(mesh.faces, 3 * k, axis=0) for k in order])
    visibility = drawn(mesh.positions, copies, matrix, 128, 128)
    alone = drawn(mesh.positions, copies[: mesh.n_faces], matrix, 128, 128)
    np.testing.assert_array_equal(visibility.face_ids, alone.face_ids)
    np.testing.assert_array_equal(visibility.depths, alone.depths)


def test_every_number_of_threads_gives_the_same_bytes():
    # More faces than a chunk, more rows than a band, and a camera inside: clipping as well.
    mesh = grid_sphere(200, 200)
    options = RenderOptions(view=(10.0, 20.0, 0.9))
    matrix = Camera.framing(mesh, options=options).clip_from_world(1.0)
    shown = [
        drawn(mesh.positions, mesh.faces, matrix, 150, 150, back_faces="show", threads=threads)
        for threads in (1, 2, 5)
    ]
    assert (shown[0].face_ids >= 0).mean() > 0.9
    for name in "face_ids", "depths":
        first, *others = (getattr(visibility, name).tobytes() for visibility in shown)
        assert all(other == first for other in others), name


def test_triangles_without_area_are_not_seen():
    points = np.array([[0, 0], [0, 32], [32, 32], [32, 0], [16, 16], [16, 16]]) * SUBPIXELS
    faces = [[0, 0, 0], [0, 1, 1], [0, 4, 2], [4, 5, 1], [0, 2, 4], [3, 1, 4]]
    visibility = flat_visibility(points, faces, 32, 32)
    assert (visibility.face_ids == -1).all() and not visibility.depths.any()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 2 * BAND_ROWS + 1)])
def test_screens_of_any_shape(size):
    width, height = size
    positions = np.array([[-1, -1, 0.5], [3, -1, 0.5], [-1, 3, 0.5]], np.float64)
    visibility = drawn(positions, np.array([[0, 1, 2]], np.int32), FLAT, width, height)
    assert visibility.face_ids.shape == (height, width)
    assert (visibility.face_ids == 0).all()


def test_each_object_is_skipped_culled_or_shown_whole():
    # Three sheets one behind the other, each of two triangles, wound one way and the other.
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    sheets = [np.concatenate([square, np.full((4, 1), depth)], axis=1) for depth in (0.8, 0.6, 0.4)]
    faces = np.array([[0, 1, 2], [0, 3, 2]], np.int32)
    world = join_objects([(sheet, faces) for sheet in sheets])
    np.testing.assert_array_equal(world.starts, [0, 2, 4, 6])

    def nearest(*modes):
        visibility = rasterize(world, FLAT, 16, 16, modes=np.array(modes, np.uint8))
        return set(np.unique(visibility.face_ids).tolist())

    assert nearest(SHOW_BACK, SHOW_BACK, SHOW_BACK) == {0, 1}
    assert nearest(SKIP, SHOW_BACK, SHOW_BACK) == {2, 3}
    # Half of the first sheet faces away; what is behind it shows there.
    assert nearest(CULL_BACK, SKIP, SHOW_BACK) == {0, 5}
    assert nearest(SKIP, SKIP, CULL_BACK) == {-1, 4}
    assert nearest(SKIP, SKIP, SKIP) == {-1}


@pytest.mark.parametrize("distance", [3.0, 1.05, 0.2])
def test_a_window_shows_what_the_whole_picture_shows_there(distance):
    """Byte for byte, also where triangles are clipped because the camera is close or inside."""
    mesh = icosphere(3)
    camera = Camera.looking_at((0.1, 0.3, distance), (0.5, 0.0, 0.0), fov=1.0, near=0.01)
    matrix = camera.clip_from_world(331 / 217)
    whole = drawn(mesh.positions, mesh.faces, matrix, 331, 217, "show")
    assert np.count_nonzero(whole.face_ids >= 0) > 1000
    for top, bottom, left, right in (0, 217, 0, 331), (7, 8, 5, 300), (33, 150, 101, 203):
        window = Window(top, bottom, left, right)
        part = drawn(mesh.positions, mesh.faces, matrix, 331, 217, "show", window=window)
        expected = whole.face_ids[top:bottom, left:right]
        np.testing.assert_array_equal(part.face_ids, expected)
        assert part.depths.tobytes() == whole.depths[top:bottom, left:right].tobytes()


def test_layers_are_peeled_from_front_to_back():
    mesh = icosphere(2)
    options = RenderOptions(view=(10.0, 20.0))
    matrix = Camera.framing(mesh, options=options).clip_from_world(1.0)
    shown = {"modes": np.array([SHOW_BACK], np.uint8)}
    world = join_objects([(mesh.positions, mesh.faces)])
    nothing = drawn(mesh.positions, mesh.faces[:1, [0, 0, 0]], matrix, 64, 64)
    first = rasterize(world, matrix, 64, 64, **shown)
    second = rasterize(world, matrix, 64, 64, behind=first, before=nothing, **shown)
    third = rasterize(world, matrix, 64, 64, behind=second, before=nothing, **shown)
    front = drawn(mesh.positions, mesh.faces, matrix, 64, 64)
    back = drawn(mesh.positions, mesh.faces[:, ::-1], matrix, 64, 64)
    # A closed convex surface has two layers: its near and its far side.
    np.testing.assert_array_equal(first.face_ids, front.face_ids)
    np.testing.assert_array_equal(second.face_ids, back.face_ids)
    assert (third.face_ids == -1).all()
    # Of two in the same place the lower index comes first, then the other; none is lost.
    twice = join_objects([(mesh.positions, np.concatenate([mesh.faces, mesh.faces]))])
    near = rasterize(twice, matrix, 64, 64, **shown)
    again = rasterize(twice, matrix, 64, 64, behind=near, before=nothing, **shown)
    covered = front.face_ids >= 0
    np.testing.assert_array_equal(again.face_ids[covered], near.face_ids[covered] + mesh.n_faces)
    # And nothing behind a last surface.
    assert (
        rasterize(world, matrix, 64, 64, behind=nothing_near(first), before=first, **shown).face_ids
        == -1
    ).all()


def nothing_near(visibility):
    """A layer before everything: nearer than the near plane."""
    return VisibilityBuffer(
        np.full_like(visibility.face_ids, -1), np.full_like(visibility.depths, 2.0)
    )


# The classical rasterizer against the one that evaluates everything again at each sample.
WIDTH, HEIGHT = 200, 150


def both(mesh, view, mode, fov=35.0):
    options = RenderOptions(view=view, fov=fov)
    matrix = Camera.framing(mesh, options=options).clip_from_world(WIDTH / HEIGHT)
    world = join_objects([(mesh.positions, mesh.faces)])
    modes = np.array([mode], np.uint8)
    expected = rasterize(world, matrix, WIDTH, HEIGHT, modes=modes)
    visibility, weights = rasterize_scanlines(world, matrix, WIDTH, HEIGHT, modes=modes)
    rows = fragment_rows(expected.face_ids, world, (0, HEIGHT), side=1)
    computed, _, _ = weights_at(world, matrix, WIDTH, HEIGHT, rows.faces, rows.places)
    return expected, visibility, weights, computed


@pytest.mark.parametrize("mode", [CULL_BACK, SHOW_BACK])
@pytest.mark.parametrize("view", [(0.0, 0.0), (33.0, 21.0), (200.0, -60.0), (20.0, 5.0, 0.3)])
@pytest.mark.parametrize("mesh", [cube(), icosphere(3), grid_sphere(40, 60)], ids=lambda m: m.name)
def test_both_rasterizers_see_the_same(mesh, view, mode):
    expected, visibility, weights, computed = both(mesh, view, mode)
    covered = expected.face_ids >= 0
    # Which samples are covered is decided by whole numbers in both.
    np.testing.assert_array_equal(visibility.face_ids >= 0, covered)
    same = visibility.face_ids[covered] == expected.face_ids[covered]
    # Where triangles meet in front of one another depths may round differently.
    assert same.size == 0 or same.mean() > 0.999
    np.testing.assert_allclose(visibility.depths[covered], expected.depths[covered], rtol=1e-5)
    # Both step in float64. One clamps weights beyond an edge to 0 and shares out the rest, which
    # for needles thinner than a step of the grid (at the poles) is all there is of them.
    apart = np.abs(weights[covered][same] - computed[same])
    assert apart.size == 0 or np.quantile(apart, 0.999) < 0.02


def test_a_plane_to_the_horizon_is_correct_in_perspective():
    mesh = plane(1, 1)
    _, visibility, weights, computed = both(mesh, (30.0, 25.0, 0.9), SHOW_BACK)
    covered = visibility.face_ids >= 0
    assert covered.sum() > 5000
    # Two large triangles: 1e-9 is what rounding gathers over the longest span.
    inside = (computed.min(axis=1) > 1e-6) & (computed.sum(axis=1) < 1 - 1e-6)
    assert np.abs(weights[covered] - computed)[inside].max() < 1e-9


SCREEN_W, SCREEN_H = 160, 120


def camera_at(eye, toward, near=1e-3):
    return Camera.looking_at(eye, np.add(eye, toward), fov=1.0, near=near)


def rays(camera):
    """(H, W, 3) directions through the centers of the samples, from the camera's axes alone."""
    columns, rows = np.meshgrid(np.arange(SCREEN_W) + 0.5, np.arange(SCREEN_H) + 0.5)
    tall = np.tan(camera.fov / 2)
    x = (2 * columns / SCREEN_W - 1) * tall * SCREEN_W / SCREEN_H
    y = (1 - 2 * rows / SCREEN_H) * tall
    right, up, back = camera.axes
    return x[..., None] * right + y[..., None] * up - back


def seen(camera, positions, faces, back_faces="cull"):
    matrix = camera.clip_from_world(SCREEN_W / SCREEN_H)
    return drawn(positions, faces, matrix, SCREEN_W, SCREEN_H, back_faces)


def weights_of(visibility, camera, positions, faces, **options):
    """Weights, sides and changes of the covered samples, each a fragment of its own."""
    world = join_objects([(np.asarray(positions, np.float64), np.asarray(faces, np.int32))])
    rows = fragment_rows(visibility.face_ids, world, (0, SCREEN_H), side=1)
    np.testing.assert_array_equal(rows.faces, visibility.face_ids[visibility.face_ids >= 0])
    matrix = camera.clip_from_world(SCREEN_W / SCREEN_H)
    return weights_at(world, matrix, SCREEN_W, SCREEN_H, rows.faces, rows.places, **options)


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


@pytest.mark.parametrize("triangle", [
    [[-1, -1, 1], [1, -1, 1], [0, 1, 1]],  # behind
    [[-1, -1, 0], [1, -1, 0], [0, 1, 0]],  # in the plane of the eye
    [[-1, -1, -0.05], [1, -1, -0.05], [0, 1, -0.05]],  # before the near plane
    [[1e9, 0, -1], [1e9, 1, -1], [1e9, 0, -2]],  # beside
    [[1e308, 0, -1e308], [0, 1e308, -1e308], [-1e308, 0, 1e308]],  # beyond float64
])  # fmt: skip
def test_nothing_is_seen_of_what_is_not_in_front(triangle):
    camera = camera_at((0, 0, 0), (0, 0, -1), near=0.1)
    for face in [0, 1, 2], [2, 1, 0]:
        assert (seen(camera, triangle, [face], back_faces="show").face_ids == -1).all()


def test_a_camera_inside_a_closed_mesh_sees_it_all_around():
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
    rows = fragment_rows(visibility.face_ids, world, (0, SCREEN_H), side=1)
    inside = (rows.places > 20).all(axis=1) & (rows.places < (140, 100)).all(axis=1)
    places = rows.places[inside]
    assert len(places) > 1000

    def weights(step):
        moved = (places + np.float32(step)).astype(np.float32)
        return weights_at(
            world, camera.clip_from_world(SCREEN_W / SCREEN_H), SCREEN_W, SCREEN_H,
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
    rows = fragment_rows(visibility.face_ids, world, (0, SCREEN_H), side=1)
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
