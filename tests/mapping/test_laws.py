"""What holds for every mapping: what it leaves alone, what changes nothing, and any mesh."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.artist_models import write_model
from tests.models import model, real, soup_of
from texbake import Mesh, UnwrapOptions, read_mesh, unwrap
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.options import METHODS
from texbake.mapping.options.projection import SURFACES, VIAS
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import chart_ids
from texbake.mapping.unwrap import _mapped_classically, unwrap_with_report
from texbake.mesh.polygons import outlines
from texbake.mesh.shapes import grid_sphere, icosphere, orange

EYE = (0.7, 1.1, 5.0)
CLASSICAL = {
    "planar": {"method": "planar"},
    "planar pca": {"method": "planar", "fit": "pca"},
    "planar sides": {"method": "planar", "normal": (1.0, 2.0, 3.0), "sides": True},
    "cylindrical": {"method": "cylindrical"},
    "cylindrical caps": {"method": "cylindrical", "axis": (1.0, 2.0, -0.5), "caps": True},
    "spherical": {"method": "spherical", "axis": (1.0, -2.0, 3.0)},
    "box": {"method": "box"},
    "box overlap": {"method": "box", "overlap": True},
    "projector": {"method": "projector", "camera": (40.0, 25.0)},
    **{
        f"{surface} by {via}": {"method": "two-part", "surface": surface, "via": via}
        | ({"eye": EYE} if via == "reflection" else {})
        for surface, via in itertools.product(SURFACES, VIAS)
    },
}
ATLASES = {
    "fast": {"quality": "fast"},
    "good": {"max_stretch": 1.003},
    "best": {"quality": "best", "seam_angle": 40.0},
}
PARAMETRIC = {"method": "parametric", "linear": (2.0, -1.0, 0.25, 0.5, 3.0, -7.0)}
every_mapping = pytest.mark.parametrize(
    "options", [pytest.param(o, id=name) for name, o in (CLASSICAL | ATLASES).items()]
)
every_classical = pytest.mark.parametrize(
    "options", [pytest.param(o, id=name) for name, o in CLASSICAL.items()]
)

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1], [-1, 0.5, 2], [0.5, -1, -1], [2, 2, 0]]


def bumpy():
    """Closed and without symmetry, so that no decision depends on rounding, on a grid of 2^-20."""
    ball = icosphere(2)
    x, y, z = ball.positions.T
    radii = 1.0 + 0.2 * np.sin(3.0 * x + 1.0) * np.cos(2.0 * y - z) + 0.1 * z
    shear = np.array([[1.3, 0.2, -0.1], [0.05, 0.8, 0.3], [0.1, -0.2, 1.1]])
    positions = ball.positions * radii[:, None] @ shear.T
    return Mesh(positions=np.round(positions * 2.0**20) / 2.0**20, faces=ball.faces)


def mapped(mesh, options):
    """Map without the checks of `unwrap`, which refuses meshes of extreme size."""
    found = _mapped_classically(mesh, UnwrapOptions(**options))
    assert found.corners.shape == (mesh.n_faces, 3, 2)
    assert np.isfinite(found.corners).all()
    assert all(count > 0 for count in found.tallies.values())
    return found


def placed(options, scale, offset):
    """Options for a mesh that is moved, then scaled."""
    eye = {"eye": tuple(((np.array(EYE) + offset) * scale).tolist())} if options.get("eye") else {}
    return options | eye


def test_every_method_is_here():
    assert set(METHODS) == {o.get("method", "atlas") for o in (*CLASSICAL.values(), {}, PARAMETRIC)}


@every_mapping
def test_only_the_coordinates_change(options):
    mesh = bumpy()
    groups = np.arange(mesh.n_faces) % 2
    mesh = mesh.replace(
        normals=[[0, 0, 1]], normal_faces=np.zeros_like(mesh.faces), face_groups=groups,
        group_names=("a", "b"), colors=np.full((mesh.n_vertices, 3), 0.5),
        tangents=np.tile([1.0, 0.0, 0.0, 1.0], (mesh.n_faces, 3, 1)),
    )  # fmt: skip
    after, report = unwrap_with_report(mesh, UnwrapOptions(**options))
    for name in ("positions", "faces", "normals", "normal_faces", "colors", "face_groups"):
        assert np.shares_memory(getattr(after, name), getattr(mesh, name))
    assert (after.group_names, after.name, after.tangents) == (("a", "b"), mesh.name, None)
    assert after.uvs is not None and np.isfinite(after.uvs).all()
    # Each pair of a vertex and a coordinate is stored once.
    pairs = np.stack([after.faces.ravel(), after.uv_faces.ravel()], axis=1)
    assert len(np.unique(pairs, axis=0)) == len(after.uvs)
    written = json.loads(json.dumps(report.to_json(), allow_nan=False))
    method = options.get("method", "atlas")
    assert {name: written["options"][name] for name in options} == json.loads(json.dumps(options))
    unread = set().union(*(each.options for each in METHODS.values())) - {*METHODS[method].options}
    assert not unread & set(written["options"])
    assert all(count > 0 for count in written["tallies"].values())


@every_classical
@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_size_and_place_change_no_more_than_rounding(options, scale, offset):
    mesh = bumpy()
    here = mapped(mesh, options)
    moved = mesh.replace(positions=(mesh.positions + offset) * scale)
    there = mapped(moved, placed(options, scale, offset))
    # At an offset of 1e6 positions have ten digits, normals of edges of 0.1 have nine, and a ray
    # that meets a surface four sizes away at a low angle makes a hundred times of that.
    assert np.abs(there.corners - here.corners).max() < (1e-10 if offset == 0.0 else 1e-6)
    assert there.tallies == here.tallies


@every_classical
def test_vertices_that_a_file_repeats_or_does_not_use_change_no_bit(options):
    mesh = bumpy()
    apart = soup_of(mesh)
    apart = apart.replace(positions=np.concatenate([apart.positions, [[1e3] * 3]]))
    assert np.array_equal(mapped(apart, options).corners, mapped(mesh, options).corners)


@pytest.mark.parametrize("name", ["planar", "cylindrical", "spherical", "cylinder by centroid"])
def test_turned_faces_have_mirrored_coordinates(name):
    mesh = bumpy()
    turned = mesh.replace(faces=mesh.faces[:, ::-1])
    here, there = (mapped(each, CLASSICAL[name]).corners for each in (mesh, turned))
    np.testing.assert_allclose(there[:, ::-1], here, atol=1e-15)


@pytest.mark.parametrize(
    "options", [*ATLASES.values(), CLASSICAL["box"], CLASSICAL["planar sides"]]
)
def test_no_face_of_a_convex_mesh_overlaps_another_or_is_mirrored(options):
    ball = icosphere(3)
    mesh = ball.replace(positions=ball.positions * (3.0, 2.0, 1.1) + 0.1 * ball.positions[:, :1])
    corners = unwrap(mesh, UnwrapOptions(**options)).corner_uvs()
    assert (signed_areas(corners) > 0.0).all()
    assert not find_overlaps(corners).overlapping.any()


@pytest.mark.parametrize(
    "options", [o for o in CLASSICAL.values() if not {"eye", "camera"} & set(o)]
)
def test_meshes_without_area_or_of_any_size_have_finite_coordinates(options):
    line = np.array([[-1, -1, -1], [0, 0, 0], [1, 1, 1], [0.1, 0.1, 0.1]])
    for scale in (0.0, 5e-324, 1e-300, 1e300, 1.7e308):
        for positions in line * scale, np.array(CORNERS[:4]) * (scale / 2.0):
            mesh = Mesh(positions=positions, faces=[[0, 1, 2], [1, 2, 3], [0, 0, 3]])
            assert np.isfinite(mapped(mesh, options).corners).all()


@pytest.mark.parametrize(
    "name", [n for n in CLASSICAL if "center" in METHODS[CLASSICAL[n]["method"]].options]
)
def test_a_center_equal_to_every_vertex_is_defined(name):
    mesh = Mesh(positions=[[3e5, 4.1, -5]] * 3, faces=[[0, 1, 2]] * 2)
    found = mapped(mesh, CLASSICAL[name] | {"center": (3e5, 4.1, -5)})
    assert np.ptp(found.corners.reshape(-1, 2), axis=0).tolist() == [0.0, 0.0]


@settings(max_examples=60)
@given(
    st.sampled_from(sorted(CLASSICAL)),
    st.lists(
        st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=9, max_size=9),
        min_size=1,
        max_size=3,
    ),
)
def test_any_finite_triangles_have_finite_coordinates(name, triangles):
    positions = np.array(triangles).reshape(-1, 3)
    mesh = Mesh(positions=positions, faces=np.arange(len(positions)).reshape(-1, 3))
    assert np.isfinite(mapped(mesh, CLASSICAL[name]).corners).all()


@every_classical
@pytest.mark.parametrize(
    "path", ["organs", "bracket", "bumpy", *real("meshes/boot.obj", "broken/VH_M_Heart.glb")]
)
def test_no_face_is_smeared_across_a_seam(options, path):
    mesh = bumpy() if path == "bumpy" else model(path)
    found = mapped(mesh, options)
    spans = np.ptp(found.corners[..., 0], axis=1)
    shape = options.get("surface", options["method"])
    if shape in ("cylindrical", "spherical", "cylinder", "sphere") and not options.get("caps"):
        n_around = sum(count for what, count in found.tallies.items() if " around " in what)
        assert (spans > 0.5).sum() <= n_around
    elif shape == "plane":
        assert np.abs(found.corners - 0.5).max() <= 4.5
    elif shape != "projector" and not options.get("caps"):
        assert found.corners.min() >= -1e-12 and found.corners.max() <= 1.0 + 1e-12
    if (shape == "box" and not options.get("via")) or options.get("sides"):
        # What float32 leaves of faces without width may turn over; it has no area to speak of.
        areas = signed_areas(found.corners)
        assert -areas[areas < 0.0].sum() < 1e-12


def star(n_points):
    """A prism over a star, whose two caps are polygons."""
    n = 2 * n_points
    turns = np.pi * np.arange(n) / n_points
    radii = np.where(np.arange(n) % 2, 0.3, 1.0)
    ring = np.stack([radii * np.cos(turns), radii * np.sin(turns), np.zeros(n)], axis=1)
    inner, i = np.arange(1, n, 2), np.arange(n)
    tips = np.stack([inner, (inner + 1) % n, (inner + 2) % n], axis=1)
    fan = np.stack([np.full(n_points - 2, 1), inner[1:-1], inner[2:]], axis=1)
    cap = np.concatenate([tips, fan])
    j = np.roll(i, -1)
    walls = np.stack([i, j, n + j, i, n + j, n + i], axis=1).reshape(-1, 3)
    polygons = [np.zeros(len(cap)), np.ones(len(cap)), 2 + np.arange(2 * n) // 2]
    return Mesh(
        positions=np.concatenate([ring, ring + np.array([0.0, 0.0, 0.8])]),
        faces=np.concatenate([cap[:, ::-1], n + cap, walls]),
        polygon_of=np.concatenate(polygons).astype(np.int32),
    )


@pytest.mark.parametrize(("name", "options"), [
    ("creature", {"method": "cylindrical"}),
    ("creature", {"method": "spherical"}),
    ("screw", {"method": "spherical"}),
    ("chest", {"method": "cylindrical", "axis": "z", "caps": True}),
    ("creature", {"method": "two-part", "surface": "cylinder", "via": "object-normal"}),
    ("creature", {"method": "two-part", "surface": "sphere", "via": "centroid"}),
    ("wall", {"method": "projector", "unseen": "aside", "camera": (40, 30)}),
    ("ball", {"quality": "fast"}),
    ("ball", {"quality": "best"}),
    ("star", {"quality": "fast"}),
])  # fmt: skip
def test_polygons_are_whole_across_seams(name, options, tmp_path):
    if name == "ball":
        mesh = grid_sphere(14, 24)
        bent = mesh.positions * (1 + 0.3 * np.sin(5 * mesh.positions[:, [1]]))
        mesh = mesh.replace(positions=bent, polygon_of=np.arange(mesh.n_faces) // 2)
    elif name == "star":
        mesh = star(16)
    else:
        mesh = read_mesh(write_model(name, tmp_path / "a.obj"))
    apart = unwrap(mesh.replace(polygon_of=None), **options).replace(polygon_of=mesh.polygon_of)
    assert outlines(apart).n_split > 0
    assert outlines(unwrap(mesh, **options)).n_split == 0


def test_triangles_seen_edge_on_go_with_their_polygon():
    corners = [(0, 0, 0), (0.5, 0.5, 1), (1, 1, 0), (1, 0, 0)]
    quad = Mesh(positions=corners, faces=[[0, 1, 2], [0, 2, 3]], polygon_of=[0, 0])
    assert outlines(unwrap(quad, method="planar", sides=True)).n_split == 0


@pytest.mark.parametrize("options", ATLASES.values(), ids=ATLASES)
def test_atlases_do_not_depend_on_threads_or_on_repeated_vertices(options):
    mesh = orange(400)
    one, three = (unwrap(mesh, **options, threads=threads) for threads in (1, 3))
    assert one.uvs.tobytes() == three.uvs.tobytes()
    assert one.uv_faces.tobytes() == three.uv_faces.tobytes()
    assert chart_ids(unwrap(soup_of(mesh), **options)).max() == chart_ids(one).max()
