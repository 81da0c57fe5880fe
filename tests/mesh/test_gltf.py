import base64
import json
import struct

import numpy as np
import pytest
import trimesh

from tests.glb import CORNERS, GltfFile
from tests.models import REAL, model, real
from texbake.errors import FileError, FileFormatError, MeshError, OptionError, UvError
from texbake.mesh.files.gltf import read_gltf
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import grid_sphere, plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.metadata import CONVENTION, SPACE, to_description
from texbake.texture.png_files import write_png


@pytest.fixture
def asset():
    return GltfFile()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.glb"


@pytest.fixture
def grouped():
    """Two parts, with coordinates, normals, tangents, colors and names."""
    sphere = uv_sphere(6, 9)
    normals, normal_faces = shading_normals(sphere)
    rng = np.random.default_rng(0)
    return sphere.replace(
        normals=normals,
        normal_faces=normal_faces,
        tangents=corner_tangents(sphere),
        face_groups=np.arange(sphere.n_faces) % 2,
        group_names=("Pith", "Schäle"),
        colors=rng.random((sphere.n_vertices, 4)).astype(np.float32),
    )


def corner_values(mesh):
    """All attributes that a renderer uses, corner by corner, in float32."""
    values = [mesh.positions[mesh.faces]]
    if mesh.uvs is not None:
        values.append(mesh.corner_uvs())
    if mesh.normals is not None:
        values.append(mesh.normals[mesh.normal_faces])
    if mesh.tangents is not None:
        values.append(mesh.tangents)
    if mesh.colors is not None:
        values.append(mesh.colors[mesh.faces])
    return np.concatenate(values, axis=2).astype(np.float32)


# Writing, and reading what was written


def test_written_meshes_come_back(path, grouped):
    write_glb(grouped, path)
    back = read_gltf(path)
    order = np.argsort(grouped.face_groups, kind="stable")
    assert back.group_names == grouped.group_names
    np.testing.assert_array_equal(back.face_groups, grouped.face_groups[order])
    ours, theirs = corner_values(grouped)[order], corner_values(back)
    assert ours.shape == theirs.shape
    # 1e-7: 1 - v in float32, and unit vectors normalized once more.
    np.testing.assert_allclose(theirs, ours, atol=1.3e-7)
    # Positions and colors only pass through.
    np.testing.assert_array_equal(theirs[..., :3], ours[..., :3])
    np.testing.assert_array_equal(theirs[..., -4:], ours[..., -4:])


def test_reading_and_writing_again_gives_the_same_bytes(tmp_path, grouped):
    write_glb(grouped, tmp_path / "1.glb", name="x")
    write_glb(read_gltf(tmp_path / "1.glb"), tmp_path / "2.glb", name="x")
    assert (tmp_path / "1.glb").read_bytes() == (tmp_path / "2.glb").read_bytes()


def test_tangents_are_those_of_mikktspace_and_the_mesh_keeps_its_own(path, grouped):
    plain = grouped.replace(tangents=None, face_groups=None, group_names=(), colors=None)
    write_glb(plain, path)
    np.testing.assert_allclose(read_gltf(path).tangents, corner_tangents(plain), atol=1e-6)
    turned = np.broadcast_to(np.float32([0, 0, 1, -1]), (plain.n_faces, 3, 4))
    write_glb(plain.replace(tangents=turned), path)
    np.testing.assert_array_equal(read_gltf(path).tangents, turned)


def test_vertices_are_shared_where_all_attributes_agree(path):
    sphere = grid_sphere(20, 30)
    write_glb(sphere, path)
    document = read_document(path)
    assert len(document.accessor(0)) == sphere.n_vertices


@pytest.mark.parametrize(("n_vertices", "component"), [(65535, 5123), (65536, 5125)])
def test_no_index_is_a_primitive_restart(path, n_vertices, component):
    positions = np.random.default_rng(0).random((n_vertices, 3))
    corners = np.arange(n_vertices - n_vertices % 3).reshape(-1, 3)
    corners = np.concatenate([corners, np.arange(n_vertices - 3, n_vertices)[None]])
    write_glb(Mesh(positions=positions, faces=corners), path)
    accessors = read_document(path).items("accessors")
    assert [a["componentType"] for a in accessors if a["type"] == "SCALAR"] == [component]
    assert read_gltf(path).n_faces == len(corners)


