"""Files with minor errors or unread parts are read, and a warning counts what is left out."""

import base64
import json
import struct
import subprocess
import sys

import numpy as np
import pytest
from trimesh.exchange.dae import export_collada

from tests.fbx_writer import FACES, POINTS, layer, scene, shape, written
from tests.glb import CORNERS, GltfFile
from texbake import ReadWarning, TexbakeError, read_mesh, read_scene, to_trimesh, write_mesh
from texbake.errors import FileFormatError, MeshError, heard_warnings
from texbake.mesh.files.contents import read_contents
from texbake.mesh.files.unread_parts import unread_parts
from texbake.mesh.materials import read_materials
from texbake.mesh.shapes import cube, icosphere
from texbake.verbs.meshes import transform_file

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
NAN, INF = float("nan"), float("inf")


def heard(path):
    """A mesh and the warnings of its reader, without the path."""
    lines = []
    with heard_warnings(lines.append):
        mesh = read_mesh(path)
    assert all(line.startswith(f"{path}: ") for line in lines)
    return mesh, [line.removeprefix(f"{path}: ") for line in lines]


def gltf(path, arrays, primitive=(), **content):
    """A file of one triangle list without indices, from its attributes."""
    file = GltfFile(nodes=[{"mesh": 0}], **content)
    attributes = {name: file.accessor(rows) for name, rows in arrays.items()}
    file.mesh({"attributes": attributes, **dict(primitive)})
    return file.write(path)


def not_finite(value, folder):
    """Files with one such number in the normals, coordinates, colors or unused vertices."""
    (folder / "a.obj").write_text(
        SQUARE + f"v 0 {value} 0\nvt 0 0\nvt {value} 0\nvn 0 0 1\nvn 0 0 {value}\n"
        "f 1/1/1 2/2/1 3/1/2\n"
    )
    (folder / "a.off").write_text(
        f"STNOFF\n4 1 0\n0 0 0 0 0 1 0 0\n1 0 0 0 0 {value} 0 0\n1 1 0 0 0 1 {value} 0\n"
        f"0 1 {value} 0 0 1 0 0\n3 0 1 2\n"
    )
    head = "ply\nformat {} 1.0\nelement vertex 4\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    head += "property float s\nproperty float t\nelement face 1\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    rows = np.zeros((4, 8), "<f4")
    rows[:3, :3] = CORNERS
    rows[:, 5] = 1.0
    rows[3, 1] = rows[1, 5] = rows[2, 6] = float(value)
    body = rows.tobytes() + struct.pack("<B3i", 3, 0, 1, 2)
    (folder / "a.ply").write_bytes(head.format("binary_little_endian").encode() + body)
    text = "".join(" ".join(map(str, row)) + "\n" for row in rows.tolist()) + "3 0 1 2\n"
    (folder / "b.ply").write_text(head.format("ascii") + text)
    far = [0, float(value), 0]
    arrays = {"POSITION": [*CORNERS, far], "NORMAL": [[0, 0, 1], far, [0, 0, 1], [0, 0, 1]]}
    arrays["TEXCOORD_0"] = [[0, 0], [1, 0], [0, float(value)], [0, 0]]
    gltf(folder / "a.gltf", arrays)
    points = np.concatenate([POINTS, [far]])
    corners = np.zeros((11, 5))
    corners[:, 2] = 1.0
    corners[1, 2] = corners[2, 3] = float(value)
    layers = (
        layer("LayerElementNormal", ("Normals", corners[:, :3].ravel())),
        layer("LayerElementUV", ("UV", corners[:, 3:].ravel())),
    )
    for form in ("ascii", "binary"):
        nodes = scene(geometry=shape(layers, points))
        (folder / f"{form}.fbx").write_bytes(written(nodes, 7400, form))


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize("name", ["a.obj", "a.off", "a.ply", "b.ply", "a.gltf",
                                  "ascii.fbx", "binary.fbx"])  # fmt: skip
def test_numbers_that_are_not_finite_are_counted_and_left_out(tmp_path, name, value):
    not_finite(value, tmp_path)
    mesh, lines = heard(tmp_path / name)
    n = len(FACES) if name.endswith("fbx") else 1
    assert mesh.n_faces == n and np.isfinite(mesh.positions).all()
    assert not np.isfinite(float(value)) and len(mesh.positions) == {1: 3, 5: len(POINTS)}[n] + (
        name == "a.obj"  # one vertex more that no face uses
    )
    assert mesh.normals is not None and np.isfinite(mesh.normals).all()
    assert mesh.uvs is not None and np.isfinite(mesh.uvs).all()
    assert sorted(line.split(" of ")[0] for line in lines) == ["1", "1", "1"]
    assert sorted(line.split(";")[0].split(maxsplit=3)[3] for line in lines) == [
        "normals are not finite", "texture coordinates are not finite", "vertices are not finite",
    ]  # fmt: skip


