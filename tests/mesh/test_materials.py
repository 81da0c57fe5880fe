"""Materials of mesh files: which faces have which, and where their base colors come from."""

import numpy as np
import pytest

from tests.glb import CORNERS, GltfFile
from texbake.errors import FileFormatError, MeshError, heard_warnings
from texbake.jobs.material_transfer import compared_without
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.materials import UNPLACED, ChannelSource, Materials, MeshMaterial, read_materials
from texbake.mesh.shapes import cube, plane
from texbake.verbs.meshes import transform_file

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
    assert found.names == ("default", "red paint", "wood")
    assert found.face_materials.tolist() == [0, 1, 2, 2]
    bare, red, wood = found.sources("base-color")
    assert bare is None
    assert red == ChannelSource((0.5, 0.25, 0.0))
    assert (wood.image.data, wood.factor) == (b"an image", (1.0, 1.0, 1.0))
    assert wood.image.wraps == ("clamp", "clamp")


def test_obj_materials_have_the_channels_of_physically_based_ones(tmp_path):
    for name in "rough", "bent":
        (tmp_path / f"{name}.png").write_bytes(name.encode())
    path = obj_with(
        tmp_path,
        "a.mtl",
        "newmtl wood\nPm 0.25\nmap_Pr rough.png\nnorm bent.png\nKe 0 2 0\nd 0.5\nTr 0.9\n"
        "newmtl red paint\nd 1\n",
    )
    _, red, wood = read_materials(path, read_mesh(path)).materials
    assert (red.alpha_mode, wood.alpha_mode) == ("opaque", "blend")
    assert {name: source.factor for name, source in wood.channels.items()} == {
        "metallic": (0.25,), "roughness": (1.0,), "normal": (1.0, 1.0, 1.0),
        "emissive": (0.0, 2.0, 0.0), "alpha": (0.5,),
    }  # fmt: skip
    assert wood.channels["roughness"].image.data == b"rough"
    assert wood.channels["roughness"].image.components == (0,)
    assert wood.channels["normal"].image.data == b"bent"


@pytest.mark.parametrize(("library", "error", "message"), [
    ("newmtl wood\nKd blue\n", FileFormatError, "Kd 'blue' is not a color"),
    ("newmtl wood\nKd 1 2\n", FileFormatError, "Kd '1 2' is not a color"),
    ("newmtl wood\nKd nan 0 0\n", FileFormatError, "is not a color"),
])  # fmt: skip
def test_bad_libraries_are_one_clear_error(tmp_path, library, error, message):
    path = obj_with(tmp_path, "a.mtl", library)
    with pytest.raises(error, match=message):
        read_materials(path, read_mesh(path))


def test_a_library_that_is_missing_is_named(tmp_path):
    (tmp_path / "a.obj").write_text(SQUARES.format(library="gone.mtl"))
    found = read_materials(tmp_path / "a.obj", read_mesh(tmp_path / "a.obj"))
    assert found.materials[1:] == (MeshMaterial(name="red paint"), MeshMaterial(name="wood"))
    assert any("gone.mtl" in line for line in found.notes())


def test_of_a_thousand_missing_images_a_few_are_told(tmp_path):
    statements = (f"newmtl m{i}\nKd 1 0 0\nmap_Kd gone{i}.png\n" for i in range(1000))
    path = obj_with(tmp_path, "a.mtl", "newmtl wood\nKd 1 0 0\n" + "".join(statements))
    found = read_materials(path, read_mesh(path))
    assert len(found.missing) == len(found.missing_images) == 1000
    notes = found.notes()
    assert len(notes) == 21 and "gone19.png" in notes[19]
    assert notes[20] == "and 980 more like these"
    (line,) = compared_without(path, found)
    assert line.endswith("gone18.png, gone19.png, and 980 more like these")
    warned = []
    with heard_warnings(warned.append):
        transform_file(path, tmp_path / "b.glb")
    assert warned == [f"{path}: {line}" for line in notes]


@pytest.mark.parametrize("statement", ["map_Bump -bm 0.5", "bump", "map_Ks", "disp", "refl"])
def test_images_of_obj_materials_that_are_left_out_are_named(tmp_path, statement):
    path = obj_with(tmp_path, "a.mtl", f"newmtl wood\nKd 1 0 0\n{statement} grain.png\n")
    (note,) = read_materials(path, read_mesh(path)).notes()
    assert note == f"wood: left out {statement.split()[0]} 'grain.png'"


