"""FBX files that the tests write themselves: every form and version, layers, transforms, damage."""

import struct
import zlib

import numpy as np
import pytest

from tests.fbx_writer import (
    CM,
    FACES,
    POINTS,
    POLYGONS,
    binary,
    layer,
    rich_scene,
    scene,
    shape,
    written,
)
from texbake.errors import FileFormatError, MeshError, ReadWarning, heard_warnings
from texbake.mesh.files import read_mesh
from texbake.mesh.files.conversion import srgb_colors

FORMS = [(v, form) for v in (6100, 7100, 7400, 7500, 7700) for form in ("binary", "ascii")]
every_form = pytest.mark.parametrize("version, form", FORMS)
TINY = 1e-12  # of float64, for lengths of a few units
CORNERS = np.where(POLYGONS < 0, ~POLYGONS, POLYGONS)
SLOTS = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]])


@pytest.fixture
def read(tmp_path):
    def write_and_read(nodes, version=7400, form="binary"):
        path = tmp_path / "a.fbx"
        path.write_bytes(nodes if isinstance(nodes, bytes) else written(nodes, version, form))
        return read_mesh(path)

    return write_and_read


@every_form
def test_every_form_gives_the_same_mesh(read, version, form):
    mesh = read(rich_scene(version), version, form)
    assert mesh.group_names == ("wall/red", "wall/blue", "door/red", "door/blue")
    assert mesh.face_groups.tolist() == [0, 0, 1, 1, 0, 2, 2, 3, 3, 2]
    np.testing.assert_array_equal(mesh.faces, np.concatenate([FACES, FACES + len(POINTS)]))
    moved = POINTS + np.array([1, 2, 3])
    turned = 2 * POINTS @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) + [1, 2, 3]
    np.testing.assert_allclose(mesh.positions, CM * np.concatenate([moved, turned]), atol=TINY)
    np.testing.assert_allclose(mesh.corner_uvs()[:5], POINTS[FACES][..., :2])
    normals = mesh.normals[mesh.normal_faces]
    np.testing.assert_allclose(normals[:5], np.broadcast_to([0, 0, 1.0], (5, 3, 3)), atol=TINY)
    np.testing.assert_allclose(normals[5:], np.broadcast_to([0, -1.0, 0], (5, 3, 3)), atol=TINY)
    colors = np.linspace(0, 1, 28).reshape(-1, 4)
    np.testing.assert_allclose(srgb_colors(mesh.colors[:7]), colors, rtol=1e-6, atol=1e-7)


def test_arrays_may_stand_unpacked(read):
    nodes = rich_scene(7400)
    plain = read(binary(nodes, 7400, packed=False))
    np.testing.assert_array_equal(plain.positions, read(nodes).positions)


@pytest.mark.parametrize(
    "mapping, values, indices",
    [
        ("ByPolygonVertex", CORNERS, None),
        ("ByVertice", np.arange(7), None),
        ("ByVertex", np.arange(7)[::-1], np.arange(7)[::-1]),
        ("ByPolygonVertex", np.arange(7), CORNERS),
    ],
)
def test_values_by_corner_or_vertex_listed_or_by_index(read, mapping, values, indices):
    """Normals and coordinates that follow from the vertex come out the same in every mapping."""
    of_vertex = np.stack([np.cos(values), np.sin(values), 0.0 * values], axis=1)
    layers = [
        layer(
            f"LayerElement{kind}",
            (name, of_vertex[:, :width].ravel()),
            mapping,
            None if indices is None else (f"{name}Index", indices.astype(np.int32)),
        )
        for kind, name, width in (("Normal", "Normals", 3), ("UV", "UV", 2))
    ]
    mesh = read(scene(layers=layers))
    expected = np.stack([np.cos(FACES), np.sin(FACES), 0.0 * FACES], axis=2)
    np.testing.assert_allclose(mesh.normals[mesh.normal_faces], expected, atol=TINY)
    np.testing.assert_allclose(mesh.corner_uvs(), expected[..., :2], atol=TINY)
    # Corners of one vertex with one value share it.
    np.testing.assert_array_equal(np.unique(mesh.uv_faces).size, 7)


def test_values_by_polygon_and_of_the_whole(read):
    normals = np.array([0, 0, 1, 0, 1, 0, 1, 0, 0.0])
    mesh = read(scene(layers=[layer("LayerElementNormal", ("Normals", normals), "ByPolygon")]))
    rows = normals.reshape(3, 3)[[0, 0, 1, 1, 2]]
    found = mesh.normals[mesh.normal_faces]
    np.testing.assert_allclose(found, np.repeat(rows[:, None], 3, axis=1))
    same = layer("LayerElementNormal", ("Normals", normals[:3]), "AllSame")
    assert read(scene(layers=[same])).normals.tolist() == [[0, 0, 1]]


def test_the_first_set_of_coordinates_counts(read):
    sets = [
        layer("LayerElementUV", ("UV", np.full(14, float(i))), "ByVertice", index=i)
        for i in (1, 0, 2)
    ]
    assert (read(scene(layers=sets)).uvs == 0.0).all()


def test_corners_without_a_coordinate_get_zeros(read):
    indices = CORNERS.copy()
    indices[[0, 5]] = [-1, 99]
    uvs = layer("LayerElementUV", ("UV", np.ones(14)), indices=("UVIndex", indices))
    flat = np.ones((11, 2))
    flat[[0, 5]] = 0.0
    np.testing.assert_array_equal(read(scene(layers=[uvs])).corner_uvs(), flat[SLOTS])


