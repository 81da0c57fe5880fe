import struct

import numpy as np
import pytest

CORNERS = np.float32([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]])


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
    assert (mesh.group_names, mesh.face_groups.tolist()) == (("a", "b c"), [0, 1, 1, 0])
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