@pytest.mark.parametrize("most", [1, 255])
def test_colors_that_are_not_finite(tmp_path, most):
    (tmp_path / "a.obj").write_text(
        f"v 0 0 0 nan 0 0\nv 1 0 0 0 {most} 0\nv 1 1 0 0 0 {most}\nf 1 2 3"
    )
    mesh, lines = heard(tmp_path / "a.obj")
    assert lines == ["1 of 3 vertex colors are not finite; white replaces them"]
    assert mesh.colors.tolist() == [[1, 1, 1], [0, 1, 0], [0, 0, 1]]


def test_tangents_that_are_not_finite(tmp_path):
    arrays = {"POSITION": CORNERS, "NORMAL": [[0, 0, 1]] * 3, "TANGENT": [[1, 0, NAN, 1]] * 3}
    mesh, lines = heard(gltf(tmp_path / "a.gltf", arrays))
    assert mesh.tangents is None and "tangents are not finite" in lines[0]


TRIANGLE = "f 1 2 3\n"


@pytest.mark.parametrize(("text", "line"), [
    (SQUARE + TRIANGLE + "f 3 4\nf 1\nf 1 3 4\n", "left out 2 faces with fewer"),
    (SQUARE.replace(" 1", " 1,5") + TRIANGLE + "f 1 3 4\n", "decimal commas are read as"),
    ("\ufeff" + SQUARE + TRIANGLE + "f 1 3 4\n", None),
    (SQUARE + TRIANGLE + "f 1 3 4\n\0", None),
    (SQUARE + TRIANGLE + "f 1 3 4\n" + "\0" * 5, None),
])  # fmt: skip
def test_odd_obj_files(tmp_path, text, line):
    (tmp_path / "a.obj").write_text(text, "utf-8")
    mesh, lines = heard(tmp_path / "a.obj")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.positions.max() == (1.5 if "," in text else 1.0)
    assert [found.startswith(line or "no") for found in lines] == [True] * (line is not None)


@pytest.mark.parametrize("row", ["v 1,2,3 0 0", "v 1. 2,3 1,2,3", "v 1,a 2 3", "v 1, 2, 3"])
def test_ambiguous_commas_stay_an_error(tmp_path, row):
    (tmp_path / "a.obj").write_text(SQUARE + row + "\n" + TRIANGLE)
    with pytest.raises(FileFormatError, match=r"a\.obj: line 5: '.*' is not a number"):
        read_mesh(tmp_path / "a.obj")


def test_materials_of_faces_beside_edges(tmp_path):
    """Two polygons and two triangles, but not the same two."""
    (tmp_path / "a.mtl").write_text(
        "\ufeffnewmtl red\nKd 0,5 0 0\nnewmtl blue\nKd 0 0 1\n", "utf-8"
    )
    text = "mtllib a.mtl\n" + SQUARE + "usemtl red\nf 1 2 3 4\nusemtl blue\nf 1 2\n"
    (tmp_path / "a.obj").write_text("\ufeff" + text, "utf-8")
    mesh, _ = heard(tmp_path / "a.obj")
    lines = []
    with heard_warnings(lines.append):
        materials = read_materials(tmp_path / "a.obj", mesh)
    assert [materials.names[i] for i in materials.face_materials] == ["red", "red"]
    assert materials.sources("base-color")[0].factor == (0.5, 0.0, 0.0)
    assert lines == [f"{tmp_path / 'a.mtl'}: decimal commas are read as decimal points"]
    contents = read_contents(tmp_path / "a.obj")
    assert [material.name for material in contents.materials] == ["red", "blue"]


@pytest.mark.parametrize("head", [b"made by a scanner", b"solid of a scanner"])
def test_bytes_after_the_last_triangle_of_binary_stl(tmp_path, head):
    write_mesh(cube(), tmp_path / "a.stl")
    content = head.ljust(80) + (tmp_path / "a.stl").read_bytes()[80:]
    (tmp_path / "a.stl").write_bytes(content + b"color data")
    mesh, lines = heard(tmp_path / "a.stl")
    np.testing.assert_array_equal(mesh.positions[mesh.faces], cube().positions[cube().faces])
    assert lines == ["left out 10 bytes after the last triangle"]


