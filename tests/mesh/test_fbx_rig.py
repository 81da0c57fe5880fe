"""Skins, shapes and animations of FBX files, as nodes and joints of glTF."""

import numpy as np
import pytest

from tests.fbx_writer import CM, POINTS, moving_scene, scene, shape, written
from texbake.errors import heard_warnings
from texbake.mesh.files import read_mesh
from texbake.mesh.files.fbx_curves import Curve, read_curve
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.rig import decomposed, read_rig, with_poses
from texbake.verbs.meshes import transform_file

TURN = np.array([[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_a_skin_a_shape_and_an_animation_are_read(tmp_path, form):
    path = tmp_path / "a.fbx"
    path.write_bytes(written(moving_scene(), 7400, form))
    lines = []
    with heard_warnings(lines.append):
        mesh, rig = read_mesh(path), read_rig(path)
    assert lines == []
    assert [node["name"] for node in rig.nodes] == ["axes", "wall", "bone", "door"]
    wall, door = (mesh.deformation.of(rows) for rows in (np.arange(7), np.arange(7, 14)))
    bound = np.where(wall.joints == 2, wall.weights, 0.0).sum(axis=1)
    assert (wall.joints[bound == 0, 0] == 1).all()  # the model itself moves the others
    assert bound.tolist() == [0, 1, 1, 0, 0, 1, 0]  # weights are normalized
    assert (door.joints[:, 0] == 3).all() and (door.weights[:, 0] == 1.0).all()
    moves = wall.morphs[0].rows(7)
    np.testing.assert_allclose(moves[[0, 6], 2], [CM, 2 * CM])
    assert rig.objects[0].fields["extras"]["targetNames"] == ["bump"]
    assert rig.objects[0].fields["weights"] == [0.25]
    (animation,) = rig.content["animations"]
    assert animation["name"] == "turn"
    targets = {(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]}
    assert {(2, "rotation"), (3, "rotation"), (1, "weights")} <= targets
    # At the end, the bone has turned what it moves by a quarter about (1, 0).
    pose = with_poses(mesh, rig).deformation.poses[3] / CM
    given = np.concatenate([POINTS, np.ones((7, 1))], axis=1)
    given[[0, 6], 2] += np.array([1.0, 2.0]) * 0.9  # the curve of the turn sets 90 % as well
    about = given - np.array([1.0, 0, 0, 0])
    turned = np.where(bound[:, None] > 0.0, about @ TURN.T, given)[:, :3]
    np.testing.assert_allclose(pose[:7], turned + np.array([0, 0, 5.0]), atol=1e-5)
    np.testing.assert_allclose(pose[7:], (POINTS @ TURN[:3, :3].T), atol=1e-5)


def test_an_fbx_character_becomes_a_glb_file(tmp_path):
    path = tmp_path / "a.fbx"
    path.write_bytes(written(moving_scene(), 7400, "binary"))
    (warning,) = transform_file(path, tmp_path / "b.glb").warnings
    assert "without" not in warning  # it counts polygons
    before, after = (with_poses(read_mesh(p), read_rig(p)) for p in (path, tmp_path / "b.glb"))
    for here, there in zip(before.deformation.poses, after.deformation.poses, strict=True):
        np.testing.assert_allclose(there[after.faces], here[before.faces], atol=1e-6)


@pytest.mark.parametrize("inherit_type", [0, 1, 2])
@pytest.mark.parametrize("scaling", [[1.0, 3.0, 1.0], [0.0, 0.0, 0.0]])
def test_meshes_stay_where_nodes_would_be_sheared_or_flattened(tmp_path, inherit_type, scaling):
    path, fields = tmp_path / "a.fbx", {"InheritType": [inherit_type]}
    place = {"Lcl Rotation": [0.0, 0.0, 45.0], "Lcl Translation": [1.0, 2.0, 3.0]}
    models = {"top": ({"Lcl Scaling": scaling}, None), "wall": (place | fields, "top")}
    path.write_bytes(written(scene(7400, models=models), 7400, "binary"))
    transform_file(path, tmp_path / "b.glb")
    before, after = read_mesh(path), read_mesh(tmp_path / "b.glb")
    np.testing.assert_allclose(
        after.positions[after.faces], before.positions[before.faces], atol=1e-7
    )
    for node in read_rig(path).nodes[1:]:
        assert "matrix" not in node  # glTF has no shear


def test_objects_keep_their_numbers_where_some_have_no_triangle(tmp_path):
    models = {name: ({"Lcl Translation": [x, 0.0, 0.0]}, None) for x, name in enumerate("abc")}
    nodes = scene(7400, models=models)
    empty = shape(polygons=np.array([0, -2], np.int32))
    nodes[1][2].append(("Geometry", [11, "bad\0\1Geometry", "Mesh"], empty))
    links = [each for each in nodes[2][2] if each[1] != ["OO", 10, 100]]
    nodes[2][2][:] = [*links, ("C", ["OO", 11, 100], [])]
    path = tmp_path / "a.fbx"
    path.write_bytes(written(nodes, 7400, "binary"))
    before = read_mesh(path)
    assert before.group_objects == (1, 2)
    transform_file(path, tmp_path / "b.glb")
    after = read_mesh(tmp_path / "b.glb")
    np.testing.assert_allclose(
        after.positions[after.faces], before.positions[before.faces], atol=1e-7
    )
    made = read_rig(tmp_path / "b.glb")
    assert [made.nodes[item.node]["name"] for item in made.objects.values()] == ["b", "c"]


def test_counts_of_keys_beyond_the_keys_are_harmless():
    n = 4
    fields = {
        "KeyTime": np.arange(n), "KeyValueFloat": np.arange(n, dtype=np.float32),
        "KeyAttrFlags": np.array([2, 4, 8]), "KeyAttrDataFloat": np.zeros(12, np.float32),
        "KeyAttrRefCount": np.array([1, 2**31 - 1, 2**31 - 1]),
    }  # fmt: skip
    node = Node(
        "AnimationCurve", [], [Node(name, rows.tolist(), []) for name, rows in fields.items()]
    )
    assert read_curve(node).flags.tolist() == [2, 4, 4, 4]


def test_curves_hold_go_straight_or_bend():
    times, values = np.array([0.0, 1.0, 3.0]), np.array([1.0, 3.0, 3.0])
    slopes = np.array([[0.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    at = np.array([-1.0, 0.5, 1.0, 2.0, 9.0])
    for flag, middle, late in ((2, 1.0, 3.0), (2 | 0x100, 3.0, 3.0), (4, 2.0, 3.0), (8, 2.0, 3.5)):
        curve = Curve(times, values, np.full(3, flag), slopes)
        expected = [1.0, middle, 3.0, late if flag == 8 else 3.0, 3.0]
        np.testing.assert_allclose(curve.at(at), expected)


def test_matrices_fall_into_translation_rotation_and_scale():
    angles = np.linspace(0.0, 2.0 * np.pi, 9)
    matrices = np.tile(np.eye(4), (9, 1, 1))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(angles)
    matrices[:, 1, 0], matrices[:, 0, 1] = np.sin(angles), -np.sin(angles)
    matrices[:, :3, :3] *= np.array([-2.0, 3.0, 1.0])
    matrices[:, :3, 3] = [1, 2, 3]
    translations, rotations, scales = decomposed(matrices)
    assert (translations == [1, 2, 3]).all()
    np.testing.assert_allclose(scales, np.tile([-2, 3, 1], (9, 1)))
    # The whole turn goes on in small steps, to the opposite quaternion.
    turns = np.stack([np.sin(angles / 2), np.cos(angles / 2)], axis=1) * rotations[0, 3]
    np.testing.assert_allclose(rotations[:, 2:], turns, atol=1e-12)
