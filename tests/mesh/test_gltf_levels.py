"""Levels of detail and compressed views of GLB files."""

import re

import numpy as np
import pytest

from tests.glb import GltfFile
from texbake.errors import FileFormatError, OptionError, UvError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.gltf import read_gltf
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.shapes import grid_sphere, plane, uv_sphere
from texbake.texture.png_files import write_png


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.glb"


@pytest.fixture
def grouped():
    sphere = uv_sphere(24, 40)
    return sphere.replace(
        face_groups=np.arange(sphere.n_faces) % 3,
        group_names=("a", "b", "c"),
        colors=np.linspace(0, 1, 3 * sphere.n_vertices).reshape(-1, 3),
    )


def triangle_rows(mesh):
    """All attributes of the corners: rows of triangles, sorted, the least corner first."""
    normals, tangents = mesh.normals[mesh.normal_faces], mesh.tangents
    columns = [mesh.positions[mesh.faces], mesh.corner_uvs(), normals, tangents]
    columns.append(mesh.colors[mesh.faces])
    groups = np.broadcast_to(mesh.face_groups[:, None, None], (mesh.n_faces, 3, 1))
    corners = np.concatenate([*columns, groups], axis=2)
    turns = [np.roll(corners, -step, axis=1).reshape(mesh.n_faces, -1) for step in range(3)]
    rows = [min(candidates, key=tuple) for candidates in zip(*turns, strict=True)]
    return np.array(sorted(map(tuple, rows)))


@pytest.mark.usefixtures("meshoptimizer")
def test_compression_changes_no_value(tmp_path, grouped):
    write_glb(grouped, tmp_path / "plain.glb")
    write_glb(grouped, tmp_path / "small.glb", compress=True, quantize=False)
    plain, small = (read_gltf(tmp_path / name) for name in ("plain.glb", "small.glb"))
    np.testing.assert_array_equal(triangle_rows(small), triangle_rows(plain))
    # Every third triangle shares few vertices; whole surfaces come to about half.
    sizes = [(tmp_path / name).stat().st_size for name in ("plain.glb", "small.glb")]
    assert sizes[1] < 0.8 * sizes[0]


@pytest.mark.usefixtures("meshoptimizer")
def test_a_compressed_file_follows_its_extension(path, grouped):
    write_glb(grouped, path, compress=True, quantize=False)
    document = read_document(path)
    assert document.content["extensionsRequired"] == ["EXT_meshopt_compression"]
    first, second = document.content["buffers"]
    assert second["extensions"] == {"EXT_meshopt_compression": {"fallback": True}}
    ends = [0, 0]
    for view in document.content["bufferViews"]:
        code = view["extensions"]["EXT_meshopt_compression"]
        assert (view["buffer"], code["buffer"]) == (1, 0)
        assert view["byteLength"] == code["count"] * code["byteStride"]
        for place, owner in ((0, code), (1, view)):
            assert owner["byteOffset"] >= ends[place]
            assert owner["byteOffset"] % 4 == 0
            ends[place] = owner["byteOffset"] + owner["byteLength"]
        # The versions of the bitstreams that the extension asks for.
        data = document.binary[code["byteOffset"] :]
        assert data[0] == (0xA0 if code["mode"] == "ATTRIBUTES" else 0xE1)
    assert ends[0] <= first["byteLength"]
    assert ends[1] <= second["byteLength"]


@pytest.mark.usefixtures("meshoptimizer")
def test_compressing_gives_the_same_bytes_each_time(tmp_path, grouped):
    for name in "a.glb", "b.glb":
        write_glb(grouped, tmp_path / name, compress=True, name="x")
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


@pytest.mark.parametrize("n", [3, 300])
@pytest.mark.usefixtures("meshoptimizer")
def test_16_and_32_bit_indices_come_back(path, n):
    mesh = grid_sphere(n, 2 * n)
    write_glb(mesh, path, compress=True, quantize=False)
    back = read_gltf(path)
    assert back.n_faces == mesh.n_faces
    np.testing.assert_array_equal(back.bounds, mesh.bounds.astype(np.float32))


def compressed_accessor(path, data, *, count, stride, kind, component, normalized, **code):
    """A GLB whose one accessor reads a compressed view."""
    name, size = "EXT_meshopt_compression", {"byteLength": count * stride}
    place = {"buffer": 0, "byteLength": len(data), "byteStride": stride, "count": count, **code}
    fields = {"componentType": component, "type": kind, "normalized": normalized}
    file = GltfFile(
        extensionsRequired=[name],
        buffers=[{"byteLength": len(data)}, {**size, "extensions": {name: {"fallback": True}}}],
        bufferViews=[{"buffer": 1, "byteStride": stride, **size, "extensions": {name: place}}],
        accessors=[{"bufferView": 0, "count": count, **fields}],
    )
    file.data = data
    return read_document(file.write(path))


