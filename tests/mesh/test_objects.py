"""Objects that touch have normals of their own; materials and shared vertices make no objects."""

import numpy as np
import pytest

from texbake import Mesh, RepairOptions, check, mesh_info, read_mesh, repair, write_mesh
from texbake.mesh.compose import join_meshes, join_parts, transformed
from texbake.mesh.normals import smooth_normals, vertex_curvatures
from texbake.mesh.objects import (
    has_borders,
    joined_objects,
    object_names,
    vertex_objects,
    without_borders,
)
from texbake.mesh.shapes import cube, icosphere

ASIDE = np.eye(4)
ASIDE[0, 3] = 1.0  # as wide as the cube
CUBES = [cube(), transformed(cube(), ASIDE)]


def grouped(mesh, name):
    return mesh.replace(face_groups=np.zeros(mesh.n_faces, np.int32), group_names=(name,))


NAMED = [grouped(mesh, name) for mesh, name in zip(CUBES, ("lid", "box"), strict=True)]


def obj_text(statement, *, welded=False):
    """Two cubes that touch, each after its own statement, or with the vertices of both shared."""
    whole = join_meshes(CUBES)
    points, faces = whole.positions, whole.faces
    if welded:
        points, inverse = np.unique(points, axis=0, return_inverse=True)
        faces = inverse.ravel()[faces]
    lines = ["v {} {} {}".format(*point) for point in points.tolist()]
    for name, rows in zip(("lid", "box"), np.split(faces + 1, 2), strict=True):
        lines += [statement.format(name), *("f {} {} {}".format(*row) for row in rows.tolist())]
    return "\n".join(lines) + "\n"


def corner_normals(mesh):
    return smooth_normals(mesh)[mesh.faces]


# A square with one side on the y axis, and the way to the square that ends there.
QUAD = Mesh(positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 2, 3]])
MOVED = np.eye(4)
MOVED[0, 3] = -1.0

APART = np.concatenate([corner_normals(mesh) for mesh in CUBES])
AS_ONE = corner_normals(joined_objects(join_meshes(CUBES)))


@pytest.mark.parametrize("make", [lambda: join_meshes(CUBES), lambda: join_parts(NAMED, "two")])
def test_objects_that_touch_keep_the_normals_they_have_alone(make):
    mesh = make()
    assert np.array_equal(corner_normals(mesh), APART)
    curved = [vertex_curvatures(one) for one in CUBES]
    assert np.allclose(vertex_curvatures(mesh), np.concatenate(curved), rtol=1e-12)
    assert not np.array_equal(AS_ONE, APART)
    assert np.array_equal(corner_normals(joined_objects(mesh)), AS_ONE)


@pytest.mark.parametrize(("statement", "welded", "expected"), [
    ("o {}", False, APART),
    ("g {}", False, APART),
    ("o scene\ng {}", False, APART),
    ("o {}\ng part", False, APART),
    ("usemtl {}", False, AS_ONE),
    ("o crate\nusemtl {}", False, AS_ONE),
    ("g {}", True, AS_ONE),
    ("", False, AS_ONE),
])  # fmt: skip
def test_objects_and_groups_are_apart_and_materials_not(tmp_path, statement, welded, expected):
    path = tmp_path / "two.obj"
    path.write_text(obj_text(statement, welded=welded))
    assert np.array_equal(corner_normals(read_mesh(path)), expected)


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".usda"])
def test_objects_come_back_from_files(tmp_path, suffix):
    write_mesh(join_parts(NAMED, "two"), tmp_path / f"two{suffix}")
    mesh = read_mesh(tmp_path / f"two{suffix}")
    assert (len(set(mesh.group_objects)), object_names(mesh)) == (2, ("lid", "box"))


def test_objects_whose_names_are_alike_as_identifiers(tmp_path):
    names = ("x_y", "x_y_3", "x y", "x_y_1", "x/y", "material")
    boxes = [grouped(transformed(cube(), ASIDE * (i + 2)), n) for i, n in enumerate(names)]
    write_mesh(join_parts(boxes, "six"), tmp_path / "six.usda")
    assert read_mesh(tmp_path / "six.usda").group_names == names


