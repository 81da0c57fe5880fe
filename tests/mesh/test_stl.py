import struct

import numpy as np
import pytest

from texbake.errors import FileFormatError, MeshError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.mesh import Mesh

CORNERS = np.float32([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]])


@pytest.fixture
def read(tmp_path):
    def read_bytes(content):
        path = tmp_path / "mesh.stl"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_mesh(path)

    return read_bytes


def binary(corners, header=b""):
    content = header.ljust(80) + struct.pack("<I", len(corners))
    for triangle in corners:
        content += struct.pack("<12fH", 9, 9, 9, *np.ravel(triangle), 7)
    return content


def facets(corners):
    text = ""
    for triangle in corners:
        rows = "".join(f"   vertex {x} {y} {z}\n" for x, y, z in triangle)
        text += f" facet normal nan -nan(ind) 0\n  outer loop\n{rows}  endloop\n endfacet\n"
    return text


@pytest.mark.parametrize("header", [b"", b"solid that is binary all the same"])
def test_binary(read, header):
    mesh = read(binary(CORNERS, header))
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.normals is None


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_ascii(read, end):
    text = f"solid Left part 12\n{facets(CORNERS)}endsolid Left part 12\n".replace("\n", end)
    mesh = read(text)
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.group_names == ("Left part 12",)


def test_solids_are_groups(read):
    text = "".join(
        f"SOLID {name}\n{facets(CORNERS[:n])}ENDSOLID {name}\n"
        for name, n in (("a", 1), ("b c", 2), ("empty", 0), ("a", 1))
    )
    mesh = read(text)
    assert mesh.group_names == ("a", "b c")
    assert mesh.face_groups.tolist() == [0, 1, 1, 0]
    assert read(f"solid\n{facets(CORNERS)}endsolid\n").face_groups is None


def test_corners_are_joined_only_where_exactly_equal_and_degenerate_faces_stay(read):
    above = np.nextafter(np.float32(1), np.float32(2))
    corners = [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[-0.0, 0, -0.0], [above, 0, 0], [0, 1, 0]],
        [[0, 0, 0], [0, 0, 0], [1, 0, 0]],
    ]
    mesh = read(binary(corners))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 3, 2], [0, 0, 1]]
    assert mesh.positions[3, 0] == above


@pytest.mark.parametrize(
    ("old", "new"),
    [("vertex 1.0 1.0 0.0", "vertex 1.0 1.0"), ("vertex 1.0 1.0 0.0", ""), ("1.0 1.0", "1.0 x")],
)
def test_broken_text(read, old, new):
    text = f"solid a\n{facets(CORNERS)}endsolid\n"
    assert old in text
    with pytest.raises(FileFormatError):
        read(text.replace(old, new))


def test_not_finite_and_empty(read):
    corners = CORNERS.copy()
    corners[1, 2, 0] = np.nan
    for content in (binary(corners), f"solid a\n{facets(corners)}endsolid\n"):
        with pytest.raises(MeshError, match="not finite"):
            read(content)
    for content in (binary([]), "solid a\nendsolid a\n"):
        with pytest.raises(MeshError, match="no faces"):
            read(content)


def test_count_larger_than_the_file(read):
    content = bytearray(binary(CORNERS))
    content[80:84] = struct.pack("<I", 2**32 - 1)
    with pytest.raises(FileFormatError, match="truncated"):
        read(bytes(content))


def test_round_trip(tmp_path):
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(20, 3)).astype(np.float32)
    faces = rng.integers(0, 20, (40, 3))
    write_mesh(Mesh(positions=positions, faces=faces), tmp_path / "mesh.STL")
    again = read_mesh(tmp_path / "mesh.STL")
    np.testing.assert_array_equal(again.positions[again.faces], positions[faces])
    assert len(again.positions) == len(np.unique(faces))


def test_too_large_for_float32(tmp_path):
    mesh = Mesh(positions=[[0, 0, 0], [1e39, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    with pytest.raises(MeshError, match="float32"):
        write_mesh(mesh, tmp_path / "mesh.stl")
    assert not list(tmp_path.iterdir())
