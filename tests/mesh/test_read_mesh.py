from unittest.mock import ANY, Mock, call

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from tests.models import model
from texbake import FileError, Mesh, OptionError, read_mesh, write_mesh
from texbake.errors import FileFormatError
from texbake.texture.encoding import decode_srgb

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".fbx")
OWN_SUFFIXES = SUFFIXES[:4]
every_suffix = pytest.mark.parametrize("suffix", SUFFIXES)


@pytest.fixture
def square():
    return Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]],
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], uv_faces=[[0, 1, 2], [4, 2, 3]],
        normals=[[0, 0, 1], [0, 1, 0]], normal_faces=[[0, 0, 0], [1, 1, 1]],
    )  # fmt: skip


def error_of(path):
    with pytest.raises(FileError) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return caught.value


@every_suffix
def test_missing_file_and_folder(tmp_path, suffix):
    error = error_of(tmp_path / f"none{suffix}")
    assert not isinstance(error, FileFormatError) and "no such file" in str(error)
    (tmp_path / f"folder{suffix}").mkdir()
    assert "it is a folder" in str(error_of(tmp_path / f"folder{suffix}"))
    assert "it is a folder" in str(error_of(tmp_path))


def test_unknown_suffix_names_the_known_ones(tmp_path, square):
    (tmp_path / "mesh.blend").write_text("x")
    message = str(error_of(tmp_path / "mesh.blend"))
    assert all(suffix in message for suffix in SUFFIXES)
    with pytest.raises(FileFormatError, match=r"\.obj, \.ply"):
        write_mesh(square, tmp_path / "mesh")
    with pytest.raises(FileFormatError, match=r"write a \.glb file"):
        write_mesh(square, tmp_path / "mesh.gltf")


@pytest.mark.parametrize("suffix", [".obj", ".PLY", ".Off"])
def test_suffix_in_any_case_and_name(tmp_path, square, suffix):
    path = tmp_path / f"my mesh{suffix}"
    write_mesh(square, path)
    mesh = read_mesh(path)
    assert mesh.name == f"my mesh{suffix}"
    assert mesh.positions.tobytes() == square.positions.tobytes()
    assert mesh.faces.tobytes() == square.faces.tobytes()


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
@pytest.mark.parametrize("through", [".glb", ".usda", ".ply", ".obj"])
def test_bytes_of_colors_are_linear_in_meshes_and_come_back(tmp_path, suffix, through):
    start, between, end = tmp_path / f"a{suffix}", tmp_path / f"b{through}", tmp_path / f"c{suffix}"
    codes = np.arange(256)
    corners = np.random.default_rng(1).random((256, 3)).round(3)
    if suffix == ".ply":
        header = "ply\nformat ascii 1.0\nelement vertex 256\n"
        header += "".join(f"property double {axis}\n" for axis in "xyz")
        header += "".join(f"property uchar {color}\n" for color in ("red", "green", "blue"))
        header += "element face 254\nproperty list uchar int vertex_indices\nend_header\n"
        rows = [
            f"{x} {y} {z} {code} {code} 60" for (x, y, z), code in zip(corners, codes, strict=True)
        ]
        faces = [f"3 {i} {i + 1} {i + 2}" for i in range(254)]
    else:
        header = ""
        rows = [
            f"v {x} {y} {z} {code / 255:.6f} {code / 255:.6f} {60 / 255:.6f}"
            for (x, y, z), code in zip(corners, codes, strict=True)
        ]
        faces = [f"f {i} {i + 1} {i + 2}" for i in range(1, 255)]
    start.write_text(header + "\n".join([*rows, *faces]) + "\n")
    mesh = read_mesh(start)
    np.testing.assert_allclose(mesh.colors[:, 2], 0.0451862, rtol=1e-5)
    np.testing.assert_allclose(mesh.colors[:, 0], decode_srgb(codes / 255.0), atol=1e-6)
    write_mesh(mesh, between)
    write_mesh(read_mesh(between), end)
    write_mesh(mesh, start)
    colors = [read_mesh(path).colors[:, :3] for path in (start, end)]
    assert colors[0].tobytes() == mesh.colors.tobytes()
    tolerance = 3e-7 * (suffix == ".obj" and through == ".ply")  # floats that round decimals
    found, expected = (each[np.lexsort(each.T)] for each in (colors[1], mesh.colors))
    np.testing.assert_allclose(found, expected, rtol=tolerance)
    assert suffix == ".obj" or b"property uchar red" in end.read_bytes()


def floats(width):
    return st.floats(allow_nan=False, allow_infinity=False, width=width)


