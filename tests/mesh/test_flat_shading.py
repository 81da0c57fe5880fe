"""Normals of facets: where they are all that a mesh has, no edge is hard."""

import numpy as np
import pytest

from tests.mesh.test_simplify import assert_same
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane
from texbake.mesh.simplify import simplify, simplify_with_report
from texbake.mesh.smoothing_groups import is_flat_shaded


def with_facet_normals(mesh, facet_of_face=None):
    """The mesh with one normal for each triangle, or for each group of triangles."""
    facets = np.arange(mesh.n_faces) if facet_of_face is None else facet_of_face
    a, b, c = (mesh.positions[mesh.faces[:, corner]] for corner in range(3))
    normals = np.zeros((facets.max() + 1, 3))
    np.add.at(normals, facets, np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normal_faces = np.repeat(facets[:, None], 3, axis=1).astype(np.int32)
    return mesh.replace(normals=normals, normal_faces=normal_faces)


def test_a_sphere_of_facets_is_flat_shaded():
    assert is_flat_shaded(with_facet_normals(icosphere(4)))


def test_so_is_one_of_polygons_cut_into_triangles():
    sphere = grid_sphere(24, 48)
    facets = np.unique(np.arange(sphere.n_faces) // 2, return_inverse=True)[1]
    assert is_flat_shaded(with_facet_normals(sphere, facets))


@pytest.mark.parametrize("mesh", [cube(), plane(8, 8)], ids=["cube", "plane"])
def test_what_is_built_of_flat_sides_is_not(mesh):
    assert not is_flat_shaded(with_facet_normals(mesh))


def test_smooth_and_absent_normals_are_not():
    sphere = icosphere(3)
    assert not is_flat_shaded(sphere.replace(normals=None, normal_faces=None))
    smooth = sphere.replace(normals=sphere.positions.copy(), normal_faces=sphere.faces)
    assert not is_flat_shaded(smooth)


def test_simplify_takes_no_edge_of_a_facet_for_a_hard_one():
    sphere = icosphere(4).replace(normals=None, normal_faces=None)
    for quality in ("fast", "best"):
        low, report = simplify_with_report(with_facet_normals(sphere), 300, quality=quality)
        assert_same(low, simplify(sphere, 300, quality=quality))
        assert "facets" in " ".join(report.notes)