@pytest.mark.parametrize("suffix", [".obj", ".usda"])
def test_groups_of_objects_come_back_from_files(tmp_path, suffix):
    names = "lid", "lid/handle", "box"
    two = join_parts(NAMED, "two").replace(group_names=names, group_objects=(0, 0, 1))
    sides = np.where(two.face_groups == 1, 2, np.arange(two.n_faces) % 2)
    write_mesh(two.replace(face_groups=sides), tmp_path / f"two{suffix}")
    mesh = read_mesh(tmp_path / f"two{suffix}")
    assert mesh.group_names == names and mesh.group_objects == (0, 0, 1)


def test_an_object_of_two_groups_is_one():
    mesh = icosphere(1)
    halves = mesh.replace(
        face_groups=np.arange(mesh.n_faces) % 2, group_names=("ball/red", "ball/blue")
    )
    both = join_parts([halves, grouped(transformed(mesh, ASIDE), "other")], "both")
    assert both.group_objects == (0, 0, 1)
    assert object_names(both) == ("ball", "ball", "other")
    assert np.array_equal(np.bincount(vertex_objects(both)), [mesh.n_vertices] * 2)
    assert vertex_objects(halves) is None


def test_objects_that_share_a_vertex_are_one_by_way_of_others():
    faces = np.arange(9).reshape(3, 3)
    faces[1, 0] = faces[0, 2]
    points = np.arange(33.0).reshape(11, 3) ** 2
    chain = Mesh(
        positions=points, faces=faces, face_groups=[0, 1, 2], group_names=tuple("abc"),
        group_objects=(5, 3, 9),
    )  # fmt: skip
    found = vertex_objects(chain)
    assert len(set(found[faces[:2]].ravel())) == 1
    assert found[faces[2, 0]] not in found[faces[:2]]
    assert (found[9:] == -1).all() and found[3] == -1


@pytest.mark.parametrize(("angle", "are_one"), [(0.0, True), (59.0, True), (61.0, False)])
def test_a_surface_goes_on_in_an_object_that_begins_where_it_ends(angle, are_one):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    flap = np.eye(4)
    flap[:3, :3] = [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]
    both = join_meshes([transformed(QUAD, np.diag([-1.0, -1.0, 1.0, 1.0])), QUAD])
    turned = join_meshes([transformed(QUAD, MOVED), transformed(QUAD, flap)])
    assert vertex_objects(both) is not None  # they touch at a corner only
    assert (vertex_objects(turned) is None) == are_one


def test_objects_that_touch_are_repaired_and_checked_as_each_alone():
    mesh = join_meshes(CUBES)
    repaired, _ = repair(mesh)
    assert repaired.n_vertices == mesh.n_vertices and repaired.n_faces == mesh.n_faces
    assert np.array_equal(repaired.faces, mesh.faces)
    assert mesh_info(mesh).n_components == 2 and mesh_info(mesh).closed
    found = {finding.kind.name for finding in check(mesh).findings}
    assert not found & {"duplicate-faces", "non-manifold-edges", "inconsistent-winding"}
    joined, report = repair(mesh, RepairOptions(join_objects=True))
    assert joined.n_vertices == mesh.n_vertices - 4 and report.counts["duplicate faces"] == 2


@pytest.mark.parametrize("n_groups", [1, 2, 3])
def test_groups_of_one_object_have_borders_and_objects_have_none(n_groups):
    mesh = icosphere(1)
    ids, names = np.arange(mesh.n_faces) % n_groups, tuple("abc"[:n_groups])
    whole = mesh.replace(face_groups=ids, group_names=names)
    assert has_borders(whole) == (n_groups > 1)
    apart = join_parts([grouped(mesh, name) for name in names], "apart")
    assert not has_borders(apart)
    assert not has_borders(without_borders(whole)) and not has_borders(mesh)