@pytest.mark.parametrize(
    "word", ["1.#INF", "-1.#IND", "-inf", "inf", "nan(ind)", "-nan", "1.#QNAN0"]
)
@pytest.mark.parametrize("version", [6100, 7400])
def test_fbx_text_with_words_for_numbers(tmp_path, word, version):
    """Numbers before and after such a word keep their places, in short and long lists."""
    layers = []
    for n in (11, 200):
        values = np.arange(3.0 * n)
        values[4] = 987654.0
        layers = (layer("LayerElementNormal", ("Normals", values)),)
        nodes = [("Note", [12.5, 987654.0, 3], []), *scene(version, geometry=shape(layers))]
        text = b"\xef\xbb\xbf" + written(nodes, version, "ascii")
        assert text.count(b"987654.0") == 2
        (tmp_path / "a.fbx").write_bytes(text.replace(b"987654.0", word.encode()))
        mesh, lines = heard(tmp_path / "a.fbx")
        assert lines == [f"1 of {n} normals are not finite; computed ones replace them"]
        directions = mesh.normals[mesh.normal_faces]
        first = directions[:, 0] * np.linalg.norm([0.0, 1.0, 2.0])
        np.testing.assert_allclose(first[0], [0.0, 1.0, 2.0], atol=1e-12)
        assert directions[0, 1].tolist() == [0, 0, 0]
        last = values[3 * 10 : 3 * 10 + 3]
        np.testing.assert_allclose(directions[-1, 2], last / np.linalg.norm(last), atol=1e-12)


@pytest.mark.parametrize("form", ["ascii", "binary"])
@pytest.mark.parametrize(("version", "name"), [(3000, "3.0"), (5000, "5.0"), (5800, "5.8")])
def test_fbx_of_old_versions_is_named(tmp_path, version, name, form):
    nodes = [("Model", ["Model::Cube", "Mesh"], shape())]
    (tmp_path / "a.fbx").write_bytes(written(nodes, version, form))
    with pytest.raises(MeshError, match=rf"a\.fbx: it is FBX {name}, .*; export it again as FBX 7"):
        read_mesh(tmp_path / "a.fbx")


@pytest.mark.parametrize(("geometry", "message"), [
    (("Geometry", [74, "\0\1Geometry", "NurbsSurface"], []), "no faces, but 1 NURBS surface;"),
    (("Geometry", [74, "\0\1Geometry", "Mesh"], shape(polygons=np.zeros(0, "i4"))), "are empty;"),
])  # fmt: skip
def test_why_an_fbx_file_is_empty(tmp_path, geometry, message):
    (tmp_path / "a.fbx").write_bytes(written([("Objects", [], [geometry])], 7400, "binary"))
    with pytest.raises(MeshError, match=message):
        read_mesh(tmp_path / "a.fbx")


def test_omissions_that_change_an_fbx_surface_are_named(tmp_path):
    nodes = scene(geometry=[
        ("Smoothness", [2], []), ("PreviewDivisionLevels", [2], []), *shape(),
    ])  # fmt: skip
    nodes[1][2].extend([
        ("Deformer", [71, "\0\1Deformer", "Skin"], []),
        ("Deformer", [72, "smile\0\1SubDeformer", "BlendShapeChannel"], []),
        ("Deformer", [73, "frown\0\1SubDeformer", "BlendShapeChannel"], []),
        ("Geometry", [74, "\0\1Geometry", "NurbsSurface"], []),
        ("Geometry", [75, "\0\1Geometry", "Mesh"], shape()),
    ])  # fmt: skip
    (tmp_path / "a.fbx").write_bytes(written(nodes, 7400, "binary"))
    mesh, lines = heard(tmp_path / "a.fbx")
    assert mesh.n_faces == len(FACES)
    assert lines == [
        "left out 1 NURBS surface; only polygons are read",
        "1 subdivision surface is read as its control mesh; subdivide with: texbake convert "
        "--subdivide 2",
        "left out 1 hidden mesh",
    ]