@settings(max_examples=200)
@given(
    st.sampled_from(OWN_SUFFIXES), hnp.arrays(np.float64, (5, 3), elements=floats(64)),
    hnp.arrays(np.float32, (5, 3), elements=floats(32)),
    hnp.arrays(np.float32, (5, 2), elements=st.floats(-2, 2, width=32)),
    hnp.arrays(np.int32, (3, 3), elements=st.integers(0, 4)),
    st.sampled_from(["none", "uvs", "both", "seams"]), st.booleans(),
)  # fmt: skip
def test_round_trips_keep_every_bit(
    tmp_path_factory, suffix, double, single, uvs, faces, has, is_single
):
    """Of positions, and what else the format has, corner by corner; OBJ keeps all arrays."""
    normals = np.array([[0, 0, 1], [0.6, 0.8, 0], [1 / 3, 2 / 3, 2 / 3], [0, 0, 0], [1, 0, 0]])
    corners = faces[::-1] if has == "seams" else faces
    mesh = Mesh(
        positions=single if is_single or suffix == ".stl" else double,
        faces=faces,
        **({"uvs": uvs, "uv_faces": corners} if has != "none" else {}),
        **({"normals": normals, "normal_faces": corners} if has in ("both", "seams") else {}),
        colors=np.linspace(0, 1, 15, dtype=np.float32).reshape(5, 3),
    )
    path = tmp_path_factory.mktemp("trip") / f"mesh{suffix}"
    write_mesh(mesh, path)
    again = read_mesh(path)
    found, expected = again.positions[again.faces], mesh.positions[faces]
    np.testing.assert_array_equal(found, expected)
    assert found.tobytes() == expected.tobytes() or suffix == ".stl"  # which joins 0.0 and -0.0
    if suffix != ".stl":  # vertices that no face uses, too
        assert again.positions.tobytes() == mesh.positions.tobytes()
        assert again.faces.tobytes() == mesh.faces.tobytes()
    if suffix in (".obj", ".ply"):
        # Floats of PLY files are sRGB, whose rounding grows by up to 2.4 when it is decoded.
        tolerance = 0.0 if suffix == ".obj" else 2.4 * 2.0**-24 + 2.0**-24
        np.testing.assert_allclose(again.colors, mesh.colors, rtol=tolerance)
        for values, indices in (("uvs", "uv_faces"), ("normals", "normal_faces")):
            before, after = getattr(mesh, values), getattr(again, values)
            assert (before is None) == (after is None)
            if before is not None:
                ours, theirs = before[getattr(mesh, indices)], after[getattr(again, indices)]
                np.testing.assert_array_equal(theirs, ours)
                assert suffix == ".ply" or after.tobytes() == before.tobytes()


@pytest.mark.parametrize("suffix", OWN_SUFFIXES)
def test_options_of_other_formats(tmp_path, square, suffix):
    path = tmp_path / f"mesh{suffix}"
    with pytest.raises(OptionError, match="normal_map"):
        write_mesh(square, path, normal_map=np.zeros((4, 4, 3)))
    assert not path.exists()
    write_mesh(square, path, normal_map=None)
    assert path.exists()


@pytest.mark.parametrize("suffix", OWN_SUFFIXES)
def test_write_replaces_whole_or_not_at_all(tmp_path, square, suffix):
    path = tmp_path / f"mesh{suffix}"
    path.write_text("precious")
    write_mesh(square, path)
    assert path.read_bytes() != b"precious"
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    with pytest.raises(FileError, match="there is no folder"):
        write_mesh(square, tmp_path / "none" / f"mesh{suffix}")


def test_progress_is_one_stage(tmp_path, square):
    write_mesh(square, tmp_path / "mesh.ply")
    sink = Mock()
    read_mesh(tmp_path / "mesh.ply", progress=sink)
    assert sink.mock_calls == [
        call.started("read mesh.ply", ANY, ANY),
        call.finished("read mesh.ply", ANY),
    ]


def canonical_triangles(corners):
    """Triangles sorted, each beginning with its least corner: the same for any order of faces."""
    rotations = np.stack([np.roll(corners, -k, axis=1).reshape(-1, 9) for k in range(3)], axis=1)
    least = np.array([min(map(tuple, rotation)) for rotation in rotations.tolist()])
    return least[np.lexsort(least.T[::-1])]


def assert_same_triangles(path):
    import trimesh

    mesh = read_mesh(path)
    other = trimesh.load(path, process=False, force="mesh")
    np.testing.assert_array_equal(
        canonical_triangles(mesh.positions[mesh.faces]),
        canonical_triangles(np.asarray(other.vertices)[other.faces]),
    )


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
@pytest.mark.parametrize("name", ["bracket", "fused cells", "scan"])
@pytest.mark.parametrize("writer", ["trimesh", "texbake"])
def test_files_have_the_triangles_that_trimesh_reads(tmp_path, name, suffix, writer):
    import trimesh

    mesh, path = model(name), tmp_path / f"a.{suffix}"
    if writer == "texbake":
        write_mesh(mesh, path)
    else:
        trimesh.Trimesh(mesh.positions, mesh.faces, process=False).export(path)
    assert_same_triangles(path)


@pytest.mark.realdata
def test_real_files_have_the_triangles_that_trimesh_reads(data_dir):
    for name in ("pairs/koala/low_uv.obj", "pairs/skull/low.obj", "pairs/spot/low_uv.obj",
                 "pairs/penguin/low.obj", "meshes/Generic_Twin_7081.1.t0_left.obj",
                 "meshes/capsule.obj", "meshes/sword.obj", "meshes/busted.STL",
                 "meshes/featuretype.STL"):  # fmt: skip
        assert_same_triangles(data_dir / name)
