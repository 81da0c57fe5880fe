"""Primitives of glTF files that are read together: bit for bit what each alone gives."""

import json

import numpy as np
import pytest

from tests.glb import GltfFile
from texbake.errors import MeshError, heard_warnings
from texbake.mesh.files import gltf_primitives, read_mesh
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_primitives import PrimitiveRequest, read_primitives
from texbake.verbs.info import info_file


class _Writer(GltfFile):
    """Writes arrays at any byte; now and then their rows are far apart."""

    alignment = 1

    def __init__(self, random):
        super().__init__()
        self.random = random
        self.data = b"abc"

    def add(self, values, **more):
        n_row = values.itemsize * values.shape[1]
        stride = n_row + int(self.random.choice([0, 0, 5]))
        rows = np.zeros((len(values), stride), np.uint8)
        rows[:, :n_row] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1)
        view = self.view(rows.tobytes(), **({"byteStride": stride} if stride != n_row else {}))
        return self.accessor(values, values.dtype.char, bufferView=view, **more)

    def document(self, tmp_path, primitives):
        self.json["meshes"] = [{"primitives": [one]} for one in primitives]
        return read_document(self.write(tmp_path / "many.gltf"))


def _primitive(writer, kind):
    """Write a primitive of one of some kinds, with vertices of which several are at one place."""
    random = writer.random
    n = 3 * int(random.integers(1, 6))
    positions = random.integers(-1, 2, (n, 3)).astype("<f4") * np.float32(-1.0)
    attributes = {"POSITION": writer.add(positions)}
    if kind % 2:
        normals = random.integers(-127, 128, (n, 3)).astype("i1")
        attributes["NORMAL"] = writer.add(normals, normalized=True)
        colors = random.integers(0, 2, (n, 3 + kind % 4 // 3)).astype("u1")
        attributes["COLOR_0"] = writer.add(colors, normalized=True)
    if kind % 3:
        attributes["TEXCOORD_0"] = writer.add(random.random((n, 2)).astype("<f4"))
        attributes["TEXCOORD_1"] = writer.add(random.random((n, 2)).astype("<f4"))
        attributes["TANGENT"] = writer.add(random.random((n, 4)).astype("<f4"))
    primitive: dict = {"attributes": attributes}
    if kind % 5:
        indices = random.integers(0, n, (3 * int(random.integers(1, 6)), 1))
        primitive["indices"] = writer.add(indices.astype(("<u2", "<u4")[kind % 2]))
    return primitive


def _arrays(piece):
    """Types, shapes and bytes of all arrays of a piece."""
    arrays = [*vars(piece).values(), *(item.uvs for item in piece.uv_sets.values())]
    return [(a.dtype, a.shape, a.tobytes()) for a in arrays if isinstance(a, np.ndarray)]


@pytest.mark.parametrize("keeps_colors", [False, True])
@pytest.mark.parametrize("uv_set", [0, 1])
@pytest.mark.parametrize("rows_at_once", [1 << 18, 64])
def test_all_are_what_each_alone_gives(tmp_path, monkeypatch, keeps_colors, uv_set, rows_at_once):
    monkeypatch.setattr(gltf_primitives, "_ROWS_AT_ONCE", rows_at_once)
    writer = _Writer(np.random.default_rng(uv_set))
    primitives = [_primitive(writer, kind) for kind in list(range(30)) * 4]
    document = writer.document(tmp_path, primitives)
    requests = [PrimitiveRequest(one, uv_set, (1 - uv_set,)) for one in primitives]
    together = read_primitives(document, requests, keeps_colors=keeps_colors)
    for request, piece in zip(requests, together, strict=True):
        (alone,) = read_primitives(document, [request], keeps_colors=keeps_colors)
        assert _arrays(piece) == _arrays(alone)


def test_what_is_not_finite_in_one_changes_no_other(tmp_path):
    writer = _Writer(np.random.default_rng(6))
    primitives = [_primitive(writer, 5) for _ in range(4)]
    requests = [PrimitiveRequest(one) for one in primitives]
    sound = read_primitives(writer.document(tmp_path, primitives), requests[:3])
    attributes = primitives[3]["attributes"]
    n = writer.json["accessors"][attributes["NORMAL"]]["count"]
    bad = attributes["NORMAL"] = writer.add(np.full((n, 3), np.nan, "<f4"))
    document = writer.document(tmp_path, primitives)
    heard: list[str] = []
    with heard_warnings(heard.append):
        *others, last = read_primitives(document, requests)
    assert [_arrays(one) for one in others] == [_arrays(one) for one in sound]
    assert not last.normals.any()
    assert f"{n} of {n} normals are not finite" in heard[0]
    requests.append(PrimitiveRequest({"attributes": {"POSITION": bad}}))
    with pytest.raises(MeshError, match="a value of POSITION is not finite"):
        read_primitives(document, requests)


def test_info_parses_a_file_once(tmp_path, monkeypatch):
    writer = _Writer(np.random.default_rng(8))
    document = writer.document(tmp_path, [_primitive(writer, 1)])
    texts = []
    parse = json.loads
    monkeypatch.setattr(json, "loads", lambda text: (texts.append(text), parse(text))[1])
    info_file(document.path)
    assert len(texts) == 1
    read_mesh(document.path)  # the file may have changed since
    assert len(texts) == 2
