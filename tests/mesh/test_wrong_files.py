"""Whatever is wrong with a mesh file, it is read, or refused in one line that begins with its path.

One table for all formats. What a reader says of a certain fault is in the tests of its format.
"""

import base64
import json
import random
import struct

import pytest

from tests.hard_cases.fbx_writer import binary, rich_scene, written
from texbake.errors import FileError, FileFormatError, MeshError, TexbakeError, heard_warnings
from texbake.mesh.files import MESH_SUFFIXES, read_mesh, write_mesh
from texbake.mesh.mesh import Mesh

MESH = Mesh(
    positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]],
    faces=[[0, 1, 2], [0, 2, 3]],
    uvs=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]],
    uv_faces=[[0, 1, 2], [4, 2, 3]],
    normals=[[0, 0, 1], [0, 1, 0]],
    normal_faces=[[0, 0, 0], [1, 1, 1]],
)
CONTENTS = {
    "nothing": b"",
    "a picture": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + random.Random(0).randbytes(4000),
    "a letter": b"Dear reader,\nfind attached the mesh.\n",
    "zeros": bytes(300),
    "ones": b"\xff" * 300,
    "the head of GLB": b"glTF" + bytes(60),
    "the head of ZIP": b"PK\x03\x04",
    "the head of FBX": b"Kaydara FBX Binary  \0\x1a\0",
    "JSON": b'{"asset": 3}',
    "XML": b"<COLLADA/>",
}


def text_gltf(folder):
    """A .gltf file with its buffer in it."""
    write_mesh(MESH, folder / "a.glb")
    data = (folder / "a.glb").read_bytes()
    n_text = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + n_text])
    buffer = base64.b64encode(data[28 + n_text :]).decode()
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
        assert str(error).startswith(f"{path}: ")
        assert "\n" not in str(error)
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
