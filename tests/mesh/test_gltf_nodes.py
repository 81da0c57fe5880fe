"""Nodes of glTF files: many of them, and such as repeat a mesh without measure."""

import base64
import json

import numpy as np
import pytest

from texbake.errors import FileFormatError
from texbake.mesh.files import read_mesh
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.gltf_nodes import MAX_PLACED
from texbake.rendering.scene.read import read_scene

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")


@pytest.fixture
def instances(tmp_path):
    """Write a file whose nodes all place one mesh, node i moved to x = i."""

    def write(n_nodes: int, n_faces: int = 1, claimed: int | None = None):
        data = np.tile(TRIANGLE, (n_faces, 1)).tobytes()
        uri = "data:;base64," + base64.b64encode(data).decode()
        count = 3 * (claimed or n_faces)
        document = {
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": len(data), "uri": uri}],
            "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0, "translation": [i, 0, 0]} for i in range(n_nodes)],
            "scenes": [{"nodes": list(range(n_nodes))}],
        }
        path = tmp_path / "instances.gltf"
        path.write_text(json.dumps(document))
        return path

    return write


def test_each_node_places_the_mesh(instances):
    mesh = read_mesh(instances(5))
    assert mesh.n_faces == 5
    np.testing.assert_array_equal(
        mesh.positions[mesh.faces], TRIANGLE + np.arange(5)[:, None, None] * np.array([1, 0, 0])
    )


def test_a_mesh_is_read_once_for_all_nodes(instances, monkeypatch):
    reads = []
    accessor = Document.accessor
    monkeypatch.setattr(
        Document, "accessor", lambda self, index: (reads.append(index), accessor(self, index))[1]
    )
    assert read_mesh(instances(100)).n_faces == 100
    assert reads == [0]


@pytest.mark.parametrize("read", [read_mesh, read_scene])
def test_a_bomb_of_instances_is_refused_before_a_triangle_is_read(instances, monkeypatch, read):
    monkeypatch.setattr(Document, "accessor", lambda self, index: pytest.fail("it was read"))
    path = instances(2000, claimed=MAX_PLACED // 1000)
    with pytest.raises(FileFormatError, match="repeat 100,000 triangles until there are 200,000,"):
        read(path)
