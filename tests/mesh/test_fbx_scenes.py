"""Cameras, lights, layers of animations and in-between shapes of FBX files, as those of glTF."""

import json

import numpy as np
import pytest

from tests.fbx_writer import CM, moving_scene, properties, scene, written
from tests.glb import read_glb
from tests.models import REAL, real
from texbake.mesh.files.fbx_animations import Animation, Layer, Track, full_weights, shape_weights
from texbake.mesh.files.fbx_cameras import read_camera
from texbake.mesh.files.fbx_curves import Curve, read_curve
from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.files.fbx_rig import read_motions
from texbake.mesh.files.fbx_scene import FbxObject, euler_matrices, model_properties, read_scene
from texbake.mesh.rig import node_matrix, read_rig
from texbake.verbs.meshes import transform_file


def with_views(version, values):
    """Nodes of a file with a mesh, and a camera and a light that have some properties."""
    place = {"Lcl Translation": [1.0, 2.0, 3.0], "Lcl Scaling": [2.0, 2.0, 2.0]}
    models = {"wall": ({}, None), "eye": (place, None), "lamp": (place, "eye")}
    nodes = scene(version, models=models)
    kinds = {"eye": "Camera", "lamp": "Light"}
    for node in nodes[1][2]:
        for name, kind in kinds.items():
            if node[0] == "Model" and any(f"{name}\0" in str(value) for value in node[1]):
                node[1][-1] = kind
                node[2][:] = node[2][:1]
                if version < 7000:
                    own = properties(version, {**dict(place), **values[kind]})
                    node[2][:] = [own]
    if version >= 7000:
        for key, (name, kind) in enumerate(kinds.items(), start=60):
            attribute = properties(version, values[kind])
            full = f"{name}\0\1NodeAttribute"
            nodes[1][2].append(("NodeAttribute", [key, full, kind], [attribute]))
            nodes[2][2].append(("C", ["OO", key, 101 + (name == "lamp")], []))
        skipped = (["OO", 10, 101], ["OO", 10, 102])
        nodes[2][2][:] = [each for each in nodes[2][2] if each[1] not in skipped]
    return nodes


CAMERA = {
    "AspectWidth": [1920.0], "AspectHeight": [1080.0], "FilmWidth": [1.5], "FilmHeight": [1.0],
    "ApertureMode": [3], "GateFit": [2], "FocalLength": [35.0], "NearPlane": [5.0],
    "FarPlane": [800.0],
}  # fmt: skip
LIGHT = {
    "LightType": [2], "Intensity": [250.0], "Color": [1.0, 0.5, 0.25], "OuterAngle": [60.0],
    "InnerAngle": [20.0],
}  # fmt: skip


@pytest.mark.parametrize("version", [6100, 7400])
@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_a_camera_and_a_light_become_those_of_gltf(tmp_path, version, form):
    path = tmp_path / "a.fbx"
    path.write_bytes(
        written(with_views(version, {"Camera": CAMERA, "Light": LIGHT}), version, form)
    )
    (line,) = transform_file(path, tmp_path / "b.glb").warnings
    assert "without" not in line
    document, _ = read_glb(tmp_path / "b.glb")
    (camera,), content = document["cameras"], document["extensions"]["KHR_lights_punctual"]
    view = camera["perspective"]
    assert view["aspectRatio"] == pytest.approx(16 / 9)
    # The width of the film stays: 1.5 inches before a lens of 35 mm.
    assert np.tan(view["yfov"] / 2) * 16 / 9 == pytest.approx(1.5 * 25.4 / 2 / 35.0)
    assert (view["znear"], view["zfar"]) == pytest.approx((0.05, 8.0))
    (light,) = content["lights"]
    assert (light["type"], light["color"], light["intensity"]) == ("spot", [1.0, 0.5, 0.25], 2.5)
    cone = light["spot"]
    assert (cone["outerConeAngle"], cone["innerConeAngle"]) == pytest.approx(np.radians([30, 10]))
    nodes = document["nodes"]
    assert len({node["name"] for node in nodes}) == len(nodes)
    parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", ())}
    for number, node in enumerate(nodes):
        if "camera" in node or "extensions" in node:
            matrix, at = node_matrix(node), parents[number]
            while at is not None:
                matrix, at = node_matrix(nodes[at]) @ matrix, parents.get(at)
            is_camera = "camera" in node
            place = np.array([1.0, 2.0, 3.0]) * CM * (1 if is_camera else 3)
            np.testing.assert_allclose(matrix[:3, 3], place, atol=1e-7)
            # glTF looks along -Z; FBX along +X, and its lights along -Y.
            ahead = [1, 0, 0] if is_camera else [0, -1, 0]
            np.testing.assert_allclose(matrix[:3, :3] @ [0, 0, -1], ahead, atol=1e-6)
            np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-6)


