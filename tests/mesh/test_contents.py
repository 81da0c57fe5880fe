"""What model files say besides their surface: materials, images, UV sets, unit and up axis."""

import json

import pytest

from tests.fbx_writer import binary, properties, rich_scene, scene
from tests.mesh.test_usd import TWO_QUADS
from tests.mesh.test_usd_materials import RGB, material_of
from texbake.mesh.files.contents import model_bytes, read_contents


def test_gltf(tmp_path):
    (tmp_path / "c.png").write_bytes(b"picture")
    document = {
        "asset": {"version": "2.0"},
        "images": [{"uri": "c.png"}, {"uri": "missing.png", "name": "detail"}],
        "textures": [{"source": 0}, {"source": 1}],
        "materials": [
            {
                "name": "skin", "alphaMode": "BLEND",
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
                "normalTexture": {"index": 1}, "extensions": {"KHR_materials_clearcoat": {}},
            },
            {},
        ],
        "meshes": [{"primitives": [{"attributes": {"TEXCOORD_1": 0, "TEXCOORD_0": 0}}]}],
    }  # fmt: skip
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    found = read_contents(tmp_path / "a.gltf")
    assert [material.name for material in found.materials] == ["skin", "material 1"]
    assert found.materials[0].channels == {
        "base-color": "c.png", "metallic": None, "normal": "detail", "opacity": "c.png",
        "clearcoat": None,
    }  # fmt: skip
    assert found.images == {"c.png": b"picture", "detail": None}
    assert found.uv_sets == ("TEXCOORD_0", "TEXCOORD_1")
    assert (found.meters_per_unit, found.up) == (1.0, "+Y")


def test_obj(tmp_path):
    (tmp_path / "c.png").write_bytes(b"picture")
    (tmp_path / "a.mtl").write_text(
        "newmtl skin\nKd 1 1 1\nmap_Kd -clamp on c.png\nmap_Bump -bm 0.5 none.png\n"
        "newmtl plain\nKd 1 0 0\nNs 10\n"
    )
    (tmp_path / "a.obj").write_text("mtllib a.mtl missing.mtl\nv 0 0 0\nvt 0 0\n")
    found = read_contents(tmp_path / "a.obj")
    assert {material.name: material.channels for material in found.materials} == {
        "skin": {"base-color": "c.png", "bump": "none.png"},
        "plain": {"base-color": None, "roughness": None},
    }
    assert found.images == {"c.png": b"picture", "none.png": None}
    assert found.uv_sets == ("vt",)
    assert (found.meters_per_unit, found.up) == (None, None)


def test_an_empty_image_counts_as_missing(tmp_path):
    (tmp_path / "c.png").write_bytes(b"")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd c.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\n")
    assert read_contents(tmp_path / "a.obj").images == {"c.png": None}


def test_usd(tmp_path):
    (tmp_path / "c.png").write_bytes(b"picture")
    head = 'metersPerUnit = 0.01\nupAxis = "Z"'
    quads = TWO_QUADS.format(head=head, body="texCoord2f[] primvars:light = [(0, 0)]")
    inputs = f"color3f inputs:diffuseColor.connect = {RGB}\nfloat inputs:metallic = 0"
    bumps = "normal3f inputs:normal.connect = </bumps/image.outputs:rgb>"
    texts = material_of("skin", inputs), material_of("bumps", bumps, file="images/none.png")
    (tmp_path / "a.usda").write_text(quads + "".join(texts) + 'def Material "plain" {}')
    found = read_contents(tmp_path / "a.usda")
    assert {material.name: material.channels for material in found.materials} == {
        "skin": {"base-color": "c.png", "metallic": None},
        "bumps": {"normal": "none.png"},
        "plain": {},
    }
    assert found.images == {"c.png": b"picture", "none.png": None}
    assert found.uv_sets == ("light",)
    assert (found.meters_per_unit, found.up) == (0.01, "+Z")


def test_fbx(tmp_path):
    nodes = rich_scene(7400)
    _, _, objects = nodes[1]
    red = next(i for i, node in enumerate(objects) if node[1][0] == 50)
    color = properties(7400, {"DiffuseColor": [0.25, 0.5, 0.75]})
    objects[red] = ("Material", objects[red][1], [color])
    content = [("Content", [b"picture"], [])]
    objects.append(("Texture", [60, "paint\0\1Texture", ""], content))
    nodes[2][2].append(("C", ["OP", 60, 51, "DiffuseColor"], []))
    (tmp_path / "a.fbx").write_bytes(binary(nodes))
    found = read_contents(tmp_path / "a.fbx")
    channels = {material.name: material.channels for material in found.materials}
    assert channels["red"] == {"base-color": None}
    (image,) = found.images
    assert channels["blue"]["base-color"] == image
    assert found.images[image] == b"picture"
    for data in (binary(nodes), b'Content: "cGljdHVyZQ=="'):
        (tmp_path / "a.fbx").write_bytes(data)
        found = model_bytes(tmp_path / "a.fbx", [b"picture", b"beside it", None])
        assert found == len(data) + len(b"beside it")


@pytest.mark.parametrize(("suffix", "more"), [(".usdz", 0), (".glb", 0), (".usdc", 7), (".obj", 7)])
def test_images_count_once(tmp_path, suffix, more):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"mesh")
    assert model_bytes(path, [b"picture", None]) == 4 + more


@pytest.mark.parametrize("version", [6100, 7400])
@pytest.mark.parametrize(
    ("factor", "meters", "axis", "sign", "up"),
    [(1.0, 0.01, 1, 1, "+Y"), (100.0, 1.0, 2, 1, "+Z"), (50.0, 0.5, 1, -1, "-Y")],
)
def test_fbx_files_say_unit_and_axis(tmp_path, version, factor, meters, axis, sign, up):
    settings = {"UnitScaleFactor": [factor], "UpAxis": [axis], "UpAxisSign": [sign]}
    (tmp_path / "a.fbx").write_bytes(binary(scene(version, settings=settings), version))
    found = read_contents(tmp_path / "a.fbx")
    assert (found.meters_per_unit, found.up) == (meters, up)


def test_other_formats_say_nothing(tmp_path):
    assert read_contents(tmp_path / "a.ply") is None
