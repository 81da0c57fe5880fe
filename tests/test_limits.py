"""What a file may make texbake do: images by their headers, and files outside its folder."""

import base64
import json
import os
import re
import struct
import zlib

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake as command

import texbake
from tests.glb import read_glb
from texbake.errors import FileError, FileFormatError, OptionError, ReadWarning
from texbake.limits import (
    ALLOW_OUTSIDE,
    MAX_IMAGE,
    MAX_TRIANGLES,
    allows_outside,
    file_beside,
    is_within,
    most_triangles,
    parse_seconds,
    require_image_size,
    toml_content,
)
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.contents import read_contents
from texbake.mesh.files.mtl import map_name
from texbake.mesh.materials import read_materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import decode_image, image_shape, read_header, read_image, write_image


def large_png():
    """A PNG file that says that it is large, and has no pixels that could be read."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0")),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


@pytest.fixture
def gltf(tmp_path):
    """Write a triangle with a texture as a glTF file that names its buffer and its image."""

    def write(buffer, image):
        folder = tmp_path / "asset"
        folder.mkdir()
        corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        uvs = np.array(corners)[:, :2]
        mesh = Mesh(positions=corners, faces=[[0, 1, 2]], uvs=uvs, uv_faces=[[0, 1, 2]])
        write_mesh(mesh, tmp_path / "mesh.glb")
        document, data = read_glb(tmp_path / "mesh.glb")
        for path in (folder / "mesh.bin", tmp_path / "mesh.bin"):
            path.write_bytes(data)
        for path in (folder / "wood.png", tmp_path / "secret.png"):
            write_image(np.full((4, 4, 3), 0.5, np.float32), path, color=True)
        inside = "data:;base64," + base64.b64encode(data).decode()
        document["buffers"][0]["uri"] = inside if buffer == "data" else buffer
        document["images"] = [{"uri": image}]
        document["textures"] = [{"source": 0}]
        document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        document["meshes"][0]["primitives"][0]["material"] = 0
        path = folder / "wood.gltf"
        path.write_text(json.dumps(document))
        return path

    return write


@pytest.mark.parametrize(("width", "height", "n_channels"), [(16384, 16384, 4), (65536, 4096, 3)])
def test_the_largest_images_fit_and_larger_ones_do_not(width, height, n_channels):
    require_image_size("a.png", width, height, n_channels)
    with pytest.raises(FileFormatError, match="more than 16384 x 16384"):
        require_image_size("a.png", width, height + 1, n_channels)


@pytest.mark.parametrize("read", [read_header, lambda path: read_image(path, color=False)])
def test_large_images_are_refused_by_their_headers(tmp_path, read):
    (tmp_path / "large.png").write_bytes(large_png())
    with pytest.raises(FileFormatError, match=r"20000 x 20000 pixels of 1 channel, .* 20000"):
        read(tmp_path / "large.png")


@pytest.mark.parametrize("read", [image_shape, lambda *a: decode_image(*a, color=True)])
def test_large_images_in_other_files_are_refused(read):
    with pytest.raises(FileFormatError, match="large: it has 20000 x 20000 pixels"):
        read(large_png(), "large")


def test_an_image_may_be_large_if_the_user_says_so(tmp_path, monkeypatch):
    monkeypatch.delenv(MAX_IMAGE, raising=False)
    monkeypatch.chdir(tmp_path)
    write_image(np.zeros((8, 8), np.float32), "height.png")
    line = ["height-to-normal", "height.png", "-o", "n.png"]
    assert CliRunner().invoke(command, ["--max-image", "7", *line]).exit_code == 1
    assert CliRunner().invoke(command, ["--max-image", "8", *line]).exit_code == 0


@pytest.mark.parametrize(("place", "within"), [
    ("a/b.png", True), ("a/../b.png", True), ("./b.png", True), ("../a/b.png", True),
    ("../b.png", False), ("/etc/passwd", False), ("a/../../b.png", False),
])  # fmt: skip
def test_files_beside_another(tmp_path, monkeypatch, place, within):
    monkeypatch.delenv(ALLOW_OUTSIDE, raising=False)
    folder = tmp_path / "a"
    assert is_within(folder, folder / place) is within
    if within:
        assert file_beside(folder / "x.gltf", place) == folder / place
    else:
        with pytest.raises(FileError, match="outside its folder"):
            file_beside(folder / "x.gltf", place)


@pytest.mark.parametrize("name", ["../mesh.bin", "%2e%2e/mesh.bin", "ABSOLUTE"])
def test_buffers_of_gltf_stay_in_the_folder(gltf, tmp_path, monkeypatch, name):
    name = str(tmp_path / "mesh.bin") if name == "ABSOLUTE" else name
    path = gltf(name, "wood.png")
    for read in (read_mesh, read_scene):
        with pytest.raises(FileError, match=r"outside its folder; .* --allow-outside"):
            read(path)
    monkeypatch.setenv(ALLOW_OUTSIDE, "1")
    assert read_mesh(path).n_faces == 1


def test_images_of_gltf_stay_in_the_folder(gltf, monkeypatch):
    path = gltf("data", "../secret.png")
    materials = read_materials(path, read_mesh(path))
    assert materials.materials[0].channels["base-color"].image is None
    assert "outside its folder" in str(materials.missing)
    with pytest.warns(ReadWarning, match="outside its folder"):
        assert not isinstance(read_scene(path).objects[0].material.base_color, ImageTexture)
    monkeypatch.setenv(ALLOW_OUTSIDE, "1")
    materials = read_materials(path, read_mesh(path))
    assert materials.materials[0].channels["base-color"].image is not None


@pytest.mark.parametrize("library", ["../wood.mtl", "wood.mtl"])
def test_materials_of_obj_stay_in_the_folder(tmp_path, monkeypatch, library):
    folder = tmp_path / "asset"
    folder.mkdir()
    write_mesh(uv_sphere(6, 6), folder / "ball.obj")
    text = (folder / "ball.obj").read_text()
    (folder / "ball.obj").write_text(f"mtllib {library}\nusemtl wood\n" + text)
    image = "../secret.png" if library == "wood.mtl" else "secret.png"
    (folder / library).write_text(f"newmtl wood\nmap_Kd {image}\n")
    write_image(np.full((4, 4, 3), 0.5, np.float32), tmp_path / "secret.png", color=True)

    def has_image():
        materials = read_materials(folder / "ball.obj", read_mesh(folder / "ball.obj"))
        channels = [material.channels.get("base-color") for material in materials.materials]
        return any(channel is not None and channel.image is not None for channel in channels)

    assert not has_image()
    assert not any(read_contents(folder / "ball.obj").images.values())
    monkeypatch.setenv(ALLOW_OUTSIDE, "1")
    assert has_image()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes")
def test_an_image_that_is_a_pipe_does_not_wait(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    for read in (read_header, lambda path: texbake.read_image(path, color=True)):
        with pytest.raises(FileError, match="not a regular file"):
            read(tmp_path / "pipe.png")


@pytest.fixture
def with_images(gltf):
    """Write a glTF file whose triangles have one material for each image of a list."""

    def write(images, views=(), buffers=()):
        path = gltf("data", "wood.png")
        document = json.loads(path.read_text())
        n = len(images)
        document["images"] = images
        document["textures"] = [{"source": i} for i in range(n)]
        document["materials"] = [
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}} for i in range(n)
        ]
        (primitive,) = document["meshes"][0]["primitives"]
        document["meshes"][0]["primitives"] = [{**primitive, "material": i} for i in range(n)]
        document["bufferViews"] += views
        document["buffers"] += buffers
        path.write_text(json.dumps(document))
        return path

    return write


def test_one_file_that_many_images_name_is_one_image(with_images):
    names = ["wood.png", "./wood.png", "../asset/wood.png", "%77ood.png", ".//wood.png"]
    path = with_images([{"uri": name} for name in names])
    materials = read_materials(path, read_mesh(path))
    assert {m.channels["base-color"].image.name for m in materials.materials} == {
        f"{path}: images[0]"
    }


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x = 1\n" * 700_000, "4,200,000 characters, more than 4,000,000; divide a pipeline"),
        ("x = " + "[" * 100_000, "it is not TOML: maximum recursion depth"),
        ("x = " + "9" * 5000, "it is not TOML: Exceeds the limit"),
        ("x = [{a = 0x" + "f" * 5000 + "}]", "it is not TOML: an integer has more than 64 bits"),
    ],
    ids=["long", "nested", "number", "hexadecimal"],
)
def test_toml_that_would_take_long_is_refused(text, complaint):
    with pytest.raises(FileFormatError, match=re.escape(complaint)):
        toml_content("a.toml", text)


def test_toml_that_is_unusual_is_read():
    assert (
        toml_content("a.toml", "a = -9_223_372_036_854_775_808\nb = 0x7fff_ffff_ffff_ffff")["b"]
        == 2**63 - 1
    )
    text = "x" * 1_000_000 + " = '" + "a" * 1_000_000 + "'\n" + ".".join(["a"] * 64) + " = 1\r\n"
    assert len(toml_content("a.toml", text + "b = '" + "1.2 " * 99 + "'")) == 3


def test_tiles_count_as_much_as_the_image(tmp_path):
    tile, n = 1 << 15, 64
    tags = [(256, 8), (257, 8), (258, 8), (259, 1), (262, 1), (277, 1), (322, tile), (323, tile)]
    tags += [(324, 200), (325, n)]
    path = tmp_path / "a.tif"

    def write():
        rows = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
        head = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + rows + bytes(4)
        path.write_bytes(head.ljust(200, b"\0") + bytes(n))

    write()
    with pytest.raises(FileFormatError, match=r"a\.tif: it has 32768 x 32768 pixels"):
        read_header(path)
    tags[6:8] = [(322, 16), (323, 16)]
    tags[-1], n = (325, 256), 256
    write()
    assert read_image(path, color=False).pixels.shape == (8, 8, 1)


@pytest.mark.parametrize(
    ("width", "height", "n_channels"),
    [(16385, 16384, 1), (8192, 8192, 17), (1 << 20, 1 << 20, 1), (65537, 4096, 3)],
)
def test_the_side_that_is_named_is_the_least_that_suffices(width, height, n_channels, monkeypatch):
    with pytest.raises(FileFormatError, match=r"a\.png: it has .* --max-image \d+") as refused:
        require_image_size("a.png", width, height, n_channels)
    side = int(str(refused.value).rpartition(" ")[2])
    monkeypatch.setenv(MAX_IMAGE, str(side))
    require_image_size("a.png", width, height, n_channels)
    monkeypatch.setenv(MAX_IMAGE, str(side - 1))
    with pytest.raises(FileFormatError):
        require_image_size("a.png", width, height, n_channels)


@pytest.mark.parametrize("text", ["many", "-1", "1" * 5000])
@pytest.mark.parametrize(("variable", "read"), [
    (MAX_IMAGE, lambda: require_image_size("a.png", 1, 1, 1)),
    (MAX_TRIANGLES, lambda: most_triangles(9)),
    (ALLOW_OUTSIDE, allows_outside),
])  # fmt: skip
def test_a_variable_with_another_value_is_one_line(variable, read, text, monkeypatch):
    monkeypatch.setenv(variable, text)
    with pytest.raises(OptionError, match=rf"^{variable}: '[^\n]{{1,100}} is n[^\n]*$"):
        read()


def test_an_image_of_no_pixel_is_no_limit(monkeypatch):
    monkeypatch.setenv(MAX_IMAGE, "0")
    with pytest.raises(OptionError, match=f"^{MAX_IMAGE}: '0' is not a number of pixels"):
        require_image_size("a.png", 1, 1, 1)


def test_any_number_of_options_may_stand_before_the_name_of_a_map():
    assert map_name("-cc on -s 1 2 wood oak.png") == ("wood oak.png", "repeat")
    assert map_name("-clamp on " * 100 + "a.png") == ("a.png", "clamp")


@pytest.mark.parametrize(("word", "seconds"), [
    ("20s", 20.0), ("500ms", 0.5), ("2min", 120.0), ("1h", 3600.0), (3, 3.0), (" 1.5 ", 1.5),
    (" 3 s", 3.0),
])  # fmt: skip
def test_units_of_durations(word, seconds):
    assert parse_seconds(word) == seconds


@pytest.mark.parametrize("word", ["0s", "-1", "later", "", "inf", "nan", "s", "20 seconds", None])
def test_invalid_durations(word):
    with pytest.raises(OptionError, match=r"time_budget: .* is not a duration"):
        parse_seconds(word)
