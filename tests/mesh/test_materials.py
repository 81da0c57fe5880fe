"""Materials of mesh files: which faces have which, and where their base colors come from."""

import base64
import json

import numpy as np
import pytest

from texbake.errors import FileError, FileFormatError, MeshError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.materials import UNPLACED, BaseColor, Materials, read_materials
from texbake.mesh.shapes import cube, plane

SQUARES = """mtllib {library}
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
vt 0 0
vt 1 0
vt 1 1
f 1/1 2/2 3/3
usemtl red paint
f 1/1 3/3 4/2
usemtl wood
f 2/1 5/2 6/3 3/1
"""


def obj_with(tmp_path, library, text):
    (tmp_path / library).write_text(text)
    (tmp_path / "a.obj").write_text(SQUARES.format(library=library))
    return tmp_path / "a.obj"


def test_obj_materials_go_by_triangle_and_their_colors_by_name(tmp_path):
    (tmp_path / "grain fine.png").write_bytes(b"an image")
    path = obj_with(
        tmp_path,
        "all of it.mtl",
        "# none\nnewmtl red paint\nKd 0.5 0.25 0\nKs 1 1 1\n\nnewmtl wood\n"
        "map_Kd -s 2 2 -clamp on grain fine.png\nKd 0.8 0.8 0.8\nnewmtl unused\n",
    )
    found = read_materials(path, read_mesh(path))
    assert found is not None
    assert found.names == ("default", "red paint", "wood")
    assert found.face_materials.tolist() == [0, 1, 2, 2]
    assert found.base_colors[0] is None
    assert found.base_colors[1] == BaseColor(factor=(0.5, 0.25, 0.0))
    wood = found.base_colors[2]
    assert (wood.image, wood.wrap, wood.factor) == (b"an image", "clamp", (1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("library", "error", "message"),
    [
        ("newmtl wood\nmap_Kd none.png\n", FileError, "none.png"),
        ("newmtl wood\nKd blue\n", FileFormatError, "Kd 'blue' is not a color"),
        ("newmtl wood\nKd 1 2\n", FileFormatError, "Kd '1 2' is not a color"),
        ("newmtl wood\nKd nan 0 0\n", FileFormatError, "is not a color"),
    ],
)
def test_bad_libraries_are_one_clear_error(tmp_path, library, error, message):
    path = obj_with(tmp_path, "a.mtl", library)
    with pytest.raises(error, match=message):
        read_materials(path, read_mesh(path))


def test_a_library_that_is_missing_is_named(tmp_path):
    (tmp_path / "a.obj").write_text(SQUARES.format(library="gone.mtl"))
    with pytest.raises(FileError, match=r"gone\.mtl"):
        read_materials(tmp_path / "a.obj", read_mesh(tmp_path / "a.obj"))


def test_files_without_materials_have_none(tmp_path):
    for suffix in "obj", "ply", "stl", "glb":
        path = tmp_path / f"cube.{suffix}"
        write_mesh(cube(), path)
        found = read_materials(path, read_mesh(path))
        assert found is None or found.base_colors == (BaseColor(),)


def gltf_with(tmp_path, material, **document):
    """One triangle of a glTF file, twice, with a material and without."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    data = base64.b64encode(points).decode()
    primitives = [{"attributes": {"POSITION": 0}, "material": 0}, {"attributes": {"POSITION": 0}}]
    content = {
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": primitives}],
        "materials": [material],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "buffers": [
            {"uri": f"data:application/octet-stream;base64,{data}", "byteLength": len(points)}
        ],
        **document,
    }
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    return tmp_path / "a.gltf"


IMAGED = {"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33648}]}


def test_gltf_materials_go_by_primitive(tmp_path):
    path = gltf_with(
        tmp_path, {"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1]}}
    )
    found = read_materials(path, read_mesh(path))
    assert found is not None
    assert found.names == ("skin", "material")
    assert found.face_materials.tolist() == [0, 1]
    assert found.base_colors == (BaseColor((0.5, 0.25, 1.0)), BaseColor())


@pytest.mark.parametrize("uri", ["beside me.bin", "data:image/png;base64,YW4gaW1hZ2U="])
def test_gltf_images_are_read_from_beside_and_from_inside(tmp_path, uri):
    (tmp_path / "beside me.bin").write_bytes(b"an image")
    path = gltf_with(
        tmp_path,
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        images=[{"uri": uri.replace(" ", "%20")}],
        **IMAGED,
    )
    color = read_materials(path, read_mesh(path)).base_colors[0]
    assert (color.image, color.wrap, color.placing) == (b"an image", "mirror", UNPLACED)


@pytest.mark.parametrize("data", ["YQ", "\u00e9"])
def test_embedded_data_that_is_not_base64_is_one_clear_line(tmp_path, data):
    imaged = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    path = gltf_with(tmp_path, imaged, images=[{"uri": f"data:image/png;base64,{data}"}], **IMAGED)
    with pytest.raises(FileFormatError, match="not base64"):
        read_materials(path, read_mesh(path))
    path = gltf_with(tmp_path, {}, buffers=[{"uri": f"data:;base64,{data}", "byteLength": 36}])
    with pytest.raises(FileFormatError, match="not base64"):
        read_mesh(path)


def test_a_moved_gltf_texture_is_turned_for_v_up(tmp_path):
    moved = {"KHR_texture_transform": {"offset": [0.25, 0.5], "scale": [2, 4]}}
    path = gltf_with(
        tmp_path,
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": moved}}},
        images=[{"uri": "data:image/png;base64,YW4gaW1hZ2U="}],
        **IMAGED,
    )
    placing = np.array(read_materials(path, read_mesh(path)).base_colors[0].placing)
    for u, v in ((0.0, 0.0), (0.3, 0.9), (1.0, 1.0)):
        down = np.array([0.25 + 2.0 * u, 0.5 + 4.0 * (1.0 - v)])  # as glTF has it
        np.testing.assert_allclose(placing @ [u, v, 1.0], [down[0], 1.0 - down[1]], atol=1e-15)


def test_a_base_color_on_other_coordinates_is_refused(tmp_path):
    path = gltf_with(
        tmp_path,
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}},
        images=[{"uri": "a.png"}],
        **IMAGED,
    )
    with pytest.raises(FileFormatError, match="TEXCOORD_1"):
        read_materials(path, read_mesh(path))


def test_real_files_have_theirs(data_dir):
    path = data_dir / "meshes" / "capsule.obj"
    found = read_materials(path, read_mesh(path))
    (color,) = found.base_colors
    assert color.image == (data_dir / "meshes" / "capsule0.jpg").read_bytes()
    path = next((data_dir / "gltf" / "ToyCar").rglob("*.gl*"))
    mesh = read_mesh(path)
    found = read_materials(path, mesh)
    assert len(found.face_materials) == mesh.n_faces
    assert any(color.image for color in found.base_colors)


def test_materials_are_checked():
    ids = np.array([0, 2], dtype=np.int32)
    with pytest.raises(MeshError, match="out of range"):
        Materials(face_materials=ids, names=("a", "b"), base_colors=(None, None))
    with pytest.raises(MeshError, match="1 base colors for 3 names"):
        Materials(face_materials=ids, names=("a", "b", "c"), base_colors=(None,))


def test_an_image_can_stand_for_all_materials(tmp_path):
    (tmp_path / "a.png").write_bytes(b"an image")
    found = Materials.of_image(plane(), tmp_path / "a.png")
    assert found.face_materials.tolist() == [0, 0]
    assert found.base_colors[0].image == b"an image"
