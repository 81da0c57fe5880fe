"""Nodes that share a mesh share it in what is made of their file, too."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.glb import GltfFile, read_glb
from texbake.errors import FileFormatError
from texbake.jobs.lighten_options import LightenOptions
from texbake.mesh import instances as instances_module
from texbake.mesh.compose import excerpt
from texbake.mesh.distance import surface_distance
from texbake.mesh.files import read_mesh
from texbake.mesh.instances import instances
from texbake.mesh.options import SimplifyOptions
from texbake.mesh.part_sizes import simplified_once
from texbake.mesh.repeated_parts import RepeatedParts
from texbake.mesh.rig import read_rig
from texbake.mesh.simplify import simplify_with_report
from texbake.texture.image_files import encode_image
from texbake.verbs.meshes import transform_file
from texbake.verbs.simplify import simplify_file
from texbake.verbs.whole_jobs import lighten_file

N_ROWS = 24
TURN = Rotation.from_euler("xyz", [20, 50, 70], degrees=True).as_quat().tolist()
# Nodes of the instances; the last of them is moved by an animation.
PLACES = [
    {},
    {"translation": [3, 0, 0], "rotation": TURN},
    {"translation": [0, 3, 0], "scale": [-1, 1, 1]},
    {"translation": [3, 3, 0], "rotation": TURN, "scale": [0.5, 1, 1.5]},
    {"translation": [0, 0, 3], "scale": [2, 2, 2]},
    {"translation": [3, 0, 3]},
]


def egg():
    """Positions, texture coordinates and quads of a bump that is one chart."""
    s, t = np.meshgrid(np.linspace(0.05, 0.95, N_ROWS), np.linspace(0.05, 0.95, N_ROWS))
    points = np.stack([2 * s - 1, 2 * t - 1, np.sin(np.pi * s) * np.sin(np.pi * t) * s], axis=-1)
    i, k = np.meshgrid(np.arange(N_ROWS - 1), np.arange(N_ROWS - 1))
    a = k * N_ROWS + i
    quads = np.stack([a, a + 1, a + N_ROWS + 1, a + N_ROWS], axis=-1).reshape(-1, 4)
    return points.reshape(-1, 3), np.stack([s, 1 - t], axis=-1).reshape(-1, 2), quads


@pytest.fixture
def path(tmp_path):
    """A file of six instances of a mesh of two materials, and a node of another shape."""
    file = GltfFile()
    points, uvs, quads = egg()
    arrays = {"POSITION": file.accessor(points), "TEXCOORD_0": file.accessor(uvs)}
    halves = np.array_split(quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), 2)
    mesh = file.mesh(
        *({"attributes": arrays, "indices": file.accessor(half.reshape(-1, 1), "I"), "material": i}
          for i, half in enumerate(halves)),
        name="egg",
    )  # fmt: skip
    other = {**arrays, "POSITION": file.accessor(points * [1, 1, 1.2])}
    whole = file.accessor(np.concatenate(halves).reshape(-1, 1), "I")
    alone = file.mesh({"attributes": other, "indices": whole})
    codes = np.random.default_rng(0).integers(0, 255, (16, 16, 3)).astype(np.uint8)
    view = file.view(encode_image(np.kron(codes, np.ones((4, 4, 1), np.uint8)), "png"))
    times, moves = file.accessor([0.0, 1.0]), file.accessor(np.array([[3, 0, 3], [3, 1, 3]]))
    nodes = [{"name": f"egg {i}", "mesh": mesh, **place} for i, place in enumerate(PLACES)]
    file.json |= {
        "nodes": [*nodes, {"name": "alone", "mesh": alone, "translation": [6, 0, 0]}],
        "scenes": [{"nodes": list(range(len(nodes) + 1))}],
        "images": [{"bufferView": view, "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [
            {"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, **more}}
            for name, more in (("shell", {}), ("gold", {"roughnessFactor": 0.5}))
        ],
        "animations": [{
            "samplers": [{"input": times, "output": moves}],
            "channels": [{"sampler": 0, "target": {"node": 5, "path": "translation"}}],
        }],
    }  # fmt: skip
    return file.write(tmp_path / "eggs.glb")


def lightened(**options):
    return lambda source, output: lighten_file(
        source, output, LightenOptions(n_faces=1500, views=0, size=256, images="png", **options)
    )


VERBS = {
    "convert": lambda source, output: transform_file(source, output),
    "simplify": lambda source, output: simplify_file(source, output, SimplifyOptions(n_faces=1500)),
    "lighten": lightened(uvs="keep"),
    "lighten floats": lightened(uvs="keep", quantize=False),
    "lighten new": lightened(uvs="new"),
}


def meshes_of_nodes(document):
    """Number of the mesh of each node with a name, of its own or of one below it."""
    nodes = document["nodes"]
    found = {}
    for node in filter(lambda node: "name" in node, nodes):
        below = [nodes[child] for child in node.get("children", ())]
        found[node["name"]] = next(each["mesh"] for each in (node, *below) if "mesh" in each)
    return found


@pytest.mark.parametrize("verb", VERBS)
def test_instances_share_one_mesh(path, tmp_path, verb):
    VERBS[verb](path, output := tmp_path / "made.glb")
    document, _ = read_glb(output)
    of_nodes = meshes_of_nodes(document)
    assert list(of_nodes) == [*(f"egg {i}" for i in range(6)), "alone"]
    assert len(set(of_nodes.values())) == len(document["meshes"]) == 2
    assert of_nodes["alone"] not in [of_nodes[f"egg {i}"] for i in range(6)]
    (channel,) = document["animations"][0]["channels"]
    assert document["nodes"][channel["target"]["node"]]["name"] == "egg 5"
    source, made = read_mesh(path), read_mesh(output)
    assert surface_distance(source, made).max < 0.05
    if verb == "convert":
        corners = [mesh.positions[mesh.faces] for mesh in (source, made)]
        assert np.abs(corners[0] - corners[1]).max() < 1e-6


def test_objects_that_only_resemble_each_other_are_no_instances(path):
    mesh, rig = read_mesh(path), read_rig(path)
    ids = np.zeros(mesh.n_faces, np.int32)
    assert instances(mesh, rig, ids) == [[0, 1, 2, 3, 4, 5]]
    groups = mesh.face_groups // 2
    assert instances(mesh, rig, np.where(groups == 1, 1, ids)) == [[0, 2, 3, 4, 5]]
    far = mesh.positions.copy()
    far[mesh.faces[groups == 2][0, 0], 2] += 1e-4
    assert instances(mesh.replace(positions=far), rig, ids) == [[0, 1, 3, 4, 5]]
    uvs = mesh.uvs.copy()
    uvs[mesh.uv_faces[groups == 3]] += 1e-4
    assert instances(mesh.replace(uvs=uvs), rig, ids) == [[0, 1, 2, 4, 5]]


def test_each_object_is_compared_with_few_of_other_sizes(path, monkeypatch):
    mesh, rig = read_mesh(path), read_rig(path)
    n_compared = []
    compare = instances_module._is_same
    monkeypatch.setattr(
        instances_module, "_is_same", lambda *each: n_compared.append(1) or compare(*each)
    )
    scales = 1.0 + 0.1 * (mesh.face_groups // 2)
    positions = mesh.positions.copy()
    positions[mesh.faces.ravel()] *= np.repeat(scales, 3)[:, None]
    assert instances(mesh.replace(positions=positions), rig, np.zeros(mesh.n_faces, np.int32)) == []
    assert not n_compared


@pytest.mark.parametrize("n_asked", [1500, 10**5, 10**9])
def test_no_more_triangles_are_asked_for_than_one_of_each_kind_has(path, n_asked):
    repeated = RepeatedParts.instances(read_mesh(path), None, read_rig(path))
    one_each = excerpt(repeated.mesh, repeated.is_first)
    asked = []

    def make(n):
        asked.append(n)
        return *simplify_with_report(one_each, n), None

    low, report, _ = simplified_once(repeated, n_asked, make)
    assert max(asked) <= one_each.n_faces
    assert len(set(asked)) == len(asked)
    assert report.n_faces == repeated.restored(low)[0].n_faces <= n_asked
    assert report.n_faces >= min(0.97 * n_asked, repeated.mesh.n_faces)


def instanced(file, folder):
    """Write a file whose one node shows three instances, far below a moved parent."""
    file.triangle(name="leaf")
    attributes = {
        "TRANSLATION": file.accessor(np.eye(3)),
        "ROTATION": file.accessor(np.array([[0, 0, 127, 0]] * 3), "b", normalized=True),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.json |= {
        "nodes": [
            {"translation": [0, 0, 5], "children": [1]},
            {"name": "leaves", "mesh": 0, "extensions": extension},
        ],
        "scenes": [{"nodes": [0]}],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing"],
    }
    return file.write(folder / "leaves.glb")


def test_instances_of_one_node_are_nodes_below_it(tmp_path):
    path = instanced(GltfFile(), tmp_path)
    mesh = read_mesh(path)
    assert mesh.group_names == ("leaves",) * 3
    corners = mesh.positions[mesh.faces]
    assert np.allclose(corners[:, 0], np.eye(3) + np.array([0, 0, 5]))
    assert np.allclose(corners[:, 1] - corners[:, 0], [-1, 0, 0])
    VERBS["convert"](path, output := tmp_path / "made.glb")
    assert len(read_glb(output)[0]["meshes"]) == 1
    assert np.allclose(read_mesh(output).positions, mesh.positions)


@pytest.mark.parametrize("rows", [np.eye(2), np.full((3, 3), np.nan), np.eye(4)[:, :3]])
def test_damaged_instances_are_an_error(tmp_path, rows):
    file = GltfFile()
    path = instanced(file, tmp_path)
    node = file.json["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
    node["TRANSLATION"] = file.accessor(rows)
    with pytest.raises(FileFormatError, match="instances"):
        read_mesh(file.write(path))


def test_few_bytes_cannot_ask_for_many_instances(tmp_path):
    file = GltfFile()
    instanced(file, tmp_path)
    places = file.accessor(np.zeros((60_000, 3)))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    for n, is_bounded in ((1, False), (4, True)):
        file.json["nodes"] = [{"mesh": 0, "extensions": extension}] * n
        file.json["scenes"] = [{"nodes": list(range(n))}]
        path = file.write(tmp_path / "leaves.glb")
        if is_bounded:
            with pytest.raises(FileFormatError, match="instances"):
                read_mesh(path)
        else:
            assert read_mesh(path).n_faces == 60_000