def test_a_place_far_from_the_origin_is_kept_by_the_node(path):
    sphere = grid_sphere(8, 12)
    far = sphere.replace(positions=sphere.positions + np.array([4.5e6, -2e5, 0.0]))
    write_glb(far, path)
    back = read_gltf(path)
    # Float32 of a coordinate about 1, not of one about 4.5e6, where it would be 0.5.
    assert np.abs(back.positions[back.faces] - far.positions[far.faces]).max() < 1e-7


def test_degenerate_corners_get_unit_vectors(path):
    # A needle, a face without texture area, and one collapsed to a point.
    mesh = Mesh(
        positions=[*CORNERS, [2, 0, 0], [5, 5, 5]],
        faces=[[0, 1, 3], [0, 1, 2], [4, 4, 4]],
        uvs=[[0, 0], [1, 0], [0, 1]],
        uv_faces=[[0, 1, 2], [1, 1, 1], [0, 1, 2]],
        tangents=np.zeros((3, 3, 4)),
        normals=[[0, 0, 0], [1, 0, 0]],
        normal_faces=[[0, 0, 0], [1, 1, 1], [0, 1, 0]],
    )
    for tangents in (mesh.tangents, None):
        write_glb(mesh.replace(tangents=tangents), path)
        document = read_document(path)
        attributes = document.items("meshes")[0]["primitives"][0]["attributes"]
        for attribute in ("NORMAL", "TANGENT"):
            vectors = document.accessor(attributes[attribute])[:, :3].astype(np.float64)
            np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=1e-6)
        signs = document.accessor(attributes["TANGENT"])[:, 3]
        assert set(np.abs(signs)) == {1.0}


def test_textures_are_embedded_as_they_are(tmp_path, path):
    codes = np.full((4, 4, 3), 128, np.uint8)
    write_png(tmp_path / "normal.png", codes)
    write_png(tmp_path / "color.png", codes, srgb=True)
    write_glb(
        plane(), path, normal_map=tmp_path / "normal.png", base_color=str(tmp_path / "color.png")
    )
    document = read_document(path)
    material = document.items("materials")[0]
    for texture, name in (
        (material["normalTexture"], "normal.png"),
        (material["pbrMetallicRoughness"]["baseColorTexture"], "color.png"),
    ):
        source = document.items("textures")[texture["index"]]["source"]
        view = document.items("bufferViews")[document.items("images")[source]["bufferView"]]
        start = view["byteOffset"]
        embedded = document.buffers[0][start : start + view["byteLength"]].tobytes()
        assert embedded == (tmp_path / name).read_bytes()


def test_base_color_may_be_a_factor(path):
    write_glb(grid_sphere(4, 6), path, base_color=(0.8, 0.4, 0.1))
    material = read_document(path).items("materials")[0]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == [0.8, 0.4, 0.1, 1.0]
    with pytest.raises(OptionError, match="base_color"):
        write_glb(plane(), path, base_color=(0.8, 4.0, 0.1))


def test_maps_that_gltf_cannot_mean_are_errors(tmp_path, path):
    codes = np.full((4, 4, 3), 128, np.uint8)
    for facts, advice in (
        ({CONVENTION: "directx"}, "`convention` opengl"),
        ({SPACE: "object"}, "`space` tangent"),
    ):
        write_png(tmp_path / "n.png", codes, description=to_description(facts))
        with pytest.raises(OptionError, match=advice):
            write_glb(plane(), path, normal_map=tmp_path / "n.png")
    (tmp_path / "n.exr").write_bytes(b"\x76\x2f\x31\x01")
    with pytest.raises(OptionError, match="PNG or JPEG"):
        write_glb(plane(), path, normal_map=tmp_path / "n.exr")
    (tmp_path / "n.png").write_bytes((tmp_path / "n.png").read_bytes()[:-20])
    with pytest.raises(FileFormatError, match="cut short"):
        write_glb(plane(), path, normal_map=tmp_path / "n.png")
    with pytest.raises(FileError, match="there is no such file"):
        write_glb(plane(), path, normal_map=tmp_path / "none.png")
    with pytest.raises(UvError, match="no texture coordinates"):
        write_glb(grid_sphere(4, 6), path, normal_map=tmp_path / "n.png")
    assert not path.exists()


# Reading what others may write


def test_v_is_turned_up_and_vertices_at_one_position_are_welded(asset, path):
    attributes = {
        "POSITION": asset.accessor([*CORNERS, CORNERS[1], [1, 1, 0], CORNERS[2]], "f"),
        "TEXCOORD_0": asset.accessor([[0, 0.25], [1, 0], [0, 1], [0.5, 0], [1, 1], [0, 1]], "f"),
    }
    asset.mesh({"attributes": attributes})
    mesh = read_gltf(asset.write(path))
    assert mesh.n_vertices == 4 and mesh.n_faces == 2
    assert len({*mesh.faces[0]} & {*mesh.faces[1]}) == 2  # one edge, shared
    assert mesh.corner_uvs()[0].tolist() == [[0, 0.75], [1, 1], [0, 0]]
    assert mesh.corner_uvs()[1, 0].tolist() == [0.5, 1]


