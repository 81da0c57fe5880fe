import json
from collections import Counter

import numpy as np
import pytest

from tests.models import model, real
from texbake import Mesh, mesh_info
from texbake.mesh.shapes import cube, plane

CUBE = (cube().positions + 0.5) * [2.0, 3.0, 4.0]
CUBE_FACES = cube().faces


def test_split_vertices_count_as_one_and_unused_ones_do_not_widen_the_bounds():
    split = Mesh(
        positions=np.concatenate([CUBE[CUBE_FACES.ravel()], [[99, 99, 99]]]),
        faces=np.arange(36).reshape(-1, 3),
    )
    info = mesh_info(split)
    assert info.bounds == ((0.0, 0.0, 0.0), (2.0, 3.0, 4.0))
    assert (info.n_split_vertices, info.n_unused_vertices) == (28, 1)
    assert (info.closed, info.genus, info.n_components) == (True, 0, 1)


def test_faults_are_counted():
    faces = np.concatenate([CUBE_FACES[1:], [CUBE_FACES[2][[1, 2, 0]]], [[0, 0, 1]]])
    info = mesh_info(Mesh(positions=CUBE, faces=faces))
    assert (info.n_degenerate_faces, info.n_duplicate_faces) == (1, 1)
    assert (info.n_boundary_edges, info.n_non_manifold_edges) == (3, 0)  # as without duplicates
    assert (info.closed, info.genus) == (False, None)


def test_mesh_of_nothing_but_degenerate_faces():
    info = mesh_info(Mesh(positions=[[0, 0, 0], [1, 0, 0]], faces=[[0, 1, 1], [0, 0, 0]]))
    assert (info.n_degenerate_faces, info.area, info.n_components) == (2, 0.0, 1)
    assert (info.n_boundary_edges, info.closed, info.genus) == (0, False, None)


def test_texture_coordinates():
    uvs = [[0, 0], [1, 0], [0, 1], [1.5, 0], [0.5, 0], [9, -9]]
    uv_faces = np.zeros((12, 3), dtype=int)
    uv_faces[:4] = [[0, 1, 2], [0, 2, 1], [0, 3, 2], [0, 4, 1]]
    info = mesh_info(Mesh(positions=CUBE, faces=CUBE_FACES, uvs=uvs, uv_faces=uv_faces)).uvs
    assert (info.n_uvs, info.bounds) == (6, ((0.0, 0.0), (1.5, 1.0)))
    assert (info.n_out_of_tile, info.n_without_area, info.n_mirrored) == (1, 9, 1)


def test_json():
    mesh = Mesh(
        positions=CUBE, faces=CUBE_FACES, normals=[[0, 0, 1]],
        normal_faces=np.zeros((12, 3), dtype=int), face_groups=[0] * 5 + [2] * 7,
        group_names=("a", "b", "ç"), colors=np.ones((8, 3)),
    )  # fmt: skip
    info = mesh_info(mesh)
    read = json.loads(info.to_json())
    assert read["n_normals"] == 1
    assert read["has_colors"] is True
    assert read["groups"] == [
        {"name": "a", "n_faces": 5},
        {"name": "b", "n_faces": 0},
        {"name": "ç", "n_faces": 7},
    ]
    assert read["bounds"] == [[0.0, 0.0, 0.0], [2.0, 3.0, 4.0]]


@pytest.mark.parametrize(("name", "facts"), [
    ("figure", {"closed": True, "genus": 1, "n_components": 1}),
    ("sponge", {"closed": True, "genus": 81, "n_faces": 2112, "area": 1056.0}),
    ("bracket", {"closed": True, "genus": 12, "n_split_vertices": 4980 - 808}),
    ("scan", {"closed": False, "genus": None, "n_components": 5}),
    ("fused cells", {"closed": False, "n_boundary_edges": 0, "n_duplicate_faces": 9,
                     "n_degenerate_faces": 5, "genus": None}),
    ("crossing figures", {"closed": True, "genus": 2, "n_components": 2}),
])  # fmt: skip
def test_facts_that_models_have_by_construction(name, facts):
    info = mesh_info(model(name))
    assert {fact: getattr(info, fact) for fact in facts} == facts


@pytest.mark.parametrize("name", ["inverted figure", *real("broken/inverted_triangles.obj")])
def test_edges_that_both_faces_wind_the_same_way_are_misoriented(name):
    mesh = model(name)
    edges = Counter(zip(mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel(), strict=True))
    twice = sum(count == 2 for count in edges.values())
    assert mesh_info(mesh).n_misoriented_edges == twice > 1000


def test_an_area_beyond_float64_is_infinite_and_null_in_json():
    info = mesh_info(Mesh(positions=[[0, 0, 0], [1e300, 0, 0], [0, 1e300, 0]], faces=[[0, 1, 2]]))
    assert info.area == np.inf
    assert info.diagonal == pytest.approx(2**0.5 * 1e300)
    assert json.loads(info.to_json())["area"] is None


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200, 8e307])
def test_texture_coordinates_of_any_size_have_their_signs(size):
    square = plane(3, 3)
    uvs = square.uvs.copy() * 2.0 - 1.0
    flipped = square.replace(
        uvs=uvs * size * [-1.0, 1.0], faces=square.faces, uv_faces=square.uv_faces
    )
    info = mesh_info(flipped).uvs
    assert (info.n_without_area, info.n_mirrored) == (0, square.n_faces)
