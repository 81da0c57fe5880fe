import struct

import numpy as np
import pytest

from texbake import Mesh, write_mesh
from texbake.mesh.files.conversion import linear_colors, srgb_bytes, srgb_colors

POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0)]
CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
CODES |= {"float": "f", "double": "d"}


def ply(order, elements, end=b"\n"):
    """A PLY file of elements (name, properties, rows); a list property is (count, value, name)."""
    header = ["ply", f"format {order} 1.0", "comment made by hand", "obj_info none"]
    body = b""
    sign = ">" if "big" in order else "<"
    for name, properties, rows in elements:
        header.append(f"element {name} {len(rows)}")
        header += [
            f"property {'list ' if len(prop) == 3 else ''}{' '.join(prop)}" for prop in properties
        ]
        for row in rows:
            words = []
            for prop, value in zip(properties, row, strict=True):
                if len(prop) == 3:
                    words.append((prop[0], len(value)))
                    words += [(prop[1], item) for item in value]
                else:
                    words.append((prop[0], value))
            if order == "ascii":
                body += " ".join(str(value) for _, value in words).encode() + end
            else:
                body += b"".join(struct.pack(sign + CODES[code], value) for code, value in words)
    return end.join([line.encode() for line in header] + [b"end_header", b""]) + body


XYZ = [("float", "x"), ("float", "y"), ("float", "z")]
POLYGON = [("uchar", "int", "vertex_indices")]
ORDERS = ["ascii", "binary_little_endian", "binary_big_endian"]
orders = pytest.mark.parametrize("order", ORDERS)
SQUARE = [([0, 1, 2],), ([0, 2, 3],)]


@pytest.mark.parametrize("n_letters", range(4))
def test_the_indices_of_a_single_triangle_are_aligned(read, n_letters):
    # Its row begins at any byte of the file.
    flag = ("uchar", "x" * n_letters + "flag")
    vertices = ("vertex", XYZ, POINTS)
    file = ply(ORDERS[1], [vertices, ("face", [*POLYGON, flag], [([0, 1, 2], 7)])])
    faces = read(file).faces
    assert faces.flags.aligned
    assert faces.tolist() == [[0, 1, 2]]


@orders
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_triangles(read, order, end):
    mesh = read(ply(order, [("vertex", XYZ, POINTS), ("face", POLYGON, SQUARE)], end))
    assert mesh.positions.tolist() == [list(point) for point in POINTS]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert (mesh.uvs, mesh.normals, mesh.colors) == (None, None, None)
    assert mesh.name == "mesh.ply"


@orders
@pytest.mark.parametrize("count", ["char", "uchar", "short", "ushort", "int", "uint"])
@pytest.mark.parametrize("index", ["char", "uchar", "short", "ushort", "int", "uint"])
def test_polygons_with_every_type_of_count_and_index(read, order, count, index):
    polygon = [(count, index, "vertex_index")]
    faces = [([0, 1, 2, 3],), ([3, 2, 1],), ([0, 1],), ([],), ([1, 2, 3, 0],)]
    mesh = read(ply(order, [("vertex", XYZ, POINTS), ("face", polygon, faces)]))
    expected = [[0, 1, 3], [1, 2, 3], [3, 2, 1], [1, 2, 3], [1, 3, 0]]
    assert mesh.faces.tolist() == expected
    quads = read(ply(order, [("vertex", XYZ, POINTS), ("face", polygon, faces[:1] * 2)]))
    assert quads.faces.tolist() == expected[:2] * 2


