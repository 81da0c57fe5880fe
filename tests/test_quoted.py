"""What messages quote of a file: a few characters, whatever it holds."""

import copy
import json
from pathlib import Path

import pytest

from texbake import TexbakeError, read_mesh, read_scene
from texbake.errors import quoted, shortened
from texbake.mesh.files.contents import read_contents
from texbake.mesh.materials import read_materials

LONG = "A" * 3000
MOST = 420  # characters of a message: two quotes, and what is said about them
DOCUMENT = {
    "asset": {"version": "2.0"},
    "extensionsRequired": ["KHR_lights_punctual"],
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "translation": [0, 0, 0], "children": [1]}, {"camera": 0}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
    "meshes": [{"name": "m", "primitives": [{"material": 0, "attributes": {"POSITION": 0}}]}],
    "materials": [
        {"alphaMode": "OPAQUE", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    ],
    "textures": [{"source": 0, "sampler": 0}],
    "samplers": [{"wrapS": 10497}],
    "images": [{"uri": "no.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:;base64," + "AAAA" * 12}],
}
VALUES = [
    LONG, [LONG], {LONG: LONG}, 10**3000, "../" + LONG, "TEXCOORD_" + "9" * 5000, "data:" + LONG,
]  # fmt: skip
SCENE = """
name = "scene"
[camera]
position = [1, 2, 3]
fov = 40
[[objects]]
shape = "sphere"
material = {base_color = "#ffffff", roughness = 0.5}
"""


def places(node, place=()):
    """Yield where each value of a document stands."""
    items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in items:
        yield (*place, key)
        if isinstance(value, dict | list):
            yield from places(value, (*place, key))


def damaged(place, value):
    """Yield a document with another value at a place, and one with another key."""
    for is_key in False, True:
        content = copy.deepcopy(DOCUMENT)
        owner = content
        for key in place[:-1]:
            owner = owner[key]
        if not is_key:
            owner[place[-1]] = value
        elif isinstance(owner, dict) and isinstance(value, str):
            owner[value] = owner.pop(place[-1])
        yield content


def messages(read, path):
    """Yield the error of a reader, or the notes of what it read."""
    try:
        found = read(path)
    except TexbakeError as error:
        yield str(error)
    else:
        yield from getattr(found, "missing", ())
        notes = getattr(found, "notes", ())
        yield from () if callable(notes) else notes


def materials(path):
    return read_materials(path, read_mesh(path))


@pytest.mark.parametrize("value", VALUES, ids=lambda value: f"{str(value)[:12]}")
def test_no_message_about_a_gltf_file_is_long(tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    path = Path("a.gltf")
    for place in places(DOCUMENT):
        for content in damaged(place, value):
            path.write_text(json.dumps(content))
            for read in read_contents, materials, read_scene:
                for message in messages(read, path):
                    assert len(str(message)) <= MOST, place


@pytest.mark.parametrize(
    "value", [LONG, f'"{LONG}"', "9" * 5000, "0x" + "f" * 3000, "[" * 3000], ids=lambda v: v[:3]
)
def test_no_message_about_a_scene_file_is_long(tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    path = Path("a.toml")
    for word in SCENE.translate(str.maketrans('[]{},"=', " " * 7)).split():
        path.write_text(SCENE.replace(word, value, 1))
        for message in messages(read_scene, path):
            assert len(message) <= MOST, word


@pytest.mark.parametrize("line", ["newmtl {}", "map_Kd {}", "Kd {}", "map_Kd -s {} a.png"])
def test_no_message_about_a_material_library_is_long(tmp_path, monkeypatch, line):
    monkeypatch.chdir(tmp_path)
    path = Path("a.obj")
    path.write_text(
        f"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\nusemtl {LONG}\nf 3 2 1\n"
    )
    Path("a.mtl").write_text(f"newmtl m\nNs 1\n{line.format(LONG)}\nnorm no.png\n")
    found = list(messages(materials, path))
    assert found
    assert all(len(str(message)) <= MOST for message in found)


def test_what_is_short_stays_as_it_is():
    assert quoted("wood") == "'wood'"
    assert shortened("a" * 60) == "a" * 60
    assert shortened("a" * 61) == "a" * 38 + "..." + "a" * 19


def test_lists_in_lists_are_not_followed_for_ever():
    nested = []
    for _ in range(100_000):
        nested = [nested]
    assert quoted(nested) == "a deeply nested value"
