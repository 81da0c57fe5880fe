"""Transforms and subdivision: closed forms, their order, and what follows the positions."""

import numpy as np
import pytest

from tests.mesh.test_polygons import polygons_of, prism
from texbake.errors import OptionError, ReadWarning
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.info import mesh_info
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.options import TransformOptions
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.transform import subdivide, transform
from texbake.verbs.meshes import transform_file

BALL = uv_sphere(5, 7)
POINTS = BALL.positions


@pytest.mark.parametrize(("given", "expected"), [
    ({}, POINTS),
    ({"scale": 2.5}, 2.5 * POINTS),
    ({"units": "in"}, 0.0254 * POINTS),
    ({"up": "z"}, POINTS[:, [0, 2, 1]] * (1, 1, -1)),
    ({"rotate": (90.0, 0.0, 0.0)}, POINTS[:, [0, 2, 1]] * (1, -1, 1)),
    ({"rotate": (90.0, 0.0, -90.0)}, POINTS[:, [2, 0, 1]] * (-1, -1, 1)),
    ({"move": (1.0, 2.0, 3.0)}, POINTS + np.arange(1, 4)),
    ({"scale": 2.0, "up": "z", "move": (1.0, 0.0, 0.0)},
     2 * POINTS[:, [0, 2, 1]] * (1, 1, -1) + np.eye(3)[0]),
])  # fmt: skip
def test_positions_have_a_closed_form(given, expected):
    moved = transform(BALL, TransformOptions(**given))
    assert np.array_equal(moved.positions, expected)
    assert np.array_equal(moved.faces, BALL.faces)
    assert np.array_equal(moved.corner_uvs(), BALL.corner_uvs())


def test_a_rotation_there_and_back_is_none():
    there = transform(BALL, TransformOptions(rotate=(0.0, 33.0, 0.0)))
    back = transform(there, TransformOptions(rotate=(0.0, -33.0, 0.0)))
    assert np.abs(back.positions - POINTS).max() < 1e-15
    assert np.abs(there.positions - POINTS).max() > 0.4


def test_flipped_faces_face_the_other_way_with_their_normals():
    ball = BALL.replace(normals=POINTS, normal_faces=BALL.faces)
    flipped = transform(ball, TransformOptions(flip=True))
    assert np.allclose(face_normals(flipped), -face_normals(ball))
    sides = flipped.positions[flipped.faces] * flipped.normals[flipped.normal_faces]
    assert (sides.sum(axis=2) < 0).all()
    again = transform(flipped, TransformOptions(flip=True))
    assert np.array_equal(again.faces, ball.faces)


def test_positions_stay_finite():
    huge = BALL.replace(positions=1e300 * POINTS)
    with pytest.raises(OptionError, match="scale, move: positions would not be finite"):
        transform(huge, TransformOptions(scale=1e10))


BOX = """#usda 1.0
(metersPerUnit = 1
upAxis = "Y")
def Mesh "box" {
    point3f[] points = [(-1,-1,-1),(1,-1,-1),(1,1,-1),(-1,1,-1),(-1,-1,1),(1,-1,1),(1,1,1),(-1,1,1)]
    int[] faceVertexCounts = [4,4,4,4,4,4]
    int[] faceVertexIndices = [3,2,1,0,4,5,6,7,0,1,5,4,1,2,6,5,2,3,7,6,3,0,4,7]
    uniform token subdivisionScheme = "SCHEME"
}
"""


@pytest.fixture
def box(tmp_path):
    (tmp_path / "box.usda").write_text(BOX.replace("SCHEME", "none"))
    return read_mesh(tmp_path / "box.usda")


def quads_of(mesh):
    return mesh.replace(polygon_of=np.arange(mesh.n_faces) // 2)


def test_a_cube_has_its_closed_form(box):
    once = subdivide(box)
    sizes = np.sort(np.abs(once.positions), axis=1)
    np.testing.assert_allclose(sizes[:8], 5 / 9)
    np.testing.assert_allclose(sizes[8:20], [[0, 0.75, 0.75]] * 12)
    np.testing.assert_allclose(sizes[20:], [[0, 0, 1]] * 6)
    assert (np.sign(once.positions[:8]) == box.positions).all()
    # Each corner of a polygon begins its part of it.
    heads = [polygon[0] for polygon in polygons_of(once)]
    assert heads == [v for polygon in polygons_of(box) for v in polygon]


@pytest.mark.parametrize("levels", [1, 3])
def test_a_plane_stays_a_plane_with_its_texture(levels):
    fine = subdivide(quads_of(plane(3, 2)), levels)
    assert fine.n_polygons == 6 * 4**levels
    np.testing.assert_allclose(fine.corner_uvs(), fine.positions[fine.faces][:, :, :2], atol=1e-15)
    low, high = fine.bounds
    assert (low.tolist(), high.tolist()) == ([0, 0, 0], [1, 1, 0])
    steps = fine.positions * (3 * 2**levels, 2 * 2**levels, 1)
    np.testing.assert_allclose(steps, steps.round(), atol=1e-12)


def test_topology_groups_and_sets_stay_and_affine_maps_commute(box):
    mesh = prism(normals=False, sets=True)[0].replace(colors=np.full((14, 3), 0.5))
    fine = subdivide(mesh, 2)
    assert fine.n_polygons == 4 * sum(len(p) for p in polygons_of(mesh))
    assert [g.n_faces for g in mesh_info(fine).groups] == [4 * 20, 4 * 22]
    assert (fine.colors == 0.5).all()
    assert fine.corner_uvs("light").shape == (fine.n_faces, 3, 2)
    matrix = np.array([[2.0, 1, 0], [0, 3, 1], [1, 0, 1]])
    moved = subdivide(mesh.replace(positions=mesh.positions @ matrix), 2)
    np.testing.assert_allclose(moved.positions, fine.positions @ matrix, atol=1e-12)
    assert mesh_info(subdivide(box, 3)).genus == 0
    alone = Mesh(positions=box.positions, faces=[[0, 1, 2]])
    np.testing.assert_array_equal(subdivide(alone).positions[:8], box.positions)


def test_a_file_that_asks_for_it_is_named_and_subdivided(tmp_path):
    source, output = tmp_path / "box.usda", tmp_path / "box.obj"
    source.write_text(BOX.replace("SCHEME", "catmullClark"))
    with pytest.warns(ReadWarning, match="1 subdivision surface is read as its control mesh"):
        done = transform_file(source, output, TransformOptions(subdivide=2))
    assert done.report.n_polygons == 96
    assert 4 * mesh_info(done.report).area < 24 * 2.5  # 24 is that of the control mesh
    write_mesh(done.report, tmp_path / "again.usda")
    assert read_mesh(tmp_path / "again.usda").n_polygons == 96
    with pytest.raises(OptionError, match="subdivide"):
        TransformOptions(subdivide=9)
