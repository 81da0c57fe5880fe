"""Projector mapping: the camera of previews, matrices, and what is not seen."""

import numpy as np
import pytest

from tests.models import flipped, joined, moved
from texbake import Mesh, OptionError, RenderOptions, UnwrapOptions
from texbake.errors import FileFormatError
from texbake.mapping.classical.projector import mostly_hidden, projector, read_matrix
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.triangle_tree import TriangleTree
from texbake.rendering.camera import Camera

# Light along -z onto the unit square; r grows with the distance from the light.
DOWN = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def cast(mesh, **options):
    return projector(mesh, UnwrapOptions(method="projector", **options))


@pytest.mark.parametrize(
    ("camera", "fov"),
    [((0.0, 0.0), 35.0), ((30.0, 20.0), 50.0), ((-200.0, 90.0), 20.0), ((70.0, -30.0, 9.0), 80.0)],
)
def test_the_camera_stands_where_that_of_a_preview_does(camera, fov):
    mesh = moved(icosphere(3), scale=(1.0, 2.0, 0.5), by=(3.0, -2.0, 7.0))
    options = RenderOptions(view=camera, fov=fov, width=100, height=100)
    clip = Camera.framing(mesh, options=options).clip_from_world(1.0)
    points = np.column_stack([mesh.positions, np.ones(mesh.n_vertices)])
    x, y, _, w = (points @ clip.T).T
    found = cast(mesh, camera=camera, fov=fov, unseen="project").corners
    expected = 0.5 + 0.5 * np.stack([x / w, y / w], axis=1)[mesh.faces]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_matrix_agrees_with_numpy(seed):
    rng = np.random.default_rng(seed)
    mesh = icosphere(2)
    matrix = rng.normal(size=(4, 4))
    matrix[3] = [*rng.normal(size=3) * 0.3, 2.0]  # q is above 2 - 0.3 * |normals| for most seeds
    s, t, _, q = (np.column_stack([mesh.positions, np.ones(mesh.n_vertices)]) @ matrix.T).T
    assert q.min() > 0.0
    found = cast(mesh, matrix=tuple(map(tuple, matrix.tolist())), unseen="project").corners
    expected = np.stack([s / q, t / q], axis=1)[mesh.faces]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_constant_q_divides_whatever_its_sign():
    mesh = moved(cube(), scale=0.5, by=0.5)
    for q in (1.0, 4.0, -2.0):
        scaled = tuple(tuple(q * value for value in row) for row in DOWN)
        found = cast(mesh, matrix=scaled)
        assert np.array_equal(found.corners, cast(mesh, matrix=DOWN).corners)
        assert "faces behind the projector" not in found.tallies


def test_faces_of_a_convex_mesh_toward_the_projector_are_seen():
    mesh = icosphere(3)
    distance = 4.0  # all of it is in the picture
    found = cast(mesh, camera=(0.0, 0.0, distance))
    middles = mesh.positions[mesh.faces].mean(axis=1)
    facing = np.einsum("ij,ij->i", face_normals(mesh), (0.0, 0.0, distance) - middles) > 0.0
    assert found.tallies == {"faces turned away": int((~facing).sum())}
    aside = found.corners[..., 0].max(axis=1) <= 0.0
    assert np.array_equal(aside, ~facing)


def test_the_square_that_is_lit_casts_its_shadow_in_perspective():
    # The light is at (1/2, 1/2, 2), so that a square of 1/4 at z = 1 shades one of 1/2 at z = 0.
    before = moved(plane(), scale=(0.25, 0.25, 1.0), by=(0.375, 0.375, 1.0))
    depth = (0.0, 0.0, -1.0, 2.0)
    matrix = ((1.0, 0.0, -0.5, 0.5), (0.0, 1.0, -0.5, 0.5), depth, depth)
    found = cast(joined(plane(8, 8), before), matrix=matrix)
    assert found.tallies == {"faces hidden": 32}  # 4 x 4 squares of 8 x 8