@pytest.mark.parametrize(("kind", "solid_angle"), [(0, 4.0 * np.pi), (1, 1.0), (2, 4.0 * np.pi)])
def test_watts_of_blender_become_candela_and_lux_and_a_shift_is_missed(tmp_path, kind, solid_angle):
    views = {"Camera": CAMERA | {"FilmOffsetY": [0.2]}, "Light": LIGHT | {"LightType": [kind]}}
    nodes = [("Creator", ["Blender (stable FBX IO) - 5.0.1"], []), *with_views(7400, views)]
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    lines = transform_file(tmp_path / "a.fbx", tmp_path / "b.glb").warnings
    assert any("without 1 camera shift" in line for line in lines)
    document, _ = read_glb(tmp_path / "b.glb")
    (light,) = document["extensions"]["KHR_lights_punctual"]["lights"]
    # 683 lumens are a watt of green light; Blender's exporter of glTF writes these numbers.
    assert light["intensity"] == pytest.approx(2.5 * 683.0 / solid_angle)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"ApertureMode": [0], "FieldOfViewX": [90.0], "FieldOfViewY": [60.0], "GateFit": [0]},
         (1.0, np.tan(np.pi / 6))),
        ({"ApertureMode": [1], "FieldOfView": [90.0], "GateFit": [0]}, (1.0, 2 / 3)),
        ({"ApertureMode": [2], "FieldOfView": [90.0], "GateFit": [0]}, (1.5, 1.0)),
        ({"ApertureMode": [2], "FieldOfView": [90.0], "GateFit": [1]}, (16 / 9, 1.0)),
        ({"ApertureMode": [2], "FieldOfView": [90.0], "GateFit": [3]}, (1.5, 27 / 32)),
        ({"ApertureMode": [2], "FieldOfView": [90.0], "GateFit": [4]}, (16 / 9, 1.0)),
        ({"ApertureMode": [2], "FieldOfView": [float("nan")], "GateFit": [1]},
         (16 / 9 * np.tan(np.radians(25.115 / 2)), np.tan(np.radians(25.115 / 2)))),
    ],
)  # fmt: skip
def test_the_field_of_view_is_what_the_camera_says(tmp_path, changes, expected):
    nodes = with_views(7400, {"Camera": CAMERA | changes, "Light": LIGHT})
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    found = read_scene(tmp_path / "a.fbx")
    view = read_camera(found, found.objects[60])["perspective"]
    slope = np.tan(view["yfov"] / 2)
    np.testing.assert_allclose((slope * view["aspectRatio"], slope), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("fit", "size", "half"),
    [(3, (200, 300), (10, 15)), (2, (200, 300), (15, 22.5)), (1, (200, 300), (10, 15)),
     (3, (400, 200), (15, 7.5)), (1, (400, 200), (30, 15)), (4, (400, 200), (30, 15))],
)  # fmt: skip
def test_orthographic_views_are_as_wide_as_in_maya(tmp_path, fit, size, half):
    changes = {"CameraProjectionType": [1], "GateFit": [fit], "AspectWidth": [size[0]],
               "AspectHeight": [size[1]]}  # fmt: skip
    nodes = with_views(7400, {"Camera": CAMERA | changes, "Light": LIGHT})
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    found = read_scene(tmp_path / "a.fbx")
    view = read_camera(found, found.objects[60])["orthographic"]
    np.testing.assert_allclose((view["xmag"], view["ymag"]), np.array(half) * CM)


def test_lights_that_gltf_does_not_have_are_named(tmp_path):
    nodes = with_views(7400, {"Camera": CAMERA, "Light": LIGHT | {"LightType": [3]}})
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    assert read_rig(tmp_path / "a.fbx").passed_over == ("1 area or volume light",)


def test_cameras_of_viewports_and_of_models_without_size_are_no_part_of_the_scene(tmp_path):
    text = written(with_views(7400, {"Camera": CAMERA, "Light": LIGHT}), 7400, "ascii")
    # The model above both.
    (tmp_path / "a.fbx").write_bytes(text.replace(b"2.0, 2.0, 2.0", b"0.0, 0.0, 0.0", 1))
    passed_over = read_rig(tmp_path / "a.fbx").passed_over
    assert passed_over == ("1 flattened camera", "1 flattened light")
    (tmp_path / "a.fbx").write_bytes(text.replace(b"eye", b"Producer Top"))
    assert "cameras" not in read_rig(tmp_path / "a.fbx").content


