"""Nodes of glTF files: many of them, and some that repeat a mesh without limit."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from texbake_cli.main import texbake

from tests.glb import CORNERS, GltfFile
from texbake.errors import FileFormatError
from texbake.mesh.files import read_mesh
from texbake.mesh.files.gltf import MAX_TRIANGLES
from texbake.mesh.files.gltf_document import Document
from texbake.rendering.scene.read import read_scene

TRIANGLE = np.array(CORNERS)


@pytest.fixture
def instances(tmp_path):
    """Write a file whose nodes all place one mesh, node i moved to x = i."""

    def write(n_nodes, n_corners=3):
        file = GltfFile(
            nodes=[{"mesh": 0, "translation": [i, 0, 0]} for i in range(n_nodes)],
            scenes=[{"nodes": list(range(n_nodes))}],
        )
        file.mesh({"attributes": {"POSITION": file.accessor(CORNERS, count=n_corners)}})
        return file.write(tmp_path / "instances.gltf")

    return write


def changed(path, change):
    """Change the document of a file."""
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("n_meshes", [1, 50])
def test_equal_arrays_are_read_once(instances, monkeypatch, n_meshes):
    def change(document):
        document["meshes"] *= n_meshes
        for i, node in enumerate(document["nodes"]):
            node["mesh"] = i % n_meshes

    path, reads, accessor = changed(instances(50), change), [], Document.accessor
    monkeypatch.setattr(
        Document, "accessor", lambda self, index: (reads.append(index), accessor(self, index))[1]
    )
    assert read_mesh(path).n_faces == 50
    assert reads == [0]


def shared_accessor(document, primitives):
    primitives *= 2000


def vertices_alone(document, primitives):
    document["accessors"].append({"componentType": 5125, "count": 3, "type": "SCALAR"})
    primitives[0]["indices"] = 1


def uv_sets(document, primitives):
    primitives[0]["attributes"] |= {f"TEXCOORD_{i}": 0 for i in range(20)}


@pytest.mark.parametrize("read", [read_mesh, read_scene])
@pytest.mark.parametrize(
    ("n_nodes", "change"),
    [(2000, None), (1, shared_accessor), (2000, vertices_alone), (100, uv_sets)],
)
def test_a_bomb_is_refused_before_an_array_is_read(instances, monkeypatch, read, n_nodes, change):
    monkeypatch.setattr(Document, "accessor", lambda self, index: pytest.fail("it was read"))

    def change_document(document):
        if change is not None:
            change(document, document["meshes"][0]["primitives"])

    path = changed(instances(n_nodes, 3 * MAX_TRIANGLES // 1000), change_document)
    with pytest.raises(FileFormatError, match=r"triangles up to 4[02],000,000, more"):
        read(path)


def test_nodes_may_stand_far_below_each_other(instances):
    path = instances(20_000)
    document = json.loads(path.read_text())
    document["scenes"] = [{"nodes": [0]}]
    for i, node in enumerate(document["nodes"]):
        node["translation"] = [1, 0, 0]
        node["rotation"] = [0, 0, 0, 0]  # which turns nothing
        node["children"] = [i + 1]
    del document["nodes"][-1]["children"]
    path.write_text(json.dumps(document))
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.positions[mesh.faces[-1, 0]], [20_000, 0, 0])


def _product(nodes, index):
    """Matrix of a node to the world, by scipy's rotations."""
    node = nodes[index]
    local = np.eye(4)
    local[:3, :3] = Rotation.from_quat(node["rotation"]).as_matrix() * node["scale"]
    local[:3, 3] = node["translation"]
    if "matrix" in node:
        local = np.reshape(node["matrix"], (4, 4)).T
    parents = [i for i, other in enumerate(nodes) if index in other.get("children", ())]
    return _product(nodes, parents[0]) @ local if parents else local


def test_transforms_of_a_tree_are_products(instances):
    random = np.random.default_rng(3)
    path = instances(40)
    document = json.loads(path.read_text())
    nodes = document["nodes"]
    for i, node in enumerate(nodes):
        node["translation"] = random.normal(size=3).tolist()
        node["rotation"] = random.normal(size=4).tolist()
        node["scale"] = (random.uniform(0.5, 2.0, 3) * random.choice([-1, 1], 3)).tolist()
        if i % 5 == 4:
            affine = np.eye(4)
            affine[:3] = random.normal(size=(3, 4))
            node["matrix"] = affine.T.ravel().tolist()
        if i % 4:
            nodes[int(random.integers(i))].setdefault("children", []).append(i)
    document["scenes"] = [{"nodes": list(range(0, 40, 4))}]
    path.write_text(json.dumps({key: value for key, value in document.items() if key != "scenes"}))
    mesh = read_mesh(path)
    corners = mesh.positions[mesh.faces]
    found = {tuple(np.round(np.sort(c, axis=0).ravel(), 6)) for c in corners}
    for i in range(40):
        matrix = _product(nodes, i)
        expected = TRIANGLE @ matrix[:3, :3].T + matrix[:3, 3]
        assert tuple(np.round(np.sort(expected, axis=0).ravel(), 6)) in found


@pytest.mark.parametrize(
    "numbers",
    [[[1, 2]], [[1, 2, 3, 4]], [[1, 2]] * 3, [[1, 2, 3], [1, 2]], [[1, 2, "3"]], ["123"], [123]],
)
def test_a_translation_is_three_numbers(instances, numbers):
    def change(document):
        for node, given in zip(document["nodes"], numbers, strict=True):
            node["translation"] = given

    with pytest.raises(FileFormatError, match="translation"):
        read_mesh(changed(instances(len(numbers)), change))


def test_the_limit_is_raised_as_the_message_says(instances, monkeypatch):
    monkeypatch.setenv("TEXBAKE_MAX_TRIANGLES", "60")
    path = str(instances(100))
    refused = CliRunner().invoke(texbake, ["info", path])
    assert refused.exit_code == 1
    option = re.search(r"read it with texbake (--max-triangles \d+)$", refused.output.strip())[1]
    assert option == "--max-triangles 100"
    read = CliRunner().invoke(texbake, [*option.split(), "info", path])
    assert read.exit_code == 0, read.output
    monkeypatch.setenv("TEXBAKE_MAX_TRIANGLES", "many")
    assert CliRunner().invoke(texbake, ["info", path]).exit_code == 2
