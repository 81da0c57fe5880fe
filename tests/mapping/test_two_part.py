import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mapping.classical.cylindrical import cylindrical, spherical
from texbake.mapping.classical.planar import planar
from texbake.mapping.classical.two_part import two_part
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.projection import SURFACES, VIAS
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane, uv_sphere

PAIRS = tuple(itertools.product(SURFACES, VIAS))
EYE = (0.7, 1.1, 5.0)

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)
centers = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def mapped(mesh: Mesh, surface: str, via: str, **options: object) -> Projected:
    if via == "reflection":
        options.setdefault("eye", EYE)
    return two_part(mesh, UnwrapOptions(method="two-part", surface=surface, via=via, **options))


def soup(seed: int, n_faces: int = 40) -> Mesh:
    """Triangles anywhere: each corner has the normal of its face."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (n_faces, 1, 3)) + rng.normal(0.0, 0.1, (n_faces, 3, 3))
    faces = np.arange(3 * n_faces, dtype=np.int32).reshape(-1, 3)
    return Mesh(positions=corners.reshape(-1, 3), faces=faces)


def bumpy() -> Mesh:
    """Closed and without symmetry, so that no decision hangs on rounding."""
    ball = icosphere(3)
    x, y, z = ball.positions.T
    radii = 1.0 + 0.2 * np.sin(3.0 * x + 1.0) * np.cos(2.0 * y - z) + 0.1 * z
    shear = np.array([[1.3, 0.2, -0.1], [0.05, 0.8, 0.3], [0.1, -0.2, 1.1]])
    return Mesh(positions=ball.positions * radii[:, None] @ shear.T, faces=ball.faces)


def moved(mesh: Mesh, scale: float, offset: object) -> Mesh:
    return Mesh(positions=mesh.positions * scale + np.asarray(offset), faces=mesh.faces)


@given(st.integers(0, 1000), directions, centers)
@settings(max_examples=25)
def test_a_sphere_from_its_center_is_the_spherical_mapping(
    seed: int, axis: tuple[float, ...], center: tuple[float, ...]
) -> None:
    mesh = soup(seed)
    options = UnwrapOptions(method="spherical", axis=axis, center=center)  # type: ignore[arg-type]
    expected = spherical(mesh, options)
    for via in "centroid", "surface-normal":
        found = mapped(mesh, "sphere", via, axis=axis, center=center)
        assert np.array_equal(found.corners, expected.corners)
        assert found.tallies == expected.tallies


@given(st.integers(0, 1000), directions, centers, st.sampled_from([None, (-2.0, 1.0)]))
@settings(max_examples=25)
def test_a_cylinder_by_its_normals_is_the_cylindrical_mapping(
    seed: int,
    axis: tuple[float, ...],
    center: tuple[float, ...],
    height: tuple[float, float] | None,
) -> None:
    mesh = soup(seed)
    where = {"axis": axis, "center": center, "theta": (10.0, 250.0), "height": height}
    expected = cylindrical(mesh, UnwrapOptions(method="cylindrical", **where))  # type: ignore[arg-type]
    found = mapped(mesh, "cylinder", "surface-normal", **where)
    assert np.array_equal(found.corners, expected.corners)
    assert found.tallies == expected.tallies


@given(st.integers(0, 1000), directions)
@settings(max_examples=25)
def test_a_plane_by_its_normal_is_the_planar_mapping(seed: int, axis: tuple[float, ...]) -> None:
    mesh = soup(seed)
    expected = planar(mesh, UnwrapOptions(method="planar", axis=axis))  # type: ignore[arg-type]
    found = mapped(mesh, "plane", "surface-normal", axis=axis)
    np.testing.assert_allclose(found.corners, expected.corners, atol=1e-9)


def ray_directions(mesh: Mesh, via: str, corners: np.ndarray) -> np.ndarray:
    """(F, 3, 3) of a soup about the origin, after the formulas of the paper."""
    if via == "centroid":
        return corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True))[:, None]
    if via == "object-normal":
        return np.broadcast_to(normals, corners.shape)
    v = np.array(EYE) - corners
    v /= np.linalg.norm(v, axis=2, keepdims=True)
    return 2.0 * (normals * v).sum(axis=2, keepdims=True) * normals - v


def s_and_t(angle: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.stack([0.5 + angle / (2.0 * np.pi), t], axis=-1)


@pytest.mark.parametrize("via", ["object-normal", "centroid", "reflection"])
@pytest.mark.parametrize("surface", ["plane", "cylinder", "sphere"])
def test_pairs_against_closed_forms(surface: str, via: str) -> None:
    mesh = soup(3, 400)
    corners = mesh.positions[mesh.faces]
    along = ray_directions(mesh, via, corners)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    with np.errstate(divide="ignore"):
        if surface == "plane":
            steps = (high[2] - corners[..., 2]) / along[..., 2]
        else:  # about y, so that the angle is that of (z, x)
            flat = np.array([1.0, float(surface == "sphere"), 1.0])
            a, b = (along**2) @ flat, (corners * along) @ flat
            squares = (mesh.positions**2) @ flat
            steps = (np.sqrt(b * b - a * ((corners**2) @ flat - squares.max())) - b) / a
    met = corners + steps[:, :, None] * along
    if surface == "plane":
        expected = (met[..., :2] - low[:2]) / (high - low)[:2].max()
    elif surface == "cylinder":
        t = (met[..., 1] - low[1]) / (high - low)[1]
        expected = s_and_t(np.arctan2(met[..., 0], met[..., 2]), t)
    else:
        latitude = np.arctan2(met[..., 1], np.hypot(met[..., 0], met[..., 2]))
        expected = s_and_t(np.arctan2(met[..., 0], met[..., 2]), 0.5 + latitude / np.pi)
    # Rays that come to the surface, no further away than its size, by all corners of a face.
    near = (np.abs(expected - 0.5).max(axis=2) <= 4.4) & (steps > 0.0)
    whole = near.all(axis=1)
    assert whole.sum() > 100
    found = mapped(mesh, surface, via, center=(0.0, 0.0, 0.0)).corners
    difference = (found - expected)[whole]
    if surface != "plane":
        difference[..., 0] -= np.round(difference[..., 0])  # whole turns
    assert np.abs(difference).max() <= 1e-9


def test_a_reflection_by_hand() -> None:
    # A floor at z = 0 that looks up to the eye at (0, 0, 2), and a ceiling at z = 3: what the point
    # (a, b, 0) mirrors to the eye lies above (a, b) (1 + 3 / 2).
    floor = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    spot = np.array([[0.0, 0, 3], [0, 0, 3], [0, 0, 3]])
    mesh = Mesh(positions=np.concatenate([floor, spot]), faces=[[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    found = mapped(mesh, "plane", "reflection", eye=(0.0, 0.0, 2.0))
    expected = 0.5 + 0.5 * 2.5 * floor[:, :2]
    np.testing.assert_allclose(found.corners[:2], expected[mesh.faces[:2]], atol=1e-12)
    assert found.tallies == {
        "corners without a ray, sent from the center": 3,  # the spot has no normal
    }


def test_the_normals_of_a_sphere_are_rays_from_its_center() -> None:
    mesh = icosphere(3)
    by_normal = mapped(mesh, "sphere", "object-normal").corners
    by_center = mapped(mesh, "sphere", "centroid").corners
    # Smooth normals of a sphere of 1280 triangles are off by up to 0.01 of a right angle; corners
    # at the poles fan out.
    apart = np.abs(by_normal - by_center)
    polar = np.hypot(mesh.positions[:, 0], mesh.positions[:, 2])[mesh.faces].min(axis=1) < 0.2
    assert apart[~polar].max() < 0.01


def test_a_cube_by_the_normals_of_its_box_fills_six_equal_squares() -> None:
    mesh = cube()
    found = mapped(mesh, "box", "surface-normal")
    assert found.tallies == {}
    areas = 0.5 * np.linalg.det(found.corners[:, 1:] - found.corners[:, :1])
    assert (areas > 0.0).all()  # seen from outside, none is mirrored
    np.testing.assert_allclose(areas, areas[0], rtol=1e-12)
    # Two faces a side, and the sides in a cell each.
    normals = np.cross(*np.diff(mesh.positions[mesh.faces], axis=1).transpose(1, 0, 2))
    middles = {
        tuple(normal): found.corners[(normals == normal).all(axis=1)].mean(axis=(0, 1)).round(3)
        for normal in normals
    }
    assert len(middles) == len({tuple(middle) for middle in middles.values()}) == 6


@pytest.mark.parametrize(("surface", "via"), PAIRS)
@pytest.mark.parametrize("center", [None, (0.1, -0.2, 0.3), (8.0, 5.0, -9.0)])
def test_no_face_is_smeared_across_the_seam(
    surface: str, via: str, center: tuple[float, float, float] | None
) -> None:
    mesh = bumpy()
    found = mapped(mesh, surface, via, center=center)
    assert np.isfinite(found.corners).all()
    span = np.ptp(found.corners[..., 0], axis=1)
    if surface in ("cylinder", "sphere"):
        around = sum(n for name, n in found.tallies.items() if name.startswith("faces around"))
        assert (span > 0.5).sum() <= around
    elif surface == "box":
        # Two cells with the gap between them are wider than any face in one of them can be.
        assert span.max() < 0.5
        assert found.corners.min() >= 0.0
        assert found.corners.max() <= 1.0
    else:
        assert np.abs(found.corners - 0.5).max() <= 4.5


def awkward_meshes() -> list[Mesh]:
    quad = plane()
    fin = np.array([[0.0, 0, 0], [1, 0, 0], *[[0.5, math.cos(a), math.sin(a)] for a in range(5)]])
    return [
        cube(),
        plane(4, 4),
        grid_sphere(5, 7),  # open
        uv_sphere(4, 5),
        Mesh(positions=np.eye(3), faces=[[0, 1, 2]]),
        Mesh(positions=np.ones((1, 3)), faces=[[0, 0, 0]]),
        Mesh(positions=np.eye(3), faces=[[0, 0, 1], [1, 2, 2]]),  # all degenerate
        Mesh(positions=np.outer(np.arange(4.0), [0, 1, 0]), faces=[[0, 1, 2], [1, 2, 3]]),
        Mesh(positions=quad.positions, faces=[*quad.faces.tolist(), [0, 1, 2], [2, 1, 0]]),
        Mesh(positions=quad.positions, faces=[[0, 1, 3], [0, 2, 3]]),  # opposite winding
        Mesh(positions=fin, faces=[[0, 1, 2 + k] for k in range(5)]),  # five at one edge
        Mesh(positions=np.concatenate([fin, [[1e300] * 3]]), faces=[[0, 1, 2], [0, 2, 3]]),
    ]


@pytest.mark.parametrize(("surface", "via"), PAIRS)
def test_every_pair_maps_every_mesh_to_finite_coordinates(surface: str, via: str) -> None:
    for mesh in awkward_meshes():
        at_vertex = tuple(mesh.positions[mesh.faces[0, 0]].tolist())
        for axis in "x", "y", "z", (1.0, 2.0, -3.0):
            for center in None, at_vertex, (5.0, 0.0, 0.0):
                options = {"axis": axis, "center": center}
                if via == "reflection":
                    options["eye"] = at_vertex
                found = mapped(mesh, surface, via, **options)
                assert found.corners.shape == (mesh.n_faces, 3, 2)
                assert np.isfinite(found.corners).all()
                assert all(found.tallies.values())


@pytest.mark.parametrize(("surface", "via"), PAIRS)
def test_neither_size_nor_place_changes_anything(surface: str, via: str) -> None:
    mesh = bumpy()
    expected = mapped(mesh, surface, via)
    eye = np.array(EYE)
    for scale, offset in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)):
        where = {"eye": tuple((eye * scale + offset).tolist())} if via == "reflection" else {}
        found = mapped(moved(mesh, scale, offset), surface, via, **where)
        # At 1e6, positions have 10 digits; normals of edges of 0.1 have 9, and a ray that meets a
        # surface four sizes away at a low angle makes a hundred times of that.
        limit = 1e-6 if offset else 1e-10
        np.testing.assert_allclose(found.corners, expected.corners, atol=limit)
        assert found.tallies == expected.tallies


@pytest.mark.parametrize(("surface", "via"), PAIRS)
def test_vertices_that_a_file_split_map_to_equal_bits(surface: str, via: str) -> None:
    mesh = bumpy()
    split = Mesh(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.arange(3 * mesh.n_faces, dtype=np.int32).reshape(-1, 3),
    )
    found = mapped(split, surface, via)
    # Angle-weighted normals are added up in the order of faces in both.
    assert np.array_equal(found.corners, mapped(mesh, surface, via).corners)


def test_faces_turned_away_from_the_plane_take_its_nearest_points() -> None:
    mesh = plane(3, 3)
    away = Mesh(positions=mesh.positions, faces=mesh.faces[:, ::-1])
    found = mapped(away, "plane", "object-normal")
    assert found.tallies == {"faces whose rays miss the plane, mapped to its nearest points": 18}
    assert np.array_equal(found.corners, mapped(away, "plane", "surface-normal").corners)
    assert mapped(mesh, "plane", "object-normal").tallies == {}


def test_caps_of_a_cylinder_are_put_where_they_stand() -> None:
    # Faces of a plane that looks along the axis, whose rays all leave by the open end.
    found = mapped(plane(3, 3), "cylinder", "object-normal", axis="z")
    expected = mapped(plane(3, 3), "cylinder", "surface-normal", axis="z")
    missing = "faces whose rays miss the cylinder, mapped to its nearest points"
    assert found.tallies[missing] == 18
    assert np.array_equal(found.corners, expected.corners)


def test_smooth_normals_lead_the_rays_even_where_a_mesh_has_its_own() -> None:
    mesh = icosphere(1)
    wrong = mesh.replace(normals=[[1.0, 0.0, 0.0]], normal_faces=np.zeros_like(mesh.faces))
    assert np.array_equal(
        mapped(wrong, "sphere", "object-normal").corners,
        mapped(mesh, "sphere", "object-normal").corners,
    )