def line(*values):
    times = np.arange(float(len(values)))
    return Curve(
        times, np.array(values, float), np.full(len(values), 4), np.zeros((len(values), 2))
    )


@pytest.mark.parametrize(
    ("path", "mode", "as_a_whole", "expected"),
    [
        ("Lcl Translation", 0, True, [3.0, 5.0]),  # 1 + 4 / 2, 3 + 4 / 2
        ("Lcl Translation", 1, True, [4.0, 4.0]),
        ("Lcl Translation", 2, True, [2.5, 3.5]),
        ("Lcl Scaling", 0, False, [3.0, 5.0]),
        ("Lcl Scaling", 0, True, [2.0, 6.0]),  # times the root of 4
        ("Lcl Scaling", 2, True, [2.0, 12.0**0.5]),
    ],
)
def test_layers_add_to_what_is_below_them_or_replace_it(path, mode, as_a_whole, expected):
    target = (1, path)
    layers = tuple(
        Layer(
            tracks={target: Track({0: curve}, {})},
            weight=Track({}, {0: percent}),
            mode=kind,
            turns_as_a_whole=as_a_whole,
            scales_by_products=as_a_whole,
        )
        for curve, percent, kind in ((line(1, 3), 100.0, 0), (line(4, 4), 50.0, mode))
    )
    rows = Animation("a", layers).at(target, np.array([0.0, 1.0]), np.ones(3))
    np.testing.assert_allclose(rows[:, 0], expected)


@pytest.mark.parametrize(
    ("mode", "percent", "factor"),
    [
        (0, 0.0, -2.0), (0, 50.0, 2.0**1.5), (0, 100.0, 4.0),
        (2, 0.0, -2.0), (2, 50.0, 2.0), (2, 100.0, -2.0),
    ],
)  # fmt: skip
def test_layers_that_scale_mirrored_models_turn_their_sides_only_by_their_weight(
    mode, percent, factor
):
    target = (1, "Lcl Scaling")
    layer = Layer(
        tracks={target: Track({}, {0: -2.0})},
        weight=Track({}, {0: percent}),
        mode=mode,
        turns_as_a_whole=True,
        scales_by_products=True,
    )
    ((found, *others),) = layer.over(np.array([[-2.0, 1.0, 3.0]]), target, np.zeros(1))
    assert found == pytest.approx(factor)
    assert others[0] == 1.0


@pytest.mark.parametrize("mode", [0, 2])
@pytest.mark.parametrize("upper", [[10.0, 20.0, 30.0], [0.0, 90.0, 0.0], [200.0, -80.0, 10.0]])
def test_rotations_of_layers_are_composed_as_a_whole(mode, upper):
    """A full weight is a product of rotations or the upper one; a half weight lies between."""
    lower = np.array([[40.0, -25.0, 70.0]])
    target = (1, "Lcl Rotation")

    def turned(percent):
        layer = Layer(
            tracks={target: Track({}, dict(enumerate(upper)))},
            weight=Track({}, {0: percent}),
            mode=mode,
            turns_as_a_whole=True,
            scales_by_products=True,
        )
        return euler_matrices(layer.over(lower, target, np.zeros(1)))[0]

    below, above = euler_matrices(lower)[0], euler_matrices(np.array([upper]))[0]
    np.testing.assert_allclose(turned(100.0), below @ above if mode == 0 else above, atol=1e-9)
    np.testing.assert_allclose(turned(0.0), below, atol=1e-9)
    half = below.T @ turned(50.0)
    np.testing.assert_allclose(half @ half, below.T @ turned(100.0), atol=1e-9)


def test_tangents_of_their_own_lengths_bend_a_curve():
    """A symmetric curve of flat tangents that are as long as the way passes its middle steeply."""
    packed = np.array([9999, 9999], np.uint16).view(np.float32)[0]
    data = np.array([0, 0, packed, 0, 0, 0, 0, 0], np.float32)
    flags = 8 | 0x1000000 | 0x2000000
    second = 46_186_158_000
    fields = {
        "KeyTime": [0, second], "KeyValueFloat": [0.0, 1.0], "KeyAttrFlags": [flags, 8],
        "KeyAttrDataFloat": data.tolist(), "KeyAttrRefCount": [1, 1],
    }  # fmt: skip
    curve = read_curve(Node("AnimationCurve", [], [Node(n, v, []) for n, v in fields.items()]))
    s = np.linspace(0.0, 1.0, 10)
    times = 3 * (1 - s) ** 2 * s + s**3  # control points at 1 and 0
    np.testing.assert_allclose(curve.at(times), 3 * s**2 - 2 * s**3, atol=1e-6)