def test_skins_and_morph_targets_of_gltf_are_named(tmp_path):
    path = gltf(
        tmp_path / "a.gltf", {"POSITION": CORNERS}, primitive={"targets": [{"POSITION": 0}]},
        skins=[{"joints": [0]}],
    )  # fmt: skip
    document = json.loads(path.read_text())
    document["meshes"][0]["primitives"] *= 2  # the primitives of a mesh share its morph targets
    path.write_text(json.dumps(document))
    assert heard(path)[1] == []  # a GLB file keeps them
    assert unread_parts(path) == ("1 skin", "1 morph target")
    lines = []
    with heard_warnings(lines.append):
        read_scene(path)
    line = "left out 1 skin and 1 morph target; the mesh is read in the pose it is stored in"
    assert lines == [f"{path}: {line}"]


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_of_gltf_are_named(tmp_path, mode):
    file = GltfFile(nodes=[{"mesh": 0}, {"mesh": 1}])
    file.triangle()
    file.mesh({"attributes": {"POSITION": file.accessor(CORNERS)}, "mode": mode})
    mesh, lines = heard(file.write(tmp_path / "a.glb"))
    assert mesh.n_faces == 1 and lines == ["left out 1 primitive of points or lines"]


def test_animations_and_lights_of_gltf_are_counted(tmp_path):
    path = gltf(
        tmp_path / "a.gltf", {"POSITION": CORNERS},
        animations=[{"channels": [], "samplers": []}] * 2, skins=[{"joints": [0]}],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    )  # fmt: skip
    assert read_contents(path).passed_over == ("2 animations", "1 skin", "1 light")
    empty = "left out 2 animations: animation 0: it moves no node of the scene"
    with pytest.warns(ReadWarning, match=empty):
        (warning,) = transform_file(path, tmp_path / "b.obj").warnings
    assert "written without 2 animations, 1 skin, 1 light" in warning
    with pytest.warns(ReadWarning, match=empty):
        assert transform_file(path, tmp_path / "b.glb").warnings == ()
    assert unread_parts(tmp_path / "b.glb") == ("1 light",)  # nothing has the skin


def test_fbx_animations_and_skins_are_counted(tmp_path):
    nodes = scene(7400)
    nodes[1][2].append(("AnimationStack", [70, "walk\0\1AnimStack", ""], []))
    nodes[1][2].append(("Deformer", [71, "\0\1Deformer", "Skin"], []))
    path = tmp_path / "a.fbx"
    path.write_bytes(written(nodes, 7400, "binary"))
    assert unread_parts(path) == ("1 skin",)  # the animation moves nothing
    assert read_contents(path).passed_over == ("1 skin",)
    nodes[1][2].append(("AnimationCurve", [72, "\0\1AnimCurve", ""], []))
    path.write_bytes(written(nodes, 7400, "binary"))
    assert unread_parts(path) == ("1 animation", "1 skin")
    assert read_contents(path).passed_over == ("1 animation", "1 skin")


