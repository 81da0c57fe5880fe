"""Whatever is wrong with a mesh file, it is read, or refused in one line that begins with its path.

One table of faults for all formats, then files that are cut or damaged at random.
"""

import base64
import json
import random
import re
import struct
from functools import partial

import numpy as np
import pytest

from tests.fbx_writer import binary, rich_scene, scene, written
from tests.glb import read_glb
from tests.mesh.test_ply import ORDERS, POINTS, POLYGON, XYZ, ply
from texbake.errors import FileError, FileFormatError, MeshError, TexbakeError, heard_warnings
from texbake.mesh.files import MESH_SUFFIXES, read_mesh, write_mesh
from texbake.mesh.mesh import Mesh

MESH = Mesh(
    positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]],
    uvs=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], uv_faces=[[0, 1, 2], [4, 2, 3]],
    normals=[[0, 0, 1], [0, 1, 0]], normal_faces=[[0, 0, 0], [1, 1, 1]],
)  # fmt: skip
CONTENTS = {
    "nothing": b"",
    "a picture": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + random.Random(0).randbytes(4000),
    "a letter": b"Dear reader,\nfind attached the mesh.\n", "zeros": bytes(300),
    "ones": b"\xff" * 300, "the head of GLB": b"glTF" + bytes(60), "the head of ZIP": b"PK\x03\x04",
    "the head of FBX": b"Kaydara FBX Binary  \0\x1a\0", "JSON": b'{"asset": 3}',
    "XML": b"<COLLADA/>",
}  # fmt: skip


def text_gltf(folder):
    write_mesh(MESH, folder / "a.glb")
    document, data = read_glb(folder / "a.glb")
    buffer = base64.b64encode(data).decode()
    document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{buffer}"
    return json.dumps(document).encode()


def written_by_us(suffix):
    def content(folder):
        write_mesh(MESH, folder / f"a{suffix}")
        return (folder / f"a{suffix}").read_bytes()

    return content


# Sound files by their kinds: the suffix, what makes one, and whether a part of it is never sound.
KINDS = {
    **{suffix: (suffix, written_by_us(suffix), True) for suffix in (".ply", ".stl", ".glb")},
    **{suffix: (suffix, written_by_us(suffix), False) for suffix in (".obj", ".off")},
    ".gltf": (".gltf", text_gltf, True),
    "binary FBX": (".fbx", lambda _: binary(rich_scene(7400)), False),
    "FBX 7.5": (".fbx", lambda _: binary(rich_scene(7500), 7500), False),
    "FBX text": (".fbx", lambda _: written(rich_scene(7400), 7400, "ascii"), False),
}


