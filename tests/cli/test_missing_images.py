"""A model whose images are missing, or whose materials ask for more than texbake knows."""

import json

import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.materials import read_materials
from texbake.mesh.shapes import plane

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
            "baseColorFactor": RED,
            "baseColorTexture": texture,
            "metallicRoughnessTexture": texture,
        },
        "normalTexture": texture,
        "occlusionTexture": texture,
        "extensions": extensions or {},
    }
    content = {
        **document.content,
        "buffers": [{"byteLength": len(document.binary), "uri": "plane.bin"}],
        "materials": [material],
        "textures": [{"source": 0}],
        "images": [{"uri": uri}],
        **fields,
    }
    content["meshes"][0]["primitives"][0]["material"] = 0
    (folder / "a.gltf").write_text(json.dumps(content))
    return folder / "a.gltf"


SCENE = '[[objects]]\nmesh = "a.gltf"\n'
COMMANDS = {
    "convert": ["convert", "a.gltf", "out.glb"],
    "preview": ["preview", "a.gltf", "-o", "out.png", "--size", "16x16"],
    "scene": ["preview", "scene.toml", "-o", "out.png", "--size", "16x16"],
    "lighten": ["lighten", "a.gltf", "-o", "out.glb", "--size", "16", "--views", "1"],
    "run": ["run", "a.gltf", "-o", "out", "--faces", "4", "--size", "64"],
    "bake": ["bake", "a.gltf", "a.gltf", "-o", "out", "--maps", "base-color", "--size", "16"],
}


@pytest.mark.parametrize("uri", ["gone.png", "../gone.png", "http://example.org/gone.png"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_missing_image_is_one_warning_and_neutral(tmp_path, monkeypatch, command, uri):
    monkeypatch.chdir(tmp_path)
    model(tmp_path, uri)
    (tmp_path / "scene.toml").write_text(SCENE)
    result = CliRunner().invoke(texbake, COMMANDS[command])
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if "keeps its factors" in line]
    assert len(lines) == 1 and "skin: " in lines[0] and "gone.png" in lines[0]
    if (tmp_path / "out.glb").exists():
        mesh = read_mesh(tmp_path / "out.glb")
        (material,) = read_materials(tmp_path / "out.glb", mesh).materials
        assert material.channels["base-color"].image is None
        assert material.channels["base-color"].factor == tuple(RED[:3])


def test_an_image_that_an_option_names_must_be_there(tmp_path):
    write_mesh(plane(), tmp_path / "plane.glb")
    for option in ("--albedo", "--normal-map"):
        out = ["-o", str(tmp_path / "out.png")]
        command = ["preview", str(tmp_path / "plane.glb"), *out, option, "gone.png"]
        result = CliRunner().invoke(texbake, command)
        assert result.exit_code == 1 and "gone.png: there is no such file" in result.stderr


@pytest.mark.parametrize("command", ["convert", "preview", "lighten"])
def test_unread_parts_of_materials_are_named(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    extensions = {
        "KHR_materials_iridescence": {"iridescenceFactor": 1.0},
        "KHR_materials_clearcoat": {
            "clearcoatFactor": 1.0, "clearcoatNormalTexture": {"index": 0},
        },
    }  # fmt: skip
    path = model(
        tmp_path,
        extensions=extensions,
        extensionsUsed=["KHR_materials_iridescence"],
        extensionsRequired=["KHR_materials_iridescence"],
    )
    result = CliRunner().invoke(texbake, COMMANDS[command])
    assert result.exit_code == 0, result.stderr
    assert "KHR_materials_iridescence" in result.stderr
    if command != "preview":  # which shows no clear coat at all
        line = "a.gltf: clearcoatNormalTexture of 1 material is not read"
        assert result.stderr.count(line) == 1
        kept = read_materials(tmp_path / "out.glb", read_mesh(tmp_path / "out.glb"))
        assert kept.materials[0].channels["clearcoat"].factor == (1.0,)
    assert read_mesh(path).n_faces == plane().n_faces
