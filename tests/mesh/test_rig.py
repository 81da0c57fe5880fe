"""Skins, morph targets, animations, cameras and lights of glTF files go through."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from tests.character import BODY, WHEEL, character, posed
from texbake.mesh.compose import excerpt, join_parts, transformed
from texbake.mesh.deformation import largest_weights
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.options import RepairOptions, SimplifyOptions, TransformOptions
from texbake.mesh.poses import with_poses
from texbake.mesh.repair import repair
from texbake.mesh.rig import read_rig
from texbake.mesh.simplify import simplify
from texbake.verbs.meshes import transform_file
from texbake.verbs.simplify import simplify_file


def document(path):
    """The JSON of a GLB file."""
    data = path.read_bytes()
    return json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])


@pytest.fixture
def path(tmp_path):
    mesh, rig = character()
    write_mesh(mesh, tmp_path / "a.glb", rig=rig)
    return tmp_path / "a.glb"


def corners_at(mesh, share):
    return posed(mesh, None, share)[mesh.faces]


def test_a_character_is_read_as_it_was_written(path):
    (mesh, rig), (before, given) = (read_mesh(path), read_rig(path)), character()
    assert mesh.group_objects == (BODY, WHEEL) and rig.has_morph_normals
    assert rig.content["nodes"] == given.content["nodes"]
    for share in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(corners_at(mesh, share), corners_at(before, share), atol=1e-6)
    for key in ("skins", "cameras", "extensions", "scenes"):
        made = json.dumps(rig.content[key]), json.dumps(given.content[key])
        assert key == "skins" or made[0] == made[1]
    (wave,) = rig.content["animations"]
    assert [channel["target"] for channel in wave["channels"]] == [
        channel["target"] for channel in given.content["animations"][0]["channels"]
    ]
    for made, known in zip(
        wave["samplers"], given.content["animations"][0]["samplers"], strict=True
    ):
        for side in ("input", "output"):
            assert np.array_equal(rig.arrays[made[side]], given.arrays[known[side]])


@pytest.mark.parametrize("options", [{}, {"scale": 3.0, "up": "z"}])
def test_convert_keeps_what_moves(path, tmp_path, options):
    result = transform_file(path, tmp_path / "b.glb", TransformOptions(**options))
    assert result.warnings == ()
    before, after = read_mesh(path), read_mesh(tmp_path / "b.glb")
    content = document(tmp_path / "b.glb")
    names = [node["name"] for node in content["nodes"]]
    assert names[:7] == [node["name"] for node in document(path)["nodes"]]
    assert content["meshes"][0]["name"] == "tube"
    assert content["meshes"][0]["extras"]["targetNames"] == ["bulge"]
    if options:  # the skin takes the tube along, so only the wheel moves in the file
        assert names[7] == "transform" and content["scenes"][0]["nodes"] == [7]
        wheel = after.positions[np.unique(after.faces[after.face_groups == 1])]
        given = before.positions[np.unique(before.faces[before.face_groups == 1])]
        turned = 3.0 * given[:, [0, 2, 1]] * [1, 1, -1]
        np.testing.assert_allclose(np.sort(wheel, axis=0), np.sort(turned, axis=0), atol=1e-5)
        return
    assert np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.faces, before.faces)
    for share in (0.0, 0.5, 1.0):
        np.testing.assert_allclose(corners_at(after, share), corners_at(before, share), atol=1e-6)


def test_quantized_positions_leave_moving_parts_as_they_are(tmp_path):
    mesh, rig = character()
    write_mesh(mesh, tmp_path / "a.glb", rig=rig, quantize=True)
    made = read_mesh(tmp_path / "a.glb")
    for share in (0.0, 0.7):
        np.testing.assert_allclose(corners_at(made, share), corners_at(mesh, share), atol=1e-4)


def test_normals_of_a_morph_target_are_those_of_the_displaced_surface(path):
    content = document(path)
    (target,) = content["meshes"][0]["primitives"][0]["targets"]
    assert set(target) == {"POSITION", "NORMAL"}
    assert "sparse" in content["accessors"][target["POSITION"]]  # most rows are zero
    mesh, _ = character()
    morph = mesh.deformation.morphs[0]
    assert len(morph.vertices) < 0.6 * mesh.n_vertices


def test_vertices_that_move_apart_stay_apart(path):
    mesh = read_mesh(path).replace(normals=None, normal_faces=None)
    lips = mesh.replace(
        positions=np.concatenate([mesh.positions, mesh.positions]),
        faces=np.concatenate([mesh.faces, mesh.faces + mesh.n_vertices]),
        face_groups=np.tile(mesh.face_groups, 2),
        deformation=join_parts(
            [mesh, mesh.replace(deformation=None)], "both"
        ).deformation,
    )  # fmt: skip
    merged, _ = repair(lips, RepairOptions(duplicates=False, winding=False))
    assert merged.n_vertices == lips.n_vertices
    still = lips.replace(deformation=None)
    assert repair(still, RepairOptions(winding=False))[0].n_vertices == mesh.n_vertices


def test_cutting_moving_and_joining_carry_along_what_moves():
    mesh, _ = character()
    chosen = mesh.face_groups == 0
    part = excerpt(mesh, chosen)
    np.testing.assert_allclose(corners_at(part, 0.6), corners_at(mesh, 0.6)[chosen])
    both = join_parts([part, part], "both")
    np.testing.assert_allclose(corners_at(both, 0.6)[: part.n_faces], corners_at(part, 0.6))
    matrix = np.diag([2.0, 2.0, -2.0, 1.0])
    moved = transformed(part, matrix).deformation.morphs[0].displacements
    assert np.array_equal(moved, part.deformation.morphs[0].displacements * [2, 2, -2])


def test_mixing_vertices_keeps_the_largest_weights():
    mesh, _ = character()
    deformation = mesh.deformation
    mixed = deformation.mixed(np.array([[0, 900, 984]]), np.array([[0.25, 0.25, 0.5]]))
    assert mixed.joints.shape == (1, 2) and mixed.weights.sum() == 1.0
    assert set(mixed.joints[0]) <= set(deformation.joints[[0, 900, 984]].ravel())
    rows = deformation.morphs[0].rows(mesh.n_vertices)[[0, 900, 984]]
    np.testing.assert_allclose(mixed.morphs[0].rows(1)[0], [0.25, 0.25, 0.5] @ rows)
    joints, weights = largest_weights(
        np.array([[3, 1, 3, 2]], np.int32), np.array([[0.1, 0.3, 0.4, 0.2]]), 2
    )
    assert joints.tolist() == [[3, 1]]
    np.testing.assert_allclose(weights, [[0.625, 0.375]])
    nothing = largest_weights(np.array([[3, 1]], np.int32), np.zeros((1, 2)), 2)
    assert not nothing[0].any() and not nothing[1].any()


@pytest.mark.parametrize("quality", ["fast", "best"])
def test_a_simplified_character_bends_as_before(path, tmp_path, quality):
    mesh = read_mesh(path)
    options = SimplifyOptions(n_faces=mesh.n_faces // 3, quality=quality)
    (result,) = simplify_file(path, tmp_path / "b.glb", options).warnings or ("",)
    assert "written without" not in result
    made, content = read_mesh(tmp_path / "b.glb"), document(tmp_path / "b.glb")
    assert [node["name"] for node in content["nodes"]] == [
        node["name"] for node in document(path)["nodes"]
    ]
    assert made.n_faces <= mesh.n_faces // 3
    for share in (0.0, 0.5, 1.0):
        before = mesh.replace(positions=posed(mesh, None, share))
        after = made.replace(positions=posed(made, None, share))
        # A chord of a circle of this radius, at as many edges around as are left, is as far off.
        assert surface_distance(before, after).max < 0.03
    still = simplify(mesh, mesh.n_faces // 3, quality=quality)
    bent = [m.replace(positions=posed(m, None, 1.0)) for m in (mesh, still, made)]
    assert surface_distance(bent[0], bent[2]).rms < surface_distance(bent[0], bent[1]).rms


def test_poses_are_those_of_the_animation():
    mesh, rig = character()
    poses = with_poses(mesh, rig).deformation.poses
    assert len(poses) == 5  # four of the animation, and the morph target
    for pose, share in zip(poses, (0.25, 0.5, 0.75, 1.0), strict=False):
        np.testing.assert_allclose(pose, posed(mesh, rig, share), atol=0.02)
    np.testing.assert_allclose(
        poses[4], mesh.positions + mesh.deformation.morphs[0].rows(mesh.n_vertices), atol=1e-6
    )
    content = {key: value for key, value in rig.content.items() if key != "animations"}
    bent = with_poses(mesh, replace(rig, content=content)).deformation.poses
    assert len(bent) == 4  # three turns of all joints, and the morph target
    assert np.abs(bent[0] - mesh.positions).max() > 0.3
