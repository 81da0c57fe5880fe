"""Models with missing or damaged images, or with materials that need unknown features."""

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from texbake_cli.main import texbake

from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.materials import ChannelSource, read_materials
from texbake.mesh.shapes import plane
from texbake.texture.png_files import png_parts

pytestmark = pytest.mark.usefixtures("small_pictures")
RED = [0.5, 0.0, 0.0, 1.0]


def model(folder, uri="gone.png", extensions=None, **fields):
    """A textured square as .gltf, with the buffer beside it."""
    write_mesh(plane(), folder / "plane.glb")
    document = read_document(folder / "plane.glb")
    (folder / "plane.bin").write_bytes(document.binary.tobytes())
    texture = {"index": 0}
    material = {
        "name": "skin",
        "pbrMetallicRoughness": {
            "baseColorFactor": RED, "baseColorTexture": texture,
            "metallicRoughnessTexture": texture,
        },
        "normalTexture": texture, "occlusionTexture": texture, "extensions": extensions or {},
    }  # fmt: skip
    content = {
        **document.content, "buffers": [{"byteLength": len(document.binary), "uri": "plane.bin"}],
        "materials": [material], "textures": [{"source": 0}], "images": [{"uri": uri}], **fields,
    }  # fmt: skip
    content["meshes"][0]["primitives"][0]["material"] = 0
    (folder / "a.gltf").write_text(json.dumps(content))
    return folder / "a.gltf"


SCENE = '[[objects]]\nmesh = "a.gltf"\n'
COMMANDS = {
    "convert": ["convert", "a.gltf", "out.glb"],
    "preview": ["preview", "a.gltf", "-o", "out.png", "--size", "16x16"],
    "scene": ["preview", "scene.toml", "-o", "out.png", "--size", "16x16"],
    "lighten": [
        "lighten", "a.gltf", "-o", "out.glb", "--size", "16", "--views", "1", "--report", "r.json",
    ],
    "run": ["run", "a.gltf", "-o", "out", "--faces", "4", "--size", "64"],
    "bake": ["bake", "a.gltf", "a.gltf", "-o", "out", "--maps", "base-color", "--size", "16"],
}  # fmt: skip


@pytest.mark.parametrize(("command", "uri"), [
    *((command, "gone.png") for command in COMMANDS),
    ("convert", "../gone.png"),
    ("convert", "http://example.org/gone.png"),
])  # fmt: skip
def test_a_missing_image_is_one_warning_and_neutral(tmp_path, monkeypatch, command, uri):
    monkeypatch.chdir(tmp_path)
    model(tmp_path, uri)
    (tmp_path / "scene.toml").write_text(SCENE)
    result = CliRunner().invoke(texbake, COMMANDS[command])
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if "keeps its factors" in line]
    assert len(lines) == 1 and "skin: " in lines[0] and "gone.png" in lines[0]
    if command == "lighten":
        sizes = [(tmp_path / name).stat().st_size for name in ("a.gltf", "plane.bin")]
        assert json.loads((tmp_path / "r.json").read_text())["n_bytes_before"] == sum(sizes)
    if (tmp_path / "out.glb").exists():
        mesh = read_mesh(tmp_path / "out.glb")
        (material,) = read_materials(tmp_path / "out.glb", mesh).materials
        assert material.channels["base-color"].image is None
        assert material.channels["base-color"].factor == tuple(RED[:3])


def jpeg_bytes():
    file = io.BytesIO()
    Image.linear_gradient("L").save(file, "JPEG")
    return file.getvalue()


DAMAGED = {
    "no image": b"version https://git-lfs.github.com/spec/v1",
    "empty": b"",
    "half a PNG": b"".join(png_parts(np.zeros((9, 9, 3), np.uint8)))[:-20],
    "half a JPEG": jpeg_bytes()[:-200],
}


PLACES = ("beside", "inside", "OBJ")


# All kinds of damage in all places, and each command with each of both.
@pytest.mark.parametrize(("kind", "command", "place"), [
    (kind, command, PLACES[(i + j) % 3])
    for i, kind in enumerate(DAMAGED)
    for j, command in enumerate(["convert", "preview", "lighten", "bake"])
])  # fmt: skip
def test_a_damaged_image_is_treated_as_missing(tmp_path, monkeypatch, command, kind, place):
    monkeypatch.chdir(tmp_path)
    data = DAMAGED[kind]
    (tmp_path / "bad.png").write_bytes(data)
    inside = "data:image/png;base64," + base64.b64encode(data).decode()
    model(tmp_path, inside if place == "inside" else "bad.png")
    line = COMMANDS[command]
    if place == "OBJ":
        (tmp_path / "a.mtl").write_text("newmtl skin\nKd 0.5 0 0\nmap_Kd bad.png\nmap_Ke bad.png\n")
        square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3 4/1\n"
        (tmp_path / "a.obj").write_text(f"mtllib a.mtl\nusemtl skin\n{square}")
        line = ["a.obj" if word == "a.gltf" else word for word in line]
    result = CliRunner().invoke(texbake, line)
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if "keeps its factors" in line]
    assert len(lines) == 1 and "skin: " in lines[0]
    if (tmp_path / "out.glb").exists():
        mesh = read_mesh(tmp_path / "out.glb")
        (material,) = read_materials(tmp_path / "out.glb", mesh).materials
        assert all(source.image is None for source in material.channels.values())
        assert material.channels["base-color"].factor == tuple(RED[:3])
        assert not any(material.channels.get("emissive", ChannelSource((0.0,))).factor)


@pytest.mark.parametrize("option", ["--albedo", "--normal-map"])
def test_an_image_that_an_option_names_must_be_sound(tmp_path, monkeypatch, option):
    monkeypatch.chdir(tmp_path)
    write_mesh(plane(), "plane.glb")
    command = ["preview", "plane.glb", "-o", "out.png", option, "bad.png"]
    result = CliRunner().invoke(texbake, command)
    assert result.exit_code == 1 and "bad.png: there is no such file" in result.stderr
    Path("bad.png").write_bytes(b"no image")
    result = CliRunner().invoke(texbake, command)
    assert result.exit_code == 1 and "bad.png: it is not an image" in result.stderr


@pytest.mark.parametrize("command", ["convert", "preview", "lighten"])
def test_unread_parts_of_materials_are_named(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    extensions = {
        "KHR_materials_iridescence": {"iridescenceFactor": 1.0},
        "KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatNormalTexture": {"index": 0}},
    }  # fmt: skip
    path = model(
        tmp_path, extensions=extensions, extensionsUsed=["KHR_materials_iridescence"],
        extensionsRequired=["KHR_materials_iridescence"],
    )  # fmt: skip
    result = CliRunner().invoke(texbake, COMMANDS[command])
    assert result.exit_code == 0, result.stderr
    # Only convert keeps it without a word.
    assert ("KHR_materials_iridescence" in result.stderr) == (command != "convert")
    if command != "preview":  # which shows no clear coat at all
        line = "a.gltf: clearcoatNormalTexture of 1 material is not read"
        assert result.stderr.count(line) == 1
        kept = read_materials(tmp_path / "out.glb", read_mesh(tmp_path / "out.glb"))
        assert kept.materials[0].channels["clearcoat"].factor == (1.0,)
    assert read_mesh(path).n_faces == plane().n_faces
