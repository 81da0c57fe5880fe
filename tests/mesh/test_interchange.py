"""Meshes from trimesh and back, and the objects that are accepted as meshes."""

import numpy as np
import pytest
import trimesh

import texbake
from texbake.errors import MeshError
from texbake.mesh.files.conversion import srgb_colors
from texbake.mesh.interchange import as_mesh
from texbake.mesh.shapes import uv_sphere
from texbake.mesh.tangents import corner_tangents


def test_seams_split_vertices_and_keep_every_corner():
    mesh = uv_sphere(6, 8)
    converted = texbake.to_trimesh(mesh)
    # The column of the seam and all but one coordinate of each pole stand behind the positions.
    assert np.array_equal(converted.vertices[: mesh.n_vertices], mesh.positions)
    assert len(converted.vertices) == mesh.n_vertices + 5 + 2 * 7
    back = texbake.from_trimesh(converted)
    assert np.array_equal(back.positions[back.faces], mesh.positions[mesh.faces])
    assert np.array_equal(back.corner_uvs(), mesh.corner_uvs())


def test_unused_vertices_and_degenerate_faces_stay():
    mesh = texbake.Mesh(
        positions=[[9, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[1, 2, 3], [1, 1, 2]],
        uvs=[[0, 0], [1, 0], [0, 1]], uv_faces=[[0, 1, 2], [0, 0, 1]],
    )  # fmt: skip
    converted = texbake.to_trimesh(mesh)
    assert converted.faces.tolist() == [[1, 2, 3], [1, 1, 2]]
    assert converted.visual.uv.tolist() == [[0, 0], [0, 0], [1, 0], [0, 1]]
    assert texbake.from_trimesh(converted).n_vertices == 4


def test_normals_that_nobody_gave_are_not_computed():
    box = trimesh.creation.box()
    assert texbake.from_trimesh(box).normals is None or "vertex_normals" in box._cache.cache
    given = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    assert texbake.from_trimesh(given).normals is None
    given.vertex_normals = [[1, 0, 0]] * 3
    assert texbake.from_trimesh(given).normals.tolist() == [[1, 0, 0]] * 3


def test_a_later_change_does_not_reach_the_other_mesh():
    box = trimesh.creation.box()
    mesh = texbake.from_trimesh(box)
    box.vertices[:] += 1.0
    assert mesh.positions.max() == 0.5


def test_a_scene_is_placed_and_joined():
    scene = trimesh.Scene()
    shift = trimesh.transformations.translation_matrix([2.0, 0.0, 0.0])
    scene.add_geometry(trimesh.creation.box(), node_name="left")
    scene.add_geometry(trimesh.creation.box(), node_name="right", transform=shift)
    mesh = texbake.from_trimesh(scene)
    assert mesh.n_faces == 24
    assert mesh.bounds.tolist() == [[-0.5, -0.5, -0.5], [2.5, 0.5, 0.5]]
    assert set(mesh.group_names) == {"left", "right"}


@pytest.mark.parametrize(
    "value", [None, 3, [[0, 0, 0]], trimesh.PointCloud([[0, 0, 0]]), trimesh.Trimesh()]
)
def test_objects_other_than_meshes_are_one_error(value):
    with pytest.raises(MeshError):
        as_mesh(value)


def test_a_broken_trimesh_is_one_error():
    points = [[0, 0, 0], [1, 0, 0], [0, np.nan, 0]]
    with pytest.raises(MeshError, match="not finite"):
        as_mesh(trimesh.Trimesh(points, [[0, 1, 2]], process=False))
    with pytest.raises(MeshError, match="out of range"):
        as_mesh(trimesh.Trimesh(np.eye(3), [[0, 1, 7]], process=False))


def test_public_functions_take_whatever_is_a_mesh(tmp_path):
    mesh = uv_sphere(12, 16)
    path = tmp_path / "sphere.obj"
    texbake.write_mesh(mesh, path)
    for value in (path, texbake.to_trimesh(mesh)):
        assert texbake.mesh_info(value).n_faces == mesh.n_faces
        assert corner_tangents(value).shape == (mesh.n_faces, 3, 4)
        assert texbake.simplify(value, 100).n_faces <= 100
        assert texbake.surface_distance(value, mesh).max < 1e-6
        texbake.write_mesh(value, tmp_path / "again.ply")
        assert texbake.read_mesh(tmp_path / "again.ply").n_faces == mesh.n_faces


CHOICES = [set(), {"uvs"}, {"normals"}, {"colors"}, {"uvs", "normals", "colors", "groups"}]


@pytest.mark.parametrize("has", CHOICES, ids=lambda has: "+".join(sorted(has)) or "bare")
def test_every_corner_comes_back(has):
    mesh = uv_sphere(4, 6).replace(name="ball")
    corners = np.arange(3 * mesh.n_faces, dtype=np.int32).reshape(-1, 3)
    colors = np.random.default_rng(1).random((mesh.n_vertices, 4), dtype=np.float32)
    if "uvs" not in has:
        mesh = mesh.replace(uvs=None, uv_faces=None)
    if "normals" in has:  # hard everywhere
        mesh = mesh.replace(normals=np.eye(3)[corners.ravel() % 3], normal_faces=corners)
    if "colors" in has:
        mesh = mesh.replace(colors=colors)
    if "groups" in has:
        ids = np.arange(mesh.n_faces, dtype=np.int32) % 3
        mesh = mesh.replace(face_groups=ids, group_names=("a", "b", "c"))
    back = texbake.from_trimesh(texbake.to_trimesh(mesh))
    assert back.name == "ball"
    np.testing.assert_array_equal(back.positions[back.faces], mesh.positions[mesh.faces])
    if not has:
        np.testing.assert_array_equal(back.faces, mesh.faces)
    assert (back.uvs is None) == ("uvs" not in has)
    if "uvs" in has:
        np.testing.assert_array_equal(back.corner_uvs(), mesh.corner_uvs())
    assert (back.normals is None) == ("normals" not in has)
    if "normals" in has:
        ours, theirs = (m.normals[m.normal_faces] for m in (mesh, back))
        np.testing.assert_array_equal(theirs, ours)
    assert (back.colors is None) == ("colors" not in has)
    if "colors" in has:  # half a step of 8 bits in sRGB, and what float32 adds to it
        steps = srgb_colors(back.colors)[back.faces] - srgb_colors(colors)[mesh.faces]
        assert np.abs(steps).max() <= 0.5 / 255 + 1e-6
    assert back.group_names == mesh.group_names
    np.testing.assert_array_equal(back.face_groups, mesh.face_groups)