@orders
def test_properties_in_any_order_among_others(read, order):
    vertex = [("uchar", "blue"), ("double", "z"), ("float", "t"), ("int", "flags"), ("double", "x")]
    vertex += [("uchar", "red"), ("float", "nz"), ("double", "y"), ("float", "s"), ("float", "nx")]
    vertex += [("float", "ny"), ("uchar", "green"), ("uchar", "alpha")]
    rows = [
        (255, z, 0.25, 7, x, 51, 1.0, y, 0.5 + index, 0.0, 0.0, 0, 102)
        for index, (x, y, z) in enumerate(POINTS)
    ]
    face = [("float", "quality"), *POLYGON, ("uchar", "red")]
    other = ("material", [("uchar", "float", "values"), ("int", "id")], [([1.0], 2), ([], 3)])
    faces = [(0.5, row[0], 9) for row in SQUARE]
    content = ply(order, [other, ("face", face, faces), ("vertex", vertex, rows)])
    mesh = read(content)
    assert mesh.positions.tolist() == [list(point) for point in POINTS]
    assert mesh.faces.tolist() == [row[0] for row in SQUARE]
    assert mesh.uvs.tolist() == [[0.5 + index, 0.25] for index in range(4)]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4
    assert mesh.uv_faces.tolist() == mesh.normal_faces.tolist() == mesh.faces.tolist()
    np.testing.assert_array_equal(srgb_bytes(mesh.colors), [[51, 0, 255, 102]] * 4)


@orders
@pytest.mark.parametrize(("u", "v"), [("u", "v"), ("texture_u", "texture_v")])
def test_other_names_of_texture_coordinates(read, order, u, v):
    rows = [(*point, 0.5, 0.25) for point in POINTS]
    vertex = [*XYZ, ("float", u), ("float", v)]
    mesh = read(ply(order, [("vertex", vertex, rows), ("face", POLYGON, SQUARE)]))
    assert mesh.corner_uvs().tolist() == [[[0.5, 0.25]] * 3] * 2


@orders
def test_float_and_16_bit_colors(read, order):
    for code, values, expected in (
        ("float", (0.5, 0.25, 2.0), (0.5, 0.25, 1.0)),
        ("ushort", (65535, 0, 13107), (1.0, 0.0, 0.2)),
    ):
        vertex = XYZ + [(code, name) for name in ("red", "green", "blue")]
        rows = [(*point, *values) for point in POINTS]
        mesh = read(ply(order, [("vertex", vertex, rows), ("face", POLYGON, SQUARE)]))
        np.testing.assert_allclose(srgb_colors(mesh.colors)[0], expected, 1e-6, 1e-7)


@orders
def test_texture_coordinates_of_corners_are_joined_at_vertices(read, order):
    face = [*POLYGON, ("uchar", "float", "texcoord"), ("int", "texnumber")]
    rows = [
        ([0, 1, 2], [0, 0, 1, 0, 1, 1], 0),
        # Equal at vertex 2, a seam at vertex 0; vertex 3 has what vertex 1 has, but is another.
        ([0, 2, 3], [0.5, 0, 1, 1, 1, 0], 0),
    ]
    mesh = read(ply(order, [("vertex", XYZ, POINTS), ("face", face, rows)]))
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [1, 1], [0.5, 0], [1, 0]]
    assert mesh.uv_faces.tolist() == [[0, 1, 2], [3, 2, 4]]
    rows[1] = ([0, 2, 3, 1], [0.5, 0, 1, 1, 1, 0, 0, 0.5], 0)
    mesh = read(ply(order, [("vertex", XYZ, POINTS), ("face", face, rows)]))
    assert mesh.corner_uvs()[2].tolist() == [[0.5, 0], [1, 0], [0, 0.5]]


def test_text_keeps_digits_that_its_type_would_not(read):
    points = [(0.1, 0, 0), (1, 0, 0), (1, 1, 0)]
    content = ply("ascii", [("vertex", XYZ, points), ("face", POLYGON, SQUARE[:1])])
    assert read(content).positions[0, 0] == 0.1


def test_written_types_are_the_least_that_lose_nothing(tmp_path):
    path = tmp_path / "mesh.ply"
    colors = linear_colors(np.uint8([[51, 102, 255]] * 4))
    mesh = Mesh(positions=POINTS, faces=[[0, 1, 2]], colors=colors)
    write_mesh(mesh, path)
    assert b"property float x" in path.read_bytes()
    assert b"property uchar red" in path.read_bytes()
    write_mesh(mesh.replace(positions=mesh.positions + 0.1), path)
    assert b"property double x" in path.read_bytes()
    write_mesh(mesh.replace(colors=np.float32([[0.3, 2, 1]] * 4)), path)
    assert b"property float red" in path.read_bytes()