def test_transforms_add_up_and_mirrored_ones_turn_faces(asset, path):
    normals = asset.accessor([[0, 0, 1]] * 3, "f")
    tangents = asset.accessor([[1, 0, 0, 1]] * 3, "f")
    positions = asset.accessor(CORNERS, "f")
    mesh = asset.mesh(
        {"attributes": {"POSITION": positions, "NORMAL": normals, "TANGENT": tangents}}
    )
    half = np.sqrt(0.5)
    asset.json["nodes"] = [
        {"children": [1], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": mesh, "rotation": [0, 0, half, half]},  # a quarter turn about z
        {"mesh": mesh, "matrix": [-1, 0, 0, 0, 0, 3, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    result = read_gltf(asset.write(path))
    corners = result.positions[result.faces]
    turned = [[10, 0, 0], [10, 2, 0], [8, 0, 0]]
    np.testing.assert_allclose(corners[0], turned, atol=1e-12)
    np.testing.assert_array_equal(corners[1], [[0, 3, 5], [-1, 0, 5], [0, 0, 5]])
    # Outside stays outside: the normal of the winding is that of the file, in both.
    edges = corners[:, 1:] - corners[:, :1]
    areas = np.cross(edges[:, 0], edges[:, 1])
    assert (areas[:, 2] > 0).all() and (result.normals[result.normal_faces][..., 2] > 0).all()
    np.testing.assert_allclose(result.tangents[0, 0], [0, 1, 0, 1], atol=1e-7)
    np.testing.assert_array_equal(result.tangents[1, 0], [-1, 0, 0, -1])


def test_normals_turn_by_the_inverse_transpose(asset, path):
    normal = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    mesh = asset.mesh({"attributes": {
        "POSITION": asset.accessor(CORNERS, "f"), "NORMAL": asset.accessor([normal] * 3, "f"),
    }})  # fmt: skip
    asset.json["nodes"] = [{"mesh": mesh, "scale": [2, 1, 1]}]
    expected = np.array([0.5, 1.0, 0.0]) / np.linalg.norm([0.5, 1.0, 0.0])
    result = read_gltf(asset.write(path))
    np.testing.assert_allclose(result.normals[0], expected, atol=1e-7)  # float32 input


def test_strips_fans_and_primitives_other_than_triangles(asset, path):
    square = asset.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]], "f")
    for mode in (5, 6, 0, 1, 3, None):
        fields = {} if mode is None else {"mode": mode}
        asset.mesh({"attributes": {"POSITION": square}, **fields}, name=f"mode {mode}")
    mesh = read_gltf(asset.write(path))
    faces = [mesh.faces[mesh.face_groups == i] for i in range(3)]
    faces = [(part - part.min()).tolist() for part in faces]
    assert mesh.group_names == ("mode 5", "mode 6", "mode None")
    assert faces[0] == [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
    assert faces[1] == [[1, 2, 0], [2, 3, 0], [3, 4, 0]]
    assert faces[2] == [[0, 1, 2]]  # two vertices over


def test_sparse_interleaved_and_normalized_values(asset, path):
    # Interleaved: position, then uvs as normalized uint16, stride 16.
    rows = [struct.pack("<3f2H", *p, *uv) for p, uv in zip(
        CORNERS, [(0, 0), (65535, 0), (0, 13107)], strict=True)]  # fmt: skip
    view = asset.view(b"".join(rows), byteStride=16)
    positions = asset.accessor(CORNERS, "f", bufferView=view)
    uvs = asset.accessor([[0, 0]] * 3, "H", bufferView=view, byteOffset=12, normalized=True)
    places = {"bufferView": asset.view(np.array([2], "u1").tobytes()), "componentType": 5121}
    moved = {"bufferView": asset.view(np.array([[0, 7, 1]], "f4").tobytes())}
    asset.json["accessors"][positions]["sparse"] = {
        "count": 1, "indices": places, "values": moved,
    }  # fmt: skip
    zeros = asset.accessor(CORNERS, "f", bufferView=view)  # zeros, but for one vertex
    asset.json["accessors"][zeros].pop("bufferView")
    asset.json["accessors"][zeros]["sparse"] = asset.json["accessors"][positions]["sparse"]
    asset.mesh({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}})
    asset.mesh({"attributes": {"POSITION": zeros}})
    mesh = read_gltf(asset.write(path))
    assert mesh.positions[mesh.faces[0]].tolist() == [[0, 0, 0], [1, 0, 0], [0, 7, 1]]
    assert mesh.positions[mesh.faces[1]].tolist() == [[0, 0, 0], [0, 0, 0], [0, 7, 1]]
    np.testing.assert_array_equal(mesh.corner_uvs()[0], [[0, 1], [1, 1], [0, 1 - 13107 / 65535]])
    assert (mesh.corner_uvs()[1] == 0).all()  # a primitive that has none


def test_signed_normalized_values_reach_minus_one_twice(asset, path):
    normals = asset.accessor([[-128, 0, 0], [-127, 0, 0], [127, 0, 0]], "b", normalized=True)
    document = read_document(asset.write(path))
    assert document.accessor(normals)[:, 0].tolist() == [-1.0, -1.0, 1.0]


def test_colors_of_three_components_and_none(asset, path):
    positions = asset.accessor(CORNERS, "f")
    colors = asset.accessor([[255, 0, 51]] * 3, "B", normalized=True)
    asset.mesh({"attributes": {"POSITION": positions, "COLOR_0": colors}})
    asset.mesh({"attributes": {"POSITION": positions}})
    mesh = read_gltf(asset.write(path))
    assert mesh.colors[0].tolist() == [1.0, 0.0, np.float32(0.2), 1.0]
    assert mesh.colors[3].tolist() == [1.0, 1.0, 1.0, 1.0]


def test_only_the_scene_counts_and_a_skin_ignores_its_node(asset, path):
    mesh = asset.triangle(name="triangle")
    asset.json["nodes"] = [
        {"mesh": mesh, "translation": [1, 0, 0], "name": "seen"},
        {"mesh": mesh, "translation": [2, 0, 0]},
        {"mesh": mesh, "translation": [3, 0, 0], "skin": 0},
    ]
    asset.json["scenes"] = [{"nodes": [1]}, {"nodes": [0, 2]}]
    asset.json["scene"] = 1
    result = read_gltf(asset.write(path))
    assert result.positions[result.faces][:, 0, 0].tolist() == [1, 0]
    assert result.group_names == ("seen", "triangle")


def test_text_form_with_its_buffer_beside_it_or_in_it(asset, tmp_path):
    asset.triangle()
    (tmp_path / "the buffer.bin").write_bytes(asset.data)
    embedded = "data:application/octet-stream;base64," + base64.b64encode(asset.data).decode()
    for uri in ("the%20buffer.bin", "the buffer.bin", embedded):
        asset.json["buffers"] = [{"byteLength": len(asset.data), "uri": uri}]
        (tmp_path / "a.gltf").write_text(json.dumps(asset.json), encoding="utf-8-sig")
        assert read_gltf(tmp_path / "a.gltf").n_faces == 1


@pytest.mark.parametrize("extension", ["KHR_meshopt_compression", "EXT_mesh_manifold"])
def test_a_required_extension_that_is_not_read_is_named(asset, path, extension):
    asset.triangle()
    asset.json["extensionsRequired"] = ["KHR_materials_unlit", "KHR_mesh_quantization", extension]
    with pytest.raises(FileFormatError, match=f"it needs {extension}"):
        read_gltf(asset.write(path))
    asset.json["extensionsRequired"].pop()
    assert read_gltf(asset.write(path)).n_faces == 1


def test_a_missing_file_or_buffer_is_a_file_error(tmp_path, asset):
    with pytest.raises(FileError, match="no such file"):
        read_gltf(tmp_path / "none.glb")
    asset.triangle()
    asset.json["buffers"] = [{"byteLength": 36, "uri": "none.bin"}]
    (tmp_path / "a.gltf").write_text(json.dumps(asset.json))
    with pytest.raises(FileError, match=r"none\.bin: there is no such file"):
        read_gltf(tmp_path / "a.gltf")


def damage(asset, *keys, value):
    """Set one value deep in the document."""
    owner = asset.json
    for key in keys[:-1]:
        owner = owner[key]
    owner[keys[-1]] = value


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("accessors", 0, "count"), 10**9),
        (("accessors", 0, "count"), -1),
        (("accessors", 0, "count"), "3"),
        (("accessors", 0, "count"), 10**30),
        (("accessors", 0, "type"), "VEC9"),
        (("accessors", 0, "type"), "VEC2"),
        (("accessors", 0, "componentType"), 99),
        (("accessors", 0, "bufferView"), 7),
        (("accessors", 0, "bufferView"), None),
        (("accessors", 0, "byteOffset"), 4),
        (("accessors", 0), {"count": 10**12, "componentType": 5126, "type": "VEC3"}),
        (("accessors", 1, "componentType"), 5126),
        (("bufferViews", 0, "byteLength"), 10**12),
        (("bufferViews", 0, "buffer"), 1),
        (("bufferViews", 0, "byteStride"), 10**9),
        (("buffers"), 5),
        (("meshes", 0, "primitives"), {"a": 1}),
        (("meshes", 0, "primitives", 0, "attributes"), [0]),
        (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 9),
        (("meshes", 0, "primitives", 0, "attributes", "NORMAL"), 1),
        (("meshes", 0, "primitives", 0, "indices"), -1),
        (("meshes", 0, "primitives", 0, "indices"), 0),
        (("nodes", 0, "mesh"), 5),
        (("nodes", 0, "matrix"), [1, 2]),
        (("nodes", 0, "scale"), [1, 10**400, 1]),
        (("nodes", 0, "children"), [0]),
        (("nodes", 0, "children"), ["0"]),
        (("nodes", 0, "children"), [3]),
        (("scene",), 4),
        (("asset", "version"), "1.0"),
        (("extensionsRequired",), "KHR"),
    ],
)
def test_inconsistent_files_are_one_clear_line(asset, path, keys, value):
    positions, indices = asset.accessor(CORNERS, "f"), asset.accessor([0, 1, 2], "B")
    mesh = asset.mesh({"attributes": {"POSITION": positions}, "indices": indices})
    asset.json |= {"nodes": [{"mesh": mesh}], "scenes": [{"nodes": [0]}], "scene": 0}
    assert read_gltf(asset.write(path)).n_faces == 1
    if keys == "buffers":
        asset.json["bufferViews"][0]["buffer"] = value
    else:
        damage(asset, *keys, value=value)
    asset.write(path)
    with pytest.raises((FileFormatError, MeshError)) as caught:
        read_gltf(path)
    assert "\n" not in str(caught.value) and str(caught.value).startswith((str(path), path.name))