def refusal(path, content):
    """Read a file; return the error, which is one line about the file, or None."""
    path.write_bytes(content)
    try:
        with heard_warnings(lambda line: None):
            read_mesh(path)
    except TexbakeError as error:
        assert isinstance(error, FileError | MeshError)
        assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
        return error
    return None


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_another_file_with_the_suffix_of_a_mesh_is_refused(tmp_path, suffix):
    is_slow = suffix not in {known for known, _, _ in KINDS.values()}  # a process reads each
    for name in ("nothing", "a letter", "ones") if is_slow else CONTENTS:
        error = refusal(tmp_path / f"a{suffix}", CONTENTS[name])
        assert isinstance(error, FileFormatError | MeshError), name


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_cut_anywhere_is_refused_or_read(tmp_path, kind):
    suffix, make, is_whole = KINDS[kind]
    content = make(tmp_path).rstrip(b"\n") if suffix != ".glb" else make(tmp_path)
    assert refusal(tmp_path / f"cut{suffix}", content) is None
    lengths = [*range(min(64, len(content))), *range(64, len(content), len(content) // 60 + 1)]
    errors = [refusal(tmp_path / f"cut{suffix}", content[:n]) for n in lengths]
    assert all(errors[:10])
    assert not is_whole or all(errors)


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
VERTICES = "0 0 0\n1 0 0\n1 1 0.5\n0 1 0\n"
FACES = "3 0 1 2\n4 0 1 2 3\n"
FACET = (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
)
TRIANGLE = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
FBX_TEXT = written(scene(), 7400, "ascii")
FAULTS = {
    ".obj": [
        ("f 1 2 3\n", "not an OBJ file"),
        (SQUARE, "no faces"),
        *((SQUARE + f"f 1 2 {word}\n", "line 5: an index is out of range")
          for word in ("5", "0", "-5", "3/1", "99999999999999999999")),
        *((SQUARE + f"f 1 2 {word}\n", "line 5: a corner is none of")
          for word in ("a", "3.5", "3/1/1/1", "-")),
        ("v 0 0 0\nv 1 0\nf 1 2 1\n", "line 2: .*v needs 3"),
        ("v 0 0 0\nv 1 0 0x\nf 1 2 1\n", "line 2: '0x' is not a number"),
        *((SQUARE + f"v 0 {word} 0\nf 1 2 5\n", "line 5: .*not finite")
          for word in ("nan", "inf", "-inf", "1e999", "1.#QNAN")),
    ],
    ".off": [
        *((text, "not an OFF file") for text in ("OFF\n", "OFF\n4\n", "OFF\n-4 2 0\n")),
        ("hello\n", "'hello' is not a number"),
        *((text, "convert it to ASCII") for text in ("OFF BINARY\n\x01", "4OFF\n4 2 0\n")),
        ("OFF\n4 3 0\n" + VERTICES + FACES, "truncated"),
        ("OFF\n1000000000 2 0\n" + VERTICES + FACES, "truncated"),
        ("OFF\n1000000000000 2 0\n" + VERTICES + FACES, "too large"),
        ("OFF\n4 2 0\n" + VERTICES + "3 0 1 2\n4 0 1 2\n", "fewer indices"),
        ("OFF\n4 2 0\n" + VERTICES + "3 0 1 2\n2.5 0 1 2\n", "fewer indices"),
        ("OFF\n4 1 0\n" + VERTICES + "3 0 1 0.5\n", "whole number"),
        ("OFF\n4 2 0\n0 0\n" + VERTICES[6:] + FACES, "a vertex has 2 numbers"),
        ("COFF\n4 2 0\n" + VERTICES + FACES, "a vertex has 3 numbers"),
        *(("OFF\n4 1 0\n" + VERTICES + f"3 0 1 {index}\n", "a position index is out of range")
          for index in ("4", "-1", "9999999999")),
        ("OFF\n4 2 0\n" + VERTICES.replace("0.5", "nan") + FACES, "not finite"),
        *((text, "no faces") for text in
          ("OFF\n0 0 0\n", "OFF\n4 0 0\n" + VERTICES, "OFF\n4 1 0\n" + VERTICES + "2 0 1\n")),
    ],
    ".stl": [
        *((f"solid\n{FACET.replace('vertex 0 1 0', 'vertex ' + numbers)}endsolid\n", message)
          for numbers, message in (("0 1", "no whole triangles"), ("0 nan 0", "not finite"),
                                   ("0 x 0", "line 6: 'x' is not a number"))),
        (f"solid\n{FACET}", "does not end with 'endsolid'"),
        *((content, "no faces") for content in (bytes(84), "solid a\nendsolid a\n")),
        (bytes(80) + b"\1\0\0\0" + TRIANGLE.replace(b"\x80\x3f", b"\x80\x7f"), "not finite"),
        *((bytes(80) + count + TRIANGLE, "truncated") for count in (b"\2\0\0\0", b"\xff" * 4)),
    ],
    ".fbx": [
        (FBX_TEXT[: FBX_TEXT.index(b"Geometry")], r"line \d+: it ends within 'Objects'"),
        (FBX_TEXT.replace(b"GlobalSettings", b"!!\nGlobalSettings"), "line 4: '!!' stands where"),
        ("solid cube\n", "not an FBX file"),
        *((binary(rich_scene(7400))[:n], r"a\.fbx: byte \d+: ") for n in (24, 100, 1000)),
    ],
}  # fmt: skip


def ply_of(order, *faces, kind=POLYGON, points=POINTS):
    return ply(order, [("vertex", XYZ, points), ("face", kind, [(face,) for face in faces])])


def ply_faults():
    """Faults of PLY files of each order of bytes."""
    head = [("vertex", XYZ, POINTS)]
    other = ("other", [("int", "a")], [(1,)])
    for order in ORDERS:
        polygons = partial(ply_of, order)
        for index in (4, 1000, -1):
            yield polygons([0, 1, index], [0, 2, 3]), "a position index is out of range"
        unsigned = [("uchar", "uint", "vertex_indices")]
        yield polygons([0, 1, 2**32 - 1], kind=unsigned), "a position index is out of range"
        for value in (float("nan"), float("inf")):
            yield polygons([0, 1, 2], [0, 2, 3], points=[*POINTS[:3], (0, value, 0)]), "not finite"
        for content in (ply(order, head), polygons(), polygons([0, 1])):
            yield content, "no faces"
        sound = ply(order, [other, *head, ("face", POLYGON, [([0, 1, 2],)])])
        for name in (b"other", b"vertex", b"face"):  # would take terabytes
            claim = re.sub(rb"element %s \d" % name, b"element %s 1000000000000" % name, sound)
            yield claim, "truncated or damaged"
    content = polygons([0, 1, 2], kind=[("uint", "int", "vertex_indices")])
    for count in (100, 2**31, 2**32 - 1):
        yield content[:-16] + struct.pack(">I", count) + content[-12:], "truncated or damaged"
    yield ply("ascii", [*head, ("face", POLYGON, [([0, 1, 1.5],)])]), "whole number"
    little = ply(ORDERS[1], [*head, ("face", POLYGON, [([0, 1, 2],)])])
    signaling = little.replace(np.float32(0.5).tobytes(), b"\x01\0\x80\x7f")
    yield signaling, "not finite"
    for statement in (
        "format binary_middle_endian 1.0", "element vertex -1", "element vertex many",
        "property float", "property half x", "property list float int i", "nonsense",
    ):  # fmt: skip
        broken = little.replace(b"obj_info none", statement.encode())
        yield broken, "line 4: .*is not a statement of a PLY header"


FAULTS[".ply"] = [*ply_faults()]


@pytest.mark.parametrize("suffix", FAULTS)
def test_faults_are_named(tmp_path, suffix):
    for content, message in FAULTS[suffix]:
        path = tmp_path / f"a{suffix}"
        error = refusal(path, content if isinstance(content, bytes) else content.encode())
        assert error is not None, content
        assert re.search(message, str(error)), (content, str(error))


WORDS = [b"-1", b"999999999999", b"1e999", b"nan", b"\\", b"\n", b"/", b"-", b".", b"\x00"]


def mutated(content, rng):
    content = bytearray(content)
    for _ in range(rng.randint(1, 5)):
        at = rng.randrange(len(content) + 1)
        match rng.randrange(5):
            case 0 if at < len(content):
                content[at] = rng.randrange(256)
            case 1:
                del content[at : at + rng.randint(1, 8)]
            case 2:
                content[at:at] = rng.choice(WORDS)
            case 3:
                content[at : at + 4] = b"\xff\xff\xff\x7f"
            case _:
                content[at:at] = content[: rng.randrange(30)]
    return bytes(content)


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_refused_or_read(tmp_path, kind):
    suffix, make, _ = KINDS[kind]
    content, rng = make(tmp_path), random.Random(kind)
    errors = [refusal(tmp_path / f"bad{suffix}", mutated(content, rng)) for _ in range(400)]
    assert sum(error is not None for error in errors) > 50