def test_octahedral_normals_are_decoded(meshoptimizer, path):
    """(x, y) of the octahedron of radius z, here 127: the axes, and a diagonal."""
    codes = np.array([[127, 0, 127, 0], [0, -127, 127, 0], [0, 0, 127, 0], [127, 127, 127, 0]],
                     np.int8)  # fmt: skip
    meshoptimizer.encode_vertex_version(0)
    data = meshoptimizer.encode_vertex_buffer(codes.view(np.uint8))
    document = compressed_accessor(
        path, data, count=4, stride=4, kind="VEC4", component=5120, normalized=True,
        mode="ATTRIBUTES", filter="OCTAHEDRAL",
    )  # fmt: skip
    found = document.accessor(0)[:, :3]
    np.testing.assert_allclose(found, [[1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], atol=1 / 127)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 1 << 30}, "claims 4294967296 bytes"),
        ({"mode": "TRIANGLES"}, "4 corners, which is not a multiple of 3"),
        ({"mode": "STRIPS"}, "of mode 'STRIPS' and stride 4 is not known"),
        ({"filter": "WAVELET"}, "the filter 'WAVELET'"),
        ({"stride": 6}, "a stride of 6 bytes"),
        ({"data": b"\xa0\xff\xff\xff"}, "a compressed view is damaged"),
        ({"data": b""}, "a compressed view is damaged"),
    ],
)
def test_damaged_views_are_one_clear_line(meshoptimizer, path, changes, message):
    meshoptimizer.encode_vertex_version(0)
    fields = {
        "data": meshoptimizer.encode_vertex_buffer(np.zeros((4, 4), np.uint8)),
        "count": 4, "stride": 4, "kind": "SCALAR", "component": 5126, "normalized": False,
        "mode": "ATTRIBUTES",
    } | changes  # fmt: skip
    document = compressed_accessor(path, **fields)
    with pytest.raises(FileFormatError, match=re.escape(message)) as error:
        document.view_bytes(0)
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("meshoptimizer")
def test_a_compressed_file_cut_anywhere_is_one_clear_line(path):
    write_glb(uv_sphere(6, 8), path, compress=True)
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(0)
    for at in rng.integers(len(data) // 2, len(data), 60):
        path.write_bytes(data[:at])
        with pytest.raises(FileFormatError) as error:
            read_mesh(path)
        assert "\n" not in str(error.value)


def test_levels_stand_behind_the_finest(path):
    levels = [uv_sphere(n, 2 * n) for n in (24, 12, 6)]
    write_mesh(levels[0], path, levels=levels[1:], name="ball")
    content = read_document(path).content
    assert content["extensionsUsed"] == ["MSFT_lod"]
    assert "extensionsRequired" not in content
    (root,) = content["scenes"][0]["nodes"]
    nodes = content["nodes"]
    order = [root, *nodes[root]["extensions"]["MSFT_lod"]["ids"]]
    assert [nodes[node]["name"] for node in order] == ["ball_LOD0", "ball_LOD1", "ball_LOD2"]
    counts = []
    for node in order:
        (child,) = nodes[node]["children"]
        (primitive,) = content["meshes"][nodes[child]["mesh"]]["primitives"]
        counts.append(content["accessors"][primitive["indices"]]["count"] // 3)
    assert counts == [level.n_faces for level in levels]
    assert nodes[root]["extras"]["MSFT_screencoverage"] == [0.25, 0.0625, 0.0]
    # A reader without support for levels reads only the finest.
    assert read_mesh(path).n_faces == levels[0].n_faces


@pytest.mark.usefixtures("meshoptimizer")
def test_levels_share_the_material(tmp_path, path):
    write_png(tmp_path / "n.png", np.full((4, 4, 3), 128, np.uint8))
    write_glb(plane(2, 2), path, normal_map=tmp_path / "n.png", levels=[plane()], compress=True)
    content = read_document(path).content
    assert len(content["images"]) == len(content["materials"]) == 1
    with pytest.raises(UvError, match="no texture coordinates"):
        write_glb(plane(), path, normal_map=tmp_path / "n.png", levels=[grid_sphere(4, 6)])


@pytest.mark.parametrize("coverages", [[0.5], [0.1, 0.5], [0.5, 0.5], [2.0, 0.0]])
def test_coverages_must_fit(path, coverages):
    with pytest.raises(OptionError, match="falling shares between 0 and 1"):
        write_glb(plane(), path, levels=[plane()], coverages=coverages)
