import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mapping.classical.cylindrical import cylindrical, spherical
from texbake.mapping.classical.planar import planar
from texbake.mapping.classical.two_part import two_part
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, icosphere, plane

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


def test_faces_turned_away_from_the_plane_take_its_nearest_points() -> None:
    mesh = plane(3, 3)
    away = Mesh(positions=mesh.positions, faces=mesh.faces[:, ::-1])
    found = mapped(away, "plane", "object-normal")
    assert found.tallies == {"faces whose rays miss the plane, mapped to its nearest points": 18}
    assert np.array_equal(found.corners, mapped(away, "plane", "surface-normal").corners)
    assert mapped(mesh, "plane", "object-normal").tallies == {}


def test_smooth_normals_lead_the_rays_even_where_a_mesh_has_its_own() -> None:
    mesh = icosphere(1)
    wrong = mesh.replace(normals=[[1.0, 0.0, 0.0]], normal_faces=np.zeros_like(mesh.faces))
    assert np.array_equal(
        mapped(wrong, "sphere", "object-normal").corners,
        mapped(mesh, "sphere", "object-normal").corners,
    )