def test_holes_and_bad_polygons_are_left_out(read):
    polygons = np.array([0, 1, 4, -4, 0, -2, -7, 0, 1, -100, 1, 2, 5, -5, 3, 4], np.int32)
    lines = []
    with heard_warnings(lines.append):
        mesh = read(scene(geometry=shape(polygons=polygons)))
    np.testing.assert_array_equal(mesh.faces, FACES[:4])
    assert [line.partition("geometry 'wall mesh': ")[2] for line in lines] == [
        "left out 2 faces with fewer than three corners",
        "left out 1 face with corners that are not vertices",
    ]
    holes = layer("LayerElementHole", ("Hole", np.array([0, 1, 0], np.int32)), "ByPolygon")
    np.testing.assert_array_equal(read(scene(layers=[holes])).faces, FACES[[0, 1, 4]])


def test_invalid_axes_and_a_unit_below_zero_are_ignored(read):
    settings = {"UpAxis": [0], "UnitScaleFactor": [-1.0]}
    mesh = read(scene(settings=settings, geometry=shape(points=POINTS + 1.0)))
    np.testing.assert_allclose(mesh.positions, CM * (POINTS + 1.0), atol=TINY)


def position_of(read, properties, point=(1.0, 2.0, 3.0), parent=None):
    """Where a model takes a point, in its units."""
    points = np.array([point, [0, 0, 0], [1, 0, 0]])
    models = {"a": (properties, None)}
    if parent is not None:
        models = {"p": (parent, None), "a": (properties, "p")}
    polygons = np.array([0, 1, -3], np.int32)
    mesh = read(scene(models=models, geometry=shape(points=points, polygons=polygons)))
    return mesh.positions[-3] / CM


def test_rotations_in_order_before_and_after_count_where_they_are_active(read):
    turned = {"Lcl Rotation": [90.0, 90.0, 0.0], "PreRotation": [0.0, 0.0, 90.0],
              "RotationOrder": [3], "RotationActive": [0]}  # fmt: skip
    # (x, y, z) about x is (x, -z, y), about y is (z, y, -x).
    np.testing.assert_allclose(position_of(read, turned), [2, -3, -1])


@pytest.mark.parametrize(
    "kind, expected",
    [
        (1, [-4, 1, 3]),  # the parent's scaling along its own x
        (0, [-2, 2, 3]),  # along the child's x, which is turned to y
        (2, [-2, 1, 3]),  # none
    ],
)
def test_ways_to_inherit_scaling(read, kind, expected):
    parent = {"Lcl Scaling": [2.0, 1.0, 1.0]}
    child = {"Lcl Rotation": [0.0, 0.0, 90.0], "InheritType": [kind]}
    np.testing.assert_allclose(position_of(read, child, parent=parent), expected, atol=TINY)


def test_hidden_models_are_left_out(read):
    models = {"a": ({"Show": [0]}, None), "b": ({"Lcl Translation": [0.0, 0.0, 7.0]}, None)}
    mesh = read(scene(models=models))
    assert mesh.group_names == ("b",)
    with pytest.warns(ReadWarning, match="all its meshes are hidden; texbake reads") as warned:
        mesh = read(scene(models={"a": ({"Visibility": [0.0]}, None)}))
    assert mesh.group_names == ("a",) and len(warned) == 1


def test_zero_scale_is_read(read):
    mesh = read(scene(models={"a": ({"Lcl Scaling": [0.0, 0.0, 0.0]}, None)}))
    assert (mesh.positions == 0.0).all()


def test_a_transform_that_is_not_finite_names_the_model(read):
    bad = {"Lcl Translation": [np.nan, 0.0, 0.0]}
    with pytest.raises(MeshError, match=r"model 'a': its transform is not finite"):
        read(scene(models={"a": (bad, None)}))
    with pytest.raises(MeshError, match="geometry 'wall mesh': a value of Vertices"):
        read(scene(geometry=shape(points=POINTS + np.nan)))


def test_models_in_a_cycle(read):
    models = {"a": ({}, "b"), "b": ({}, "a"), "c": ({}, None)}
    with pytest.raises(FileFormatError, match="its models stand in a cycle"):
        read(scene(models=models))


def test_instances_are_bounded_by_the_size_of_the_file(read):
    n = 40_000
    polygons = np.tile(np.array([0, 1, -5], np.int32), n)
    models = {f"m{i}": ({}, None) for i in range(200)}
    with pytest.raises(FileFormatError, match="repeats far more triangles than it holds"):
        read(scene(models=models, geometry=shape(polygons=polygons)))


def test_a_geometry_that_is_connected_to_a_model_many_times_is_there_once(read):
    nodes = scene()
    nodes[2][2].extend([("C", ["OO", 10, 100], [])] * 20_000)
    np.testing.assert_array_equal(read(nodes).faces, FACES)


def bomb(count, content):
    """A file whose Vertices say a count and pack the content."""
    packed = zlib.compress(content)
    value = bytearray(b"d" + struct.pack("<III", count, 1, len(packed)) + packed)
    vertices = ("Vertices", [value], [])
    return binary(scene(geometry=[vertices, ("PolygonVertexIndex", [POLYGONS], [])]))


def test_arrays_that_unpack_to_other_than_they_say(read):
    with pytest.raises(FileFormatError, match="an array of 30 numbers is damaged"):
        read(bomb(30, bytes(8 * 29)))
    with pytest.raises(FileFormatError, match="an array of 30 numbers is damaged"):
        read(bomb(30, bytes(80_000_000)))
    with pytest.raises(FileFormatError, match="unpack to far more than its size"):
        read(bomb(50_000_000, b""))