def test_shapes_in_between_take_turns():
    full = np.array([0.5, 1.0, -0.25])
    percents = np.array([0.0, 25.0, 50.0, 75.0, 100.0, 150.0, -25.0, -50.0])
    weights = shape_weights(full, percents).T
    expected = [[0, 0.5, 1, 0.5, 0, -1, 0, 0], [0, 0, 0, 0.5, 1, 2, 0, 0], [0] * 6 + [1, 2]]
    np.testing.assert_allclose(weights, expected, atol=1e-12)


@pytest.mark.parametrize(
    "percents", [[50.0, 50.0], [0.0, 100.0], [1e-300, 1.0], [np.nan, 1.0], [9.0]]
)
def test_shapes_whose_weights_are_damaged_are_spread_evenly(percents):
    fields = [Node("FullWeights", percents, [])]
    channel = FbxObject(1, "lift", "BlendShapeChannel", Node("Deformer", [], fields))
    assert full_weights(channel, 2).tolist() == [0.5, 1.0]


def test_an_in_between_shape_is_a_morph_target_of_its_own(tmp_path):
    nodes = moving_scene()
    half = [("Indexes", [np.array([0], np.int32)], []), ("Vertices", [np.array([0.0, 4, 0])], [])]
    nodes[1][2].append(("Geometry", [80, "half\0\1Geometry", "Shape"], half))
    for node in nodes[1][2]:
        if node[1][0] == 73:
            node[2].append(("FullWeights", [np.array([50.0, 100.0])], []))
    links = nodes[2][2]
    at = next(i for i, each in enumerate(links) if each[1] == ["OO", 74, 73])
    links.insert(at, ("C", ["OO", 80, 73], []))
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    rig = read_rig(tmp_path / "a.fbx")
    fields = rig.objects[0].fields
    assert fields["extras"]["targetNames"] == ["half", "bump"]
    assert fields["weights"] == [0.5, 0.0]  # the channel stands at 25 %
    (animation,) = rig.content["animations"]
    (sampler,) = (
        animation["samplers"][channel["sampler"]]
        for channel in animation["channels"]
        if channel["target"]["path"] == "weights"
    )
    rows = rig.arrays[sampler["output"]].reshape(-1, 2)
    percents = 90.0 * rig.arrays[sampler["input"]][:, 0]
    np.testing.assert_allclose(rows[:, 0], 1 - np.abs(percents / 50 - 1), atol=1e-5)
    np.testing.assert_allclose(rows[:, 1], np.maximum(percents / 50 - 1, 0), atol=1e-5)


@pytest.mark.parametrize("name", real("fbx/maya_anim_layers_over_acc_orders_7500_binary.fbx"))
def test_layers_give_what_maya_has_evaluated(name):
    """Models of all orders of rotation, whose properties Maya has written at frame 18."""
    motions = read_motions(REAL / name)
    (animation,) = motions.animations
    assert len(animation.layers) == 3
    for item in motions.scene.models:
        known = model_properties(motions.scene, item.model)
        for path in ("Lcl Translation", "Lcl Rotation", "Lcl Scaling"):
            found = animation.at((item.model.key, path), np.array([18 / 24]), np.zeros(3))[0]
            if path == "Lcl Rotation":
                found, wanted = (euler_matrices(np.array([v])) for v in (found, known[path]))
            else:
                wanted = known[path]
            np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_huge_numbers_leave_out_what_they_move(tmp_path):
    nodes = moving_scene()
    for node in nodes[1][2]:
        if node[0] == "AnimationCurve":
            node[2][1] = ("KeyValueFloat", [np.array([0.0, 1e38], np.float32)], [])
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    rig = read_rig(tmp_path / "a.fbx")
    assert all(np.isfinite(rows).all() for rows in rig.arrays.values())


def test_json_of_cameras_has_only_numbers(tmp_path):
    huge = {name: [1e300] for name in CAMERA} | {"GateFit": [float("inf")]}
    nodes = with_views(7400, {"Camera": huge, "Light": {"Intensity": [-1e300], "LightType": [2]}})
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    content = read_rig(tmp_path / "a.fbx").content
    written_out = json.dumps([content["cameras"], content["extensions"]])
    assert "NaN" not in written_out and "Infinity" not in written_out