def test_files_without_materials_have_none(tmp_path):
    for suffix in "obj", "ply", "stl", "glb":
        path = tmp_path / f"cube.{suffix}"
        write_mesh(cube(), path)
        found = read_materials(path, read_mesh(path))
        assert found is None or found.materials[0].channels.keys() == {
            "base-color", "roughness", "metallic",
        }  # fmt: skip


def gltf_with(tmp_path, material, **content):
    """One triangle of a glTF file, twice, with a material and without."""
    file = GltfFile(materials=[material], **content)
    attributes = {"POSITION": file.accessor(CORNERS)}
    file.mesh({"attributes": attributes, "material": 0}, {"attributes": attributes})
    return file.write(tmp_path / "a.gltf")


def with_image(tmp_path, uri="data:image/png;base64,YW4gaW1hZ2U=", **info):
    """A file whose first material has an image for its base color."""
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}
    textures, samplers = [{"source": 0, "sampler": 0}], [{"wrapS": 33648}]
    return gltf_with(
        tmp_path, material, images=[{"uri": uri}], textures=textures, samplers=samplers
    )


def test_gltf_materials_go_by_primitive(tmp_path):
    path = gltf_with(
        tmp_path, {"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1]}}
    )
    found = read_materials(path, read_mesh(path))
    assert (found.names, found.face_materials.tolist()) == (("skin", "material"), [0, 1])
    assert found.sources("base-color") == [
        ChannelSource((0.5, 0.25, 1.0)), ChannelSource((1.0, 1.0, 1.0))
    ]  # fmt: skip


@pytest.mark.parametrize("uri", ["beside me.bin", "data:image/png;base64,YW4gaW1hZ2U="])
def test_gltf_images_are_read_from_beside_and_from_inside(tmp_path, uri):
    (tmp_path / "beside me.bin").write_bytes(b"an image")
    path = with_image(tmp_path, uri.replace(" ", "%20"))
    image = read_materials(path, read_mesh(path)).sources("base-color")[0].image
    assert (image.data, image.placing) == (b"an image", UNPLACED)
    assert image.wraps == ("mirror", "repeat")


@pytest.mark.parametrize("data", ["YQ", "\u00e9"])
def test_embedded_data_that_is_not_base64_is_one_clear_line(tmp_path, data):
    path = with_image(tmp_path, f"data:image/png;base64,{data}")
    with pytest.raises(FileFormatError, match="not base64"):
        read_materials(path, read_mesh(path))
    path = gltf_with(tmp_path, {}, buffers=[{"uri": f"data:;base64,{data}", "byteLength": 36}])
    with pytest.raises(FileFormatError, match="not base64"):
        read_mesh(path)


def test_a_moved_gltf_texture_is_turned_for_v_up(tmp_path):
    moved = {"KHR_texture_transform": {"offset": [0.25, 0.5], "scale": [2, 4]}}
    path = with_image(tmp_path, extensions=moved)
    image = read_materials(path, read_mesh(path)).sources("base-color")[0].image
    placing = np.array(image.placing)
    for u, v in ((0.0, 0.0), (0.3, 0.9), (1.0, 1.0)):
        down = np.array([0.25 + 2.0 * u, 0.5 + 4.0 * (1.0 - v)])  # as glTF has it
        np.testing.assert_allclose(placing @ [u, v, 1.0], [down[0], 1.0 - down[1]], atol=1e-15)


def test_an_image_on_coordinates_that_are_not_there_is_noted(tmp_path):
    path = with_image(tmp_path, texCoord=1)
    found = read_materials(path, read_mesh(path))
    assert found.sources("base-color")[0].image is None and "TEXCOORD_1" in found.notes()[0]


def test_materials_are_checked():
    ids = np.array([0, 2], dtype=np.int32)
    with pytest.raises(MeshError, match="out of range"):
        Materials(face_materials=ids, materials=(MeshMaterial(name="a"), MeshMaterial(name="b")))


def test_an_image_can_stand_for_all_materials(tmp_path):
    (tmp_path / "a.png").write_bytes(b"an image")
    found = Materials.of_image(plane(), tmp_path / "a.png")
    assert found.face_materials.tolist() == [0, 0]
    assert found.sources("base-color")[0].image.data == b"an image"