@pytest.mark.parametrize(
    ("last", "indices", "message"),
    [
        ([0, 1, 0], [0, 1, 3], r"an index is out of range \(3; there are 3\)"),
        ([np.nan, 1, 0], [0, 1, 2], "a value of POSITION is not finite"),
        ([0, 1, 0], [], "no faces"),
    ],
)
def test_wrong_values_are_named(asset, path, last, indices, message):
    positions = asset.accessor([*CORNERS[:2], last], "f")
    asset.mesh({"attributes": {"POSITION": positions}, "indices": asset.accessor(indices, "H")})
    with pytest.raises((FileFormatError, MeshError), match=message):
        read_gltf(asset.write(path))


def write_by_trimesh(path):
    """Meshes with several instances, under parents that turn, stretch and mirror them."""
    scene, random = trimesh.Scene(), np.random.default_rng(6)
    for i, name in enumerate(("organs", "bracket", "figure", "organs", "figure")):
        place = np.eye(4)
        place[:3] = random.normal(size=(3, 4))
        mesh = trimesh.Trimesh(model(name).positions, model(name).faces, process=False)
        parent = None if i == 0 else f"node {(i - 1) // 2}"
        scene.add_geometry(mesh, f"node {i}", name, parent, place)
    scene.export(path)


@pytest.mark.parametrize(
    "name",
    ["made.glb", "made.gltf",
     *real("gltf/NormalTangentMirrorTest.glb", "gltf/ToyCar/ToyCar.gltf", "meshes/VH_F_Skin.glb",
           "broken/VH_M_Blood_Vasculature_Heart.glb")],
)  # fmt: skip
def test_files_of_other_programs_agree_with_another_reader(tmp_path, name):
    path = tmp_path / name if name.startswith("made") else REAL / name
    if name.startswith("made"):
        write_by_trimesh(path)
    ours, theirs = read_gltf(path), trimesh.load(path, process=False).to_geometry()
    assert ours.n_faces == len(theirs.faces)
    # Float32 coordinates, through transforms in other orders.
    np.testing.assert_allclose(ours.bounds, theirs.bounds, atol=1e-6 * ours.diagonal)
    areas = np.linalg.norm(
        np.cross(*np.diff(ours.positions[ours.faces], axis=1).transpose(1, 0, 2)), axis=1
    )
    assert areas.sum() / 2 == pytest.approx(theirs.area, rel=1e-5)