def test_hidden_faces_are_those_that_brute_force_finds():
    rng = np.random.default_rng(5)
    corners = rng.uniform(-0.5, 0.5, (60, 1, 3)) + rng.normal(0.0, 0.15, (60, 3, 3))
    positions = corners.reshape(-1, 3)
    faces = np.arange(180, dtype=np.int32).reshape(-1, 3)
    tree = TriangleTree.build(positions, faces)
    weights = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0
    for seen_from in ([0.3, 0.2, 1.5, 1.0], [0.0, 0.6, 0.8, 0.0], [0.0, 0.0, 0.0, 1.0]):
        eye = np.array(seen_from)
        n_blocked = np.zeros(60)
        for face in range(60):
            for start in weights @ corners[face]:
                along = eye[:3] - eye[3] * start
                for other in range(60):
                    a, b, c = corners[other]
                    k, v, w = np.linalg.solve(np.stack([along, a - b, a - c], axis=1), a - start)
                    inside = v >= 0.0 and w >= 0.0 and v + w <= 1.0
                    if other != face and inside and 0.0 < k < (1.0 if eye[3] else np.inf):
                        n_blocked[face] += 1
                        break
        expected = n_blocked > 2
        assert 0 < expected.sum() < 60
        for threads in (1, 2):
            found = mostly_hidden(tree, np.arange(60), eye, threads=threads)
            assert np.array_equal(found, expected)


def test_r_gives_the_side_from_which_parallel_light_comes():
    up = (*DOWN[:2], (0.0, 0.0, 1.0, 0.0), DOWN[3])
    silent = (*DOWN[:2], (0.0, 0.0, 0.0, 0.0), DOWN[3])
    mirrored = ((-1.0, 0.0, 0.0, 1.0), *DOWN[1:])
    silent_mirrored = (mirrored[0], *silent[1:])
    for matrix, n_away in (
        (DOWN, 0),
        (up, 2),
        (silent, 0),  # from where the picture is not mirrored
        (mirrored, 0),
        (silent_mirrored, 2),
    ):
        assert cast(plane(), matrix=matrix).tallies.get("faces turned away", 0) == n_away


def test_aside_stays_out_of_the_picture_and_project_leaves_all():
    mesh = moved(icosphere(2), scale=3.0, by=0.0)  # larger than the picture
    aside = cast(mesh, matrix=DOWN).corners
    left = aside[..., 0].max(axis=1) <= 0.0
    projected = cast(mesh, matrix=DOWN, unseen="project").corners
    assert np.array_equal(projected, mesh.positions[mesh.faces][..., :2])
    facing = face_normals(mesh)[:, 2] > 0.0
    assert np.array_equal(aside[facing], projected[facing])
    assert np.array_equal(aside[~facing], np.clip(projected[~facing], 0.0, 1.0) - (1.0, 0.0))
    assert left[~facing].all()


def test_a_projector_inside_the_mesh_lights_the_faces_before_it():
    room = flipped(icosphere(3))
    found = cast(room, camera=(0.0, 0.0, 1e-9), fov=90.0)
    assert np.isfinite(found.corners).all()
    behind = (room.positions[:, 2] >= -1e-9)[room.faces].any(axis=1)  # it looks along -z
    assert found.tallies == {"faces behind the projector": int(behind.sum())}
    outside = cast(icosphere(3), camera=(0.0, 0.0, 1e-9), fov=90.0)
    assert sum(outside.tallies.values()) == room.n_faces  # none is lit from its back


def test_corners_in_the_plane_of_the_projector_are_finite():
    sideways = (
        (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0),
    )  # fmt: skip
    found = cast(plane(2, 2), matrix=sideways, unseen="project")  # q = z = 0 everywhere
    assert np.isfinite(found.corners).all()
    assert found.tallies == {"faces behind the projector": 8}


@pytest.mark.parametrize(("matrix", "message"), [
    (((0.0,) * 4,) * 4, "one of its rows s, t and q is 0"),
    ((*DOWN[:1], *DOWN[:1], *DOWN[2:]), "flatten the image to a line"),
    (((1e308, 0.0, 0.0, 0.0), *DOWN[1:3], (0.0, 0.0, 0.0, 1e-308)), "not finite"),
])  # fmt: skip
def test_a_matrix_without_a_picture_is_one_error(matrix, message):
    with pytest.raises(OptionError, match=message):
        cast(plane(), matrix=matrix)


