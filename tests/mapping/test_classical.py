"""Tests shared by plane, cylinder, sphere and box: bad input, size and place."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.artist_models import write_model
from tests.models import model, real
from texbake.mapping.classical.box import box
from texbake.mapping.classical.cylindrical import cylindrical, spherical
from texbake.mapping.classical.planar import planar
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.unwrap import unwrap
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.polygons import outlines
from texbake.mesh.shapes import orange

METHODS = {
    "planar": (planar, {"method": "planar"}),
    "planar pca": (planar, {"method": "planar", "fit": "pca"}),
    "planar sides": (planar, {"method": "planar", "normal": (1, 2, 3), "sides": True}),
    "cylindrical": (cylindrical, {"method": "cylindrical"}),
    "cylindrical caps": (cylindrical, {"method": "cylindrical", "caps": True}),
    "spherical": (spherical, {"method": "spherical", "axis": (1, -2, 3)}),
    "box": (box, {"method": "box"}),
    "box overlap": (box, {"method": "box", "overlap": True}),
}
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1], [-1, 0.5, 2], [0.5, -1, -1], [2, 2, 0]]
BAD = {
    "one triangle": [[0, 1, 2]],
    "one vertex": [[3, 3, 3]],
    "a repeated vertex": [[0, 1, 1], [0, 1, 2]],
    "opposite windings": [[0, 1, 2], [0, 1, 3]],
    "an edge of five faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4], [0, 1, 5], [1, 0, 6]],
    "one face both ways": [[0, 1, 2], [2, 1, 0]],
}
every_method = pytest.mark.parametrize("name", METHODS)


def mapped(name, mesh, **choices):
    method, fixed = METHODS[name]
    return method(mesh, UnwrapOptions(**fixed, **choices))


def check(found, mesh):
    assert found.corners.shape == (mesh.n_faces, 3, 2)
    assert np.isfinite(found.corners).all()
    assert all(count > 0 for count in found.tallies.values())


@every_method
@pytest.mark.parametrize("bad", BAD)
def test_bad_meshes_have_finite_coordinates(name, bad):
    mesh = Mesh(positions=CORNERS, faces=BAD[bad])
    check(mapped(name, mesh), mesh)


@every_method
@pytest.mark.parametrize("scale", [0.0, 5e-324, 1e-300, 1e300, 1.7e308])
def test_meshes_without_area_or_of_any_size_have_finite_coordinates(name, scale):
    line = np.array([[-1, -1, -1], [0, 0, 0], [1, 1, 1], [0.1, 0.1, 0.1]]) * scale
    for positions in line, np.array(CORNERS[:4]) * (scale / 2.0):
        mesh = Mesh(positions=positions, faces=[[0, 1, 2], [1, 2, 3], [0, 0, 3]])
        check(mapped(name, mesh), mesh)


@pytest.mark.parametrize("name", [name for name in METHODS if "planar" not in name])
def test_a_center_equal_to_every_vertex_is_defined(name):
    mesh = Mesh(positions=[[3e5, 4.1, -5]] * 3, faces=[[0, 1, 2]] * 2)
    found = mapped(name, mesh, center=(3e5, 4.1, -5))
    check(found, mesh)
    assert sum(found.tallies.values()) > 0
    assert np.ptp(found.corners.reshape(-1, 2), axis=0).tolist() == [0.0, 0.0]


@given(
    st.sampled_from(sorted(METHODS)),
    st.lists(
        st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=9, max_size=9),
        min_size=1,
        max_size=3,
    ),
)
def test_any_finite_triangles_have_finite_coordinates(name, triangles):
    positions = np.array(triangles).reshape(-1, 3)
    mesh = Mesh(positions=positions, faces=np.arange(len(positions)).reshape(-1, 3))
    check(mapped(name, mesh), mesh)


@every_method
def test_size_and_place_that_lose_no_bits_change_none(name):
    # On a grid of 2^-20, so that 2^20 can be added: an offset of half a million times the size.
    mesh = orange(2000)
    positions = np.round(mesh.positions * 2.0**20) / 2.0**20
    here = mapped(name, mesh.replace(positions=positions))
    moved = positions + np.array([2.0**20, 0.0, -(2.0**19)])
    for scale in 2.0**-20, 1.0, 2.0**20:
        there = mapped(name, mesh.replace(positions=moved * scale))
        assert np.array_equal(there.corners, here.corners)
        assert there.tallies == here.tallies


@every_method
@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_size_and_place_change_no_more_than_rounding(name, scale, offset):
    mesh = orange(2000)
    here = mapped(name, mesh)
    there = mapped(name, mesh.replace(positions=(mesh.positions + offset) * scale))
    off = np.abs(there.corners - here.corners)
    # At an offset of 1e6 positions are rounded to 1e-10 of the size, and angles, near the axis,
    # are off by some ten times that.
    assert off.max() < (1e-13 if offset == 0.0 else 1e-8)


@every_method
def test_a_mesh_maps_as_its_faces_do_one_by_one(name):
    """Vertices split for each face change nothing: coordinates belong to corners."""
    mesh = orange(500)
    soup = Mesh(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.arange(3 * mesh.n_faces).reshape(-1, 3),
    )
    assert np.array_equal(mapped(name, soup).corners, mapped(name, mesh).corners)


@every_method
@pytest.mark.parametrize(
    "path", ["organs", "bracket", "fused cells", *real("meshes/boot.obj", "broken/VH_M_Heart.glb")]
)
def test_rough_and_broken_meshes_are_mapped(name, path):
    mesh = model(path)
    found = mapped(name, mesh)
    check(found, mesh)
    spans = np.ptp(found.corners[..., 0], axis=1)
    if name in ("cylindrical", "spherical"):
        n_around = sum(count for what, count in found.tallies.items() if " around " in what)
        assert (spans > 0.5).sum() <= n_around
    else:
        assert found.corners.max() <= 1.0 + 1e-12 or "caps" in name
    if name in ("box", "box overlap", "planar sides"):
        # What float32 leaves of faces without width may turn over; it has no area to speak of.
        areas = signed_areas(found.corners)
        assert -areas[areas < 0.0].sum() < 1e-12


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("creature", {"method": "cylindrical"}),
        ("creature", {"method": "spherical"}),
        ("screw", {"method": "spherical"}),
        ("chest", {"method": "cylindrical", "axis": "z", "caps": True}),
        ("creature", {"method": "two-part", "surface": "cylinder", "via": "object-normal"}),
        ("creature", {"method": "two-part", "surface": "sphere", "via": "centroid"}),
        ("wall", {"method": "projector", "unseen": "aside", "camera": (40, 30)}),
    ],
)
def test_polygons_are_whole_across_seams(name, options, tmp_path):
    mesh = read_mesh(write_model(name, tmp_path / "a.obj"))
    apart = unwrap(mesh.replace(polygon_of=None), **options).replace(polygon_of=mesh.polygon_of)
    assert outlines(apart).n_split > 0
    assert outlines(unwrap(mesh, **options)).n_split == 0


def test_triangles_seen_edge_on_go_with_their_polygon():
    corners = [(0, 0, 0), (0.5, 0.5, 1), (1, 1, 0), (1, 0, 0)]
    quad = Mesh(positions=corners, faces=[[0, 1, 2], [0, 2, 3]], polygon_of=[0, 0])
    assert outlines(unwrap(quad, method="planar", sides=True)).n_split == 0
