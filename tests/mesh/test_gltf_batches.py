"""Primitives of glTF files that are read together: bit for bit what each alone gives."""

import json
from dataclasses import fields

import numpy as np
import pytest

from texbake.errors import TexbakeError
from texbake.jobs.meshes import info_file
from texbake.mesh.files import gltf, gltf_batches, read_mesh
from texbake.mesh.files.gltf_batches import Wanted, read_primitives
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_primitives import PrimitiveMesh, read_primitive

_FLOAT, _BYTE, _UBYTE, _SHORT, _UINT = 5126, 5120, 5121, 5123, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class _Writer:
    """Collects arrays in two buffers, as the accessors of a document."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        self.buffers = [bytearray(b"abc"), bytearray()]  # no number stands at a multiple of 4
        self.views: list[dict] = []
        self.accessors: list[dict] = []

    def add(self, values: np.ndarray, component: int, **more) -> int:
        """Add an array; now and then its rows are far apart."""
        number = int(self.random.integers(2))
        n_row = values.itemsize * values.shape[1]
        stride = n_row + int(self.random.choice([0, 0, 5]))
        rows = np.zeros((len(values), stride), np.uint8)
        rows[:, :n_row] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1)
        view = {"buffer": number, "byteOffset": len(self.buffers[number]), "byteLength": rows.size}
        if stride != n_row:
            view["byteStride"] = stride
        self.buffers[number] += rows.tobytes()
        self.views.append(view)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(values),
                "type": _TYPES[values.shape[1]],
                **more,
            }
        )
        return len(self.accessors) - 1

    def document(self, tmp_path, primitives: list[dict]) -> Document:
        data = [bytes(buffer) for buffer in self.buffers]
        for number, content in enumerate(data):
            (tmp_path / f"{number}.bin").write_bytes(content)
        content = {
            "asset": {"version": "2.0"},
            "buffers": [
                {"byteLength": len(content), "uri": f"{i}.bin"} for i, content in enumerate(data)
            ],
            "bufferViews": self.views,
            "accessors": self.accessors,
            "meshes": [{"primitives": [one]} for one in primitives],
        }
        path = tmp_path / "many.gltf"
        path.write_text(json.dumps(content))
        return Document(path, content, np.zeros(0, np.uint8))


def _primitive(writer: _Writer, kind: int) -> dict:
    """Write a primitive of one of some kinds, with vertices of which several are at one place."""
    random = writer.random
    n = 3 * int(random.integers(1, 6))
    positions = random.integers(-1, 2, (n, 3)).astype("<f4") * np.float32(-1.0)
    attributes = {"POSITION": writer.add(positions, _FLOAT)}
    if kind % 2:
        normals = random.integers(-127, 128, (n, 3)).astype("i1")
        attributes["NORMAL"] = writer.add(normals, _BYTE, normalized=True)
        colors = random.integers(0, 2, (n, 3 + kind % 4 // 3)).astype("u1")
        attributes["COLOR_0"] = writer.add(colors, _UBYTE, normalized=True)
    if kind % 3:
        attributes["TEXCOORD_0"] = writer.add(random.random((n, 2)).astype("<f4"), _FLOAT)
        attributes["TEXCOORD_1"] = writer.add(random.random((n, 2)).astype("<f4"), _FLOAT)
        attributes["TANGENT"] = writer.add(random.random((n, 4)).astype("<f4"), _FLOAT)
    primitive: dict = {"attributes": attributes}
    if kind % 5:
        dtype, component = (("<u2", _SHORT), ("<u4", _UINT))[kind % 2]
        indices = random.integers(0, n, (3 * int(random.integers(1, 6)), 1)).astype(dtype)
        primitive["indices"] = writer.add(indices, component)
    return primitive


def _assert_same(a: PrimitiveMesh, b: PrimitiveMesh) -> None:
    for field in fields(PrimitiveMesh):
        values = getattr(a, field.name), getattr(b, field.name)
        for one, other in (
            zip(*(rows.values() for rows in values), strict=True)
            if field.name == "further_uvs"
            else [values]
        ):
            assert (one is None) == (other is None), field.name
            if one is not None:
                assert (one.dtype, one.shape) == (other.dtype, other.shape), field.name
                assert one.tobytes() == other.tobytes(), field.name


@pytest.mark.parametrize("keeps_colors", [False, True])
@pytest.mark.parametrize("uv_set", [0, 1])
@pytest.mark.parametrize("rows_at_once", [1 << 18, 64])
def test_all_are_what_each_alone_gives(tmp_path, monkeypatch, keeps_colors, uv_set, rows_at_once):
    monkeypatch.setattr(gltf_batches, "_ROWS_AT_ONCE", rows_at_once)
    writer = _Writer(np.random.default_rng(uv_set))
    primitives = [_primitive(writer, kind) for kind in list(range(30)) * 4]
    document = writer.document(tmp_path, primitives)
    wanted = [Wanted(one, uv_set, (1 - uv_set,)) for one in primitives]
    found = read_primitives(document, wanted, keeps_colors=keeps_colors)
    n_alone = found.count(None)  # of what is read at once
    assert n_alone == 0 if rows_at_once > 64 else 0 < n_alone < 60
    for one, primitive in zip(found, primitives, strict=True):
        if one is None:
            continue
        alone = read_primitive(
            document, primitive, uv_set=uv_set, further=(1 - uv_set,), keeps_colors=keeps_colors
        )
        _assert_same(one, alone)


def _faults(document: Document, primitive: dict) -> list[dict]:
    """Primitives like one, each with something that is not plain, or wrong."""
    accessors, views = document.content["accessors"], document.content["bufferViews"]
    at, indices = primitive["attributes"]["POSITION"], primitive["indices"]

    def changed(number: int, **changes) -> int:
        accessors.append({**accessors[number], **changes})
        return len(accessors) - 1

    def with_view(number: int, **changes) -> int:
        views.append({**views[accessors[number]["bufferView"]], **changes})
        return changed(number, bufferView=len(views) - 1)

    positions = [
        changed(at, count=0), changed(at, count=True), changed(at, count=10**30),
        changed(at, count=10_000), changed(at, count=accessors[at]["count"] - 1),
        changed(at, type="VEC2"), changed(at, type=["VEC3"]), changed(at, type="VEC9"),
        changed(at, componentType=5126.0), changed(at, componentType=None),
        changed(at, byteOffset=-4), changed(at, byteOffset=1 << 20), changed(at, bufferView=99_999),
        changed(at, bufferView=-1), changed(at, bufferView=True), changed(at, normalized=1),
        changed(at, sparse={"count": 1}), with_view(at, buffer=7), with_view(at, buffer=-1),
        with_view(at, buffer=-7), -100,
        with_view(at, byteLength=3), with_view(at, byteStride=-12), with_view(at, extensions={}),
        with_view(at, byteOffset=1 << 40), -1, 99_999, None, True, "0", 1.0, 10**30,
    ]  # fmt: skip
    corners = [
        changed(indices, normalized=True), changed(indices, type="VEC3"),
        changed(indices, componentType=_FLOAT), changed(indices, count=4), None, -1,
        indices,  # of which one is out of range for fewer vertices
    ]  # fmt: skip
    attributes = primitive["attributes"]
    fewer = {"POSITION": changed(at, count=3), "NORMAL": attributes["NORMAL"]}
    return [
        *({**primitive, "attributes": {**attributes, "POSITION": i}} for i in positions),
        *({**primitive, "indices": i} for i in corners),
        *({"attributes": {"POSITION": changed(at, count=3)}, "indices": i} for i in corners),
        {**primitive, "attributes": fewer},
        {**primitive, "attributes": {**attributes, "NORMAL": -100}},
        {**primitive, "attributes": {}},
        {**primitive, "attributes": []},
        {**primitive, "mode": 5},
        {**primitive, "mode": [4]},
        {**primitive, "extensions": {}},
        {"attributes": {"POSITION": at}, "indices": indices, "mode": 4.0},
    ]


def test_what_is_wrong_with_one_hides_no_other(tmp_path):
    writer = _Writer(np.random.default_rng(5))
    primitives = [_primitive(writer, 1) for _ in range(3)]
    document = writer.document(tmp_path, primitives)
    faults = _faults(document, primitives[0])
    for fault in faults:
        # Twice, because one alone is never read here.
        both = [*primitives, fault, json.loads(json.dumps(fault))]
        found = read_primitives(document, [Wanted(one) for one in both])
        assert None not in found[:3]
        try:
            alone = read_primitive(document, fault)
        except (TexbakeError, TypeError):
            assert found[3:] == [None, None], fault
            continue
        for one in found[3:]:
            if one is not None:
                _assert_same(one, alone)


def test_a_number_that_is_not_finite_is_named(tmp_path):
    writer = _Writer(np.random.default_rng(6))
    primitives = [_primitive(writer, 0) for _ in range(3)]
    bad = np.full((3, 3), np.nan, "<f4")
    primitives += [{"attributes": {"POSITION": writer.add(bad, _FLOAT)}}] * 2
    document = writer.document(tmp_path, primitives)
    assert read_primitives(document, [Wanted(one) for one in primitives])[3:] == [None, None]
    with pytest.raises(TexbakeError, match="a value of POSITION is not finite"):
        read_mesh(document.path)


def test_a_file_of_many_meshes_reads_no_accessor_alone(tmp_path, monkeypatch):
    writer = _Writer(np.random.default_rng(7))
    primitives = [_primitive(writer, 1) for _ in range(50)]
    document = writer.document(tmp_path, primitives)
    with monkeypatch.context() as patched:
        patched.setattr(gltf, "read_primitives", lambda _, wanted: [None] * len(wanted))
        alone = read_mesh(document.path)
    monkeypatch.delattr(Document, "accessor")
    mesh = read_mesh(document.path)
    for name in ("positions", "faces", "normals", "normal_faces", "colors", "face_groups"):
        assert getattr(mesh, name).tobytes() == getattr(alone, name).tobytes()
    assert mesh.group_names == alone.group_names


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
