"""Skins, morph targets, animations, cameras and lights of glTF files go through."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from tests.character import AXLE, BODY, WHEEL, character, posed
from texbake.errors import FileFormatError, MeshError, heard_warnings
from texbake.mesh.compose import excerpt, join_parts, transformed
from texbake.mesh.deformation import Deformation, Morph, largest_weights
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.options import RepairOptions, SimplifyOptions, TransformOptions
from texbake.mesh.repair import repair
from texbake.mesh.rig import inverse, read_rig, rotation_matrices, with_poses
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
        made = [json.dumps(each.content[key], sort_keys=True) for each in (rig, given)]
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
    if options:
        assert names[7] == "transform" and content["scenes"][0]["nodes"] == [7]
        poses = [with_poses(read_mesh(p), read_rig(p)).deformation.poses
                 for p in (path, tmp_path / "b.glb")]  # fmt: skip
        shapes = (before.positions, *poses[0]), (after.positions, *poses[1])
        for here, there in zip(*shapes, strict=True):
            turned = 3.0 * here[before.faces][..., [0, 2, 1]] * [1, 1, -1]
            np.testing.assert_allclose(there[after.faces], turned, atol=1e-5)
        return
    assert np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.faces, before.faces)
    for share in (0.0, 0.5, 1.0):
        np.testing.assert_allclose(corners_at(after, share), corners_at(before, share), atol=1e-6)


@pytest.mark.parametrize("quantize", [False, True])
def test_objects_that_nodes_cannot_hold_stay_in_their_place(tmp_path, quantize):
    mesh, rig = character()
    nodes = [dict(node) for node in rig.content["nodes"]]
    nodes[BODY]["translation"] = [5, 0, 0]  # a skinned mesh ignores it
    flat = np.diag([1.0, 1.0, 0.0, 1.0])
    wheel = replace(rig.objects[WHEEL], matrix=flat)
    rig = replace(rig, content=rig.content | {"nodes": nodes},
                  objects=rig.objects | {WHEEL: wheel})  # fmt: skip
    lines = []
    with heard_warnings(lines.append):
        write_mesh(mesh.replace(deformation=None), tmp_path / "a.glb", rig=rig, quantize=quantize)
    assert len(lines) == 2 and "body" in lines[0] and "wheel" in lines[1]
    made = read_mesh(tmp_path / "a.glb")
    atol = 1e-4 if quantize else 1e-7
    np.testing.assert_allclose(made.positions[made.faces], mesh.positions[mesh.faces], atol=atol)
    assert len(document(tmp_path / "a.glb")["scenes"][0]["nodes"]) == 3


@pytest.mark.parametrize("scale", [1.0, 1e-30, 1e30])
def test_only_maps_that_flatten_have_no_inverse(scale):
    turn = rotation_matrices(np.array([[0.1, 0.2, 0.3, 0.9]]))[0]
    matrix = np.eye(4)
    matrix[:3, :3] = scale * turn * [1.0, 1e-3, 1e3]
    np.testing.assert_allclose(inverse(matrix) @ matrix, np.eye(4), atol=1e-6)
    matrix[:3, :3] = scale * np.diag([1.0, 0.0, 1.0]) @ turn
    assert inverse(matrix) is None


def edited(path, change):
    data, content = path.read_bytes(), document(path)
    change(content)
    (n_text,) = struct.unpack("<I", data[12:16])
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + n_text :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path.write_bytes(head + text + rest)


def _animation(content):
    return content["animations"][0]


def _attributes(content):
    return content["meshes"][0]["primitives"][0]["attributes"]


DAMAGES = {
    "joints outside the scene": lambda c: c["skins"][0].update(joints=[1, 99]),
    "few matrices": lambda c: c["skins"][0].update(joints=[1, 2, 4]),
    "joints beyond the skin": lambda c: c["skins"][0].update(joints=[1]),
    "no skin": lambda c: c.update(skins=7),
    "joints of another length": lambda c: _attributes(c).update(
        JOINTS_0=c["meshes"][1]["primitives"][0]["attributes"]["POSITION"]
    ),
    "targets": lambda c: c["meshes"][0]["primitives"][0].update(targets="abc"),
    "target of another length": lambda c: c["meshes"][0]["primitives"][0]["targets"][0].update(
        POSITION=c["meshes"][1]["primitives"][0]["attributes"]["POSITION"]
    ),
    "path": lambda c: [
        each["target"].update(path=[each["target"]["path"]]) for each in _animation(c)["channels"]
    ],
    "interpolation": lambda c: [
        each.update(interpolation={"a": 1}) for each in _animation(c)["samplers"]
    ],
    "channels": lambda c: _animation(c).update(channels="abc"),
    "samplers": lambda c: _animation(c).update(samplers=[]),
    "lights": lambda c: c["extensions"]["KHR_lights_punctual"].update(lights=[{"type": "x"}]),
    "light of a node": lambda c: c["nodes"][6].update(extensions={"KHR_lights_punctual": [7]}),
    "camera": lambda c: c["cameras"][0].update(type="fisheye"),
    "weights of a node": lambda c: c["nodes"][3].update(weights=[0.5, "a"]),
    "weights of a mesh": lambda c: c["meshes"][0].update(weights="abc"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_left_out(path, tmp_path, damage):
    before = read_mesh(path)
    edited(path, DAMAGES[damage])
    lines = []
    with heard_warnings(lines.append):
        transform_file(path, tmp_path / "b.glb")
    is_silent = damage.startswith("weights") or damage in ("targets", "light of a node", "no skin")
    assert is_silent or any("left out" in line for line in lines)
    with heard_warnings(lambda line: pytest.fail(line)):
        after, rig = read_mesh(tmp_path / "b.glb"), read_rig(tmp_path / "b.glb")
    for name in ("body", "wheel"):  # one at the root of the scene comes last
        here, there = (
            m.positions[m.faces[m.face_groups == m.group_names.index(name)]]
            for m in (before, after)
        )
        np.testing.assert_allclose(there, here, atol=1e-6)
    assert all("weights" not in item.fields for item in rig.objects.values())


def test_targets_that_repeat_an_array_are_bounded(path):
    def change(content):
        primitive = content["meshes"][0]["primitives"][0]
        primitive["targets"] *= 2000

    edited(path, change)
    with pytest.raises(FileFormatError, match="--max-triangles"):
        read_mesh(path)


def test_extensions_of_cameras_and_lights_are_left_out(path, tmp_path):
    def change(content):
        content["cameras"][0]["extensions"] = content["cameras"][0]["perspective"][
            "extensions"
        ] = {}
        content["extensions"]["KHR_lights_punctual"]["lights"][0]["extensions"] = {}

    edited(path, change)
    transform_file(path, tmp_path / "b.glb")
    text = json.dumps(document(tmp_path / "b.glb"))
    assert text.count('"extensions"') == 2  # of the file and of the node of the light


def test_an_animated_node_has_no_matrix(path, tmp_path):
    def change(content):
        content["nodes"][4]["matrix"] = np.eye(4).ravel().tolist()
        del content["nodes"][4]["translation"]

    edited(path, change)
    transform_file(path, tmp_path / "b.glb")
    assert "matrix" not in document(tmp_path / "b.glb")["nodes"][4]


def test_joints_without_weight_and_their_order_do_not_split_vertices(tmp_path):
    mesh, rig = character()
    write_mesh(mesh, tmp_path / "a.glb", rig=rig)
    data, content = bytearray((tmp_path / "a.glb").read_bytes()), document(tmp_path / "a.glb")
    attributes, start = _attributes(content), 28 + struct.unpack("<I", bytes(data[12:16]))[0]
    views = [content["bufferViews"][content["accessors"][attributes[name]]["bufferView"]]
             for name in ("JOINTS_0", "WEIGHTS_0")]  # fmt: skip
    n = content["accessors"][attributes["JOINTS_0"]]["count"]
    joints, weights = (
        np.frombuffer(data, dtype, 4 * n, start + view["byteOffset"]).reshape(n, 4)
        for dtype, view in zip((np.uint8, np.float32), views, strict=True)
    )
    before = read_mesh(tmp_path / "a.glb").n_vertices
    joints[::2], weights[::2] = joints[::2, ::-1].copy(), weights[::2, ::-1].copy()
    joints[(weights == 0.0) & (np.arange(n) % 3 == 0)[:, None]] = 1
    (tmp_path / "a.glb").write_bytes(data)
    assert read_mesh(tmp_path / "a.glb").n_vertices == before


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


def test_deformations_are_checked_and_read_only():
    joints, weights = np.zeros((3, 2), np.int32), np.zeros((3, 2))
    sound = Morph(np.array([0, 2], np.int32), np.ones((2, 3)))
    made = Deformation(joints, weights, (sound,))
    for array in (made.joints, made.weights, made.poses, sound.vertices, sound.displacements):
        assert not array.flags.writeable
    with pytest.raises(MeshError, match="joints and weights"):
        Deformation(joints, weights[:2])
    with pytest.raises(MeshError, match="beyond the 3"):
        Deformation(joints, weights, (Morph(np.array([3], np.int32), np.ones((1, 3))),))
    with pytest.raises(MeshError, match="poses"):
        Deformation(joints, weights, poses=np.zeros((1, 2, 3)))
    with pytest.raises(MeshError, match="differ in length"):
        Morph(np.array([0], np.int32), np.ones((2, 3)))


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


def test_best_is_as_close_as_fast_in_all_poses():
    mesh, rig = character()

    def distance(quality):
        low = simplify(with_poses(mesh, rig), 300, quality=quality)
        return sum(
            surface_distance(
                mesh.replace(positions=posed(mesh, None, share)),
                low.replace(positions=posed(low, None, share), deformation=None),
            ).rms
            for share in (0.0, 0.25, 0.5, 0.75, 1.0)
        )

    assert distance("best") <= 1.01 * distance("fast")


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


def test_a_subdivided_character_moves_only_what_it_shows(path, tmp_path):
    lines = []
    with heard_warnings(lines.append):
        transform_file(path, tmp_path / "b.glb", TransformOptions(subdivide=1))
    assert sum("skin" in line for line in lines) == 1
    made = document(tmp_path / "b.glb")
    (wave,) = made["animations"]
    assert [channel["target"]["node"] for channel in wave["channels"]] == [AXLE]
    assert "skins" not in made and "children" in made["nodes"][AXLE]
    used = {value for each in made["meshes"] for value in json_numbers(each)}
    used |= {value for sampler in wave["samplers"] for value in json_numbers(sampler)}
    assert used >= set(range(len(made["accessors"])))


def json_numbers(value):
    if isinstance(value, dict | list):
        items = value.values() if isinstance(value, dict) else value
        return [number for item in items for number in json_numbers(item)]
    return [value] if isinstance(value, int) else []


def test_skins_that_no_node_uses_are_left_out(tmp_path):
    mesh, rig = character()
    skin = rig.content["skins"][0]
    content = {**rig.content, "skins": [{**skin, "name": "unused"}, skin]}
    content["nodes"] = [
        {**node, "skin": 1} if "skin" in node else node for node in rig.content["nodes"]
    ]
    for skins in (rig, replace(rig, content=content)):
        write_mesh(mesh, tmp_path / "a.glb", rig=skins)
        (one,) = document(tmp_path / "a.glb")["skins"]
        assert "name" not in one