def test_scripts_get_a_warning_and_commands_a_line(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(SQUARE + TRIANGLE + "f 3 4\n")
    with pytest.warns(ReadWarning, match=r"a\.obj: left out 1 face with fewer than three"):
        read_mesh(path)
    command = [sys.executable, "-P", "-m", "texbake", "convert", path, tmp_path / "b.ply"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    line = f"texbake: warning: {path}: left out 1 face with fewer than three corners"
    assert done.stderr.splitlines().count(line) == 1


def test_backslashes_in_the_names_of_files(tmp_path):
    path = gltf(tmp_path / "a.gltf", {"POSITION": CORNERS})
    document = json.loads(path.read_text())
    (tmp_path / "parts").mkdir()
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    (tmp_path / "parts" / "a b.bin").write_bytes(data)
    for uri in ("parts\\a b.bin", "parts%5Ca%20b.bin", "parts/a b.bin"):
        document["buffers"][0]["uri"] = uri
        path.write_text(json.dumps(document))
        assert heard(path)[0].n_faces == 1
    (tmp_path / "parts" / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_text("mtllib parts\\a.mtl\n" + SQUARE + "usemtl red\n" + TRIANGLE)
    mesh = read_mesh(tmp_path / "a.obj")
    assert read_materials(tmp_path / "a.obj", mesh).missing == ()


def draco(path, mesh, attributes, data):
    points = {"componentType": 5126, "count": len(mesh.positions), "type": "VEC3"}
    file = GltfFile(
        accessors=[
            {"componentType": 5125, "count": 3 * mesh.n_faces, "type": "SCALAR"}, points, points,
        ],
    )  # fmt: skip
    extension = {"bufferView": file.view(data), "attributes": attributes}
    file.mesh({
        "attributes": {"POSITION": 1, "NORMAL": 2}, "indices": 0,
        "extensions": {"KHR_draco_mesh_compression": extension},
    })  # fmt: skip
    return file.write(path)


@pytest.fixture(scope="module")
def draco_ball():
    """A sphere, its bytes, and the ids of its positions and normals in them."""
    import DracoPy

    ball = icosphere(1)
    points = np.ascontiguousarray(ball.positions)
    data = DracoPy.encode(points, ball.faces.astype(np.uint32), normals=points)
    ids = {item["attribute_type"]: item["unique_id"] for item in DracoPy.decode(data).attributes}
    return ball, data, {"POSITION": ids[0], "NORMAL": ids[1]}


@pytest.mark.parametrize("number", [9, "a", True])
def test_a_missing_draco_attribute_is_one_line(tmp_path, draco_ball, number):
    ball, data, numbers = draco_ball
    assert heard(draco(tmp_path / "a.gltf", ball, numbers, data))[0].n_faces == ball.n_faces
    path = draco(tmp_path / "a.gltf", ball, {**numbers, "NORMAL": number}, data)
    with pytest.raises(FileFormatError, match=r"compressed by Draco has no attribute"):
        read_mesh(path)


def test_counts_that_draco_does_not_hold_are_one_line(tmp_path, draco_ball, monkeypatch):
    """Without limits, the decoder takes 7 GB and a minute for these 268,435,456 points."""
    monkeypatch.undo()  # a process of its own reads it
    ball, data, numbers = draco_ball
    corners = ball.faces.astype("<u4").tobytes()
    head = data[:8] + bytes([0, 0, 0, ball.n_faces]) + b"\x80\x80\x80\x80\x01\x01"
    path = draco(tmp_path / "a.gltf", ball, numbers, head + corners + data[-200:])
    with pytest.raises(FileFormatError, match=r"a\.gltf: "):
        read_mesh(path)


def test_damaged_draco_is_read_or_one_line(tmp_path, draco_ball):
    ball, data, numbers = draco_ball
    rng = np.random.default_rng(5)
    n_refused = 0
    for _ in range(300):
        damaged = bytearray(data)
        for at in rng.integers(len(data), size=3):
            damaged[at] = rng.integers(256)
        path = draco(tmp_path / "a.gltf", ball, numbers, bytes(damaged))
        try:
            read_mesh(path)
        except TexbakeError as error:
            n_refused += 1
            assert "\n" not in str(error)
    assert n_refused > 10


def test_a_damaged_geometry_of_collada_is_named(tmp_path):
    parts = [to_trimesh(mesh) for mesh in (cube(), icosphere(0))]
    (tmp_path / "a.dae").write_bytes(export_collada(parts))
    mesh, lines = heard(tmp_path / "a.dae")
    assert (mesh.n_faces, lines) == (32, [])
    head, indices, tail = (tmp_path / "a.dae").read_text("utf-8").rpartition("<p>")
    (tmp_path / "a.dae").write_text(head + indices + "9" + tail, "utf-8")
    mesh, (line,) = heard(tmp_path / "a.dae")
    assert mesh.n_faces == 12
    assert line.startswith("left out 1 damaged geometry: DaeMalformedError: Indexes")


@pytest.mark.parametrize("row", ["0 0 1 1", "0 0 0 2", "0.5 0 0 1"])
def test_a_projective_row_of_a_collada_matrix_is_left_out(tmp_path, row):
    to_trimesh(cube()).export(tmp_path / "a.dae")
    text = (tmp_path / "a.dae").read_text("utf-8")
    matrix = f"<matrix>2 0 0 0 0 2 0 0 0 0 2 0 {row}</matrix><instance_geometry"
    (tmp_path / "a.dae").write_text(text.replace("<instance_geometry", matrix, 1), "utf-8")
    lines = []
    with heard_warnings(lines.append):
        mesh = read_mesh(tmp_path / "a.dae")
    np.testing.assert_array_equal(mesh.bounds, 2 * cube().bounds)
    assert lines == [f"{tmp_path / 'a.dae'}: left out the projective row of 1 matrix"]


@pytest.mark.parametrize("name", ["C:\\art\\red.png", "..\\..\\red.png", "/home/art/red.png"])
def test_an_image_named_by_a_path_of_another_machine_is_found_beside_the_library(tmp_path, name):
    (tmp_path / "red.png").write_bytes(b"red")
    (tmp_path / "a.mtl").write_text(f"newmtl red\nmap_Kd {name}\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + SQUARE + "usemtl red\n" + TRIANGLE)
    found = read_materials(tmp_path / "a.obj", read_mesh(tmp_path / "a.obj"))
    assert (found.missing, found.sources("base-color")[0].image.data) == ((), b"red")