ROWS = ((1.0, 0.0, 0.0, 0.5), (0.0, 1.0, 0.0, 0.5), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, -1.0, 2.0))


@pytest.mark.parametrize("text", [
    "1 0 0 .5\n0 1 0 .5\n0 0 1 0\n0 0 -1 2\n",
    "1,0,0,0.5, 0,1,0,0.5, 0,0,1,0, 0,0,-1,2",
    "# a slide\n1 0 0 .5 # first\r\n0 1 0 5e-1 0 0 1 0\n\n0 0 -1 2",
])  # fmt: skip
def test_sixteen_numbers_row_by_row(text, tmp_path):
    (tmp_path / "m.txt").write_text(text)
    assert read_matrix(tmp_path / "m.txt") == ROWS


def test_a_matrix_of_three_rows_gives_s_t_and_q(tmp_path):
    """The 3 x 4 matrix of a camera places the same coordinates as the 4 x 4 one without its r."""
    three = (ROWS[0], ROWS[1], ROWS[3])
    (tmp_path / "m.txt").write_text("\n".join(" ".join(map(str, row)) for row in three))
    assert read_matrix(tmp_path / "m.txt") == (ROWS[0], ROWS[1], ROWS[3], ROWS[3])
    with pytest.raises(FileFormatError, match="it has 12 words; a matrix needs 16 numbers, row"):
        read_matrix(tmp_path / "m.txt", projector=False)
    whole, short = (cast(plane(3, 3), matrix=matrix) for matrix in (ROWS, three))
    np.testing.assert_array_equal(short.corners, whole.corners)
    with pytest.raises(OptionError, match="4 rows of 4 numbers, or 3"):
        cast(plane(), matrix=ROWS[:2])


@pytest.mark.parametrize(("data", "message"), [
    (b"", "is empty"),
    (b"1 " * 17, "it has 17 words; a matrix needs 16 numbers"),
    (b"nan " * 16, "line 1: 'nan' is not finite"),
    (b"1 1 1 1\n" * 3 + b"1 one 1 1", "line 4: 'one' is not a number"),
    (b"\xff\xfe\x00" * 99, "is not a matrix"),
])  # fmt: skip
def test_anything_else_is_one_error(data, message, tmp_path):
    (tmp_path / "m.txt").write_bytes(data)
    with pytest.raises(FileFormatError, match=message):
        read_matrix(tmp_path / "m.txt")


@pytest.mark.parametrize("first", [0, 1, 2])
def test_a_face_that_the_rays_pass_along_is_turned_away_whatever_its_first_corner(first):
    options = RenderOptions(view=(0.0, 0.0), fov=35.0, width=100, height=100)
    x, y, _, w = Camera.framing(cube(), options=options).clip_from_world(1.0)
    row = tuple(tuple(line.tolist()) for line in (0.5 * (x + w), 0.5 * (y + w), w, w))
    # A plane through the camera, which is off it by rounding alone.
    points = np.array([[0.1, 0.3, 0.0], [0.2, 0.6, 0.1], [0.0, 0.0, 0.3]])
    faces = np.roll([[0, 1, 2]], -first, axis=1).astype(np.int32)
    found = projector(
        Mesh(positions=points, faces=faces),
        UnwrapOptions(method="projector", matrix=row, unseen="aside"),
    )
    assert found.tallies == {"faces turned away": 1}


def test_the_size_of_the_third_row_changes_nothing():
    rows = np.array([[1.0, 0, 0, 0.5], [0, 1.0, 0, 0.5], [0, 0, 1.0, 0], [0, 0, 0, 1.0]])
    mesh = icosphere(1)
    near, far = (
        projector(mesh, UnwrapOptions(method="projector", matrix=tuple(map(tuple, each.tolist()))))
        for each in (rows, rows * [[1.0], [1.0], [1e300], [1.0]])
    )
    np.testing.assert_array_equal(near.corners, far.corners)
