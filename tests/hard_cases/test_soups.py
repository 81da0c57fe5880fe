"""Random triangle soups through every stage and every measurement."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra import numpy as arrays

import texbake
from texbake.errors import MeshError, UnwrapError, UvError
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.normals import face_normals, smooth_normals
from texbake.mesh.tangents import corner_tangents

EXAMPLES = 20 if "TEXBAKE_FUZZ" not in os.environ else 2500
# An example of many stages takes some tenths of a second on a machine that does other things.
SOUPS = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)

# Few values, so that points coincide and lie on lines; and some that are far or near.
coordinates = st.sampled_from([0.0, 1.0, -1.0, 0.5, 2.0, 1e-9, 1.0 + 2**-52, 1e3, -0.0, 1e-30])
texture_coordinates = st.sampled_from([0.0, 1.0, 0.5, 0.25, 1e-7, -0.5, 1.5, 1.0 / 3.0])


@st.composite
def soups(draw, *, with_uvs=False):
    n_vertices = draw(st.integers(1, 9))
    n_faces = draw(st.integers(1, 10))
    faces = draw(arrays.arrays(np.int32, (n_faces, 3), elements=st.integers(0, n_vertices - 1)))
    positions = draw(arrays.arrays(np.float64, (n_vertices, 3), elements=coordinates))
    fields = {}
    if with_uvs:
        uvs = draw(arrays.arrays(np.float64, (n_vertices, 2), elements=texture_coordinates))
        fields = {"uvs": uvs, "uv_faces": faces}
    return texbake.Mesh(positions=positions, faces=faces, **fields)


def attempted(function, *expected):
    """The result of a function, or None where it raises one of the permitted errors."""
    try:
        return function()
    except expected as error:
        assert "\n" not in str(error)
        return None


@SOUPS
@given(mesh=soups())
def test_geometry_of_soups(mesh):
    for normals in face_normals(mesh), smooth_normals(mesh):
        lengths = np.linalg.norm(normals, axis=1)
        assert ((np.abs(lengths - 1.0) < 1e-12) | (lengths == 0.0)).all()
    info = texbake.mesh_info(mesh)
    assert info.n_degenerate_faces <= mesh.n_faces
    distance = texbake.surface_distance(mesh, mesh, n_samples=50)
    assert distance.max <= 1e-13 * distance.diagonal


@SOUPS
@given(mesh=soups(), suffix=st.sampled_from(["obj", "ply", "off", "stl", "glb"]))
def test_files_of_soups(mesh, suffix, tmp_path):
    path = tmp_path / f"soup.{suffix}"
    texbake.write_mesh(mesh, path)
    back = texbake.read_mesh(path)
    np.testing.assert_allclose(
        back.positions[back.faces],
        mesh.positions[mesh.faces],
        rtol=0.0,
        atol=0.0 if suffix in ("obj", "ply", "off") else np.abs(mesh.positions).max() * 2.0**-23,
    )


@SOUPS
@given(mesh=soups(), n_faces=st.integers(4, 8), quality=st.sampled_from(["fast"]))
def test_simplified_soups(mesh, n_faces, quality):
    simplified = attempted(lambda: texbake.simplify(mesh, n_faces, quality=quality), MeshError)
    if simplified is not None:
        assert np.isfinite(simplified.positions).all() and simplified.n_faces <= mesh.n_faces


@SOUPS
@given(
    mesh=soups(),
    method=st.sampled_from(["planar", "cylindrical", "spherical", "box", "projector", "two-part"]),
)
def test_mapped_soups(mesh, method):
    mapped = texbake.unwrap(mesh, method=method)
    assert np.isfinite(mapped.uvs).all()
    np.testing.assert_array_equal(mapped.positions, mesh.positions)


def thinnest_widths(mesh):
    """(F,) height of each face over its longest edge."""
    a, b, c = (mesh.positions[mesh.faces[:, i]] for i in range(3))
    longest = np.max([np.linalg.norm(x, axis=1) for x in (b - a, c - b, a - c)], axis=0)
    doubles = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.divide(doubles, longest, out=np.zeros_like(doubles), where=longest > 0.0)


@settings(SOUPS, max_examples=EXAMPLES // 2)
@given(mesh=soups())
def test_atlases_of_soups(mesh):
    mapped = attempted(
        lambda: texbake.unwrap(mesh, size=256, padding=1, quality="fast"), UnwrapError
    )
    if mapped is None:
        # Charts are made on a grid of 2^-20 of the mesh's size: what is thinner has no area there.
        assert thinnest_widths(mesh).max() <= 2.0**-19 * mesh.diagonal
        return
    found = find_overlaps(mapped.corner_uvs())
    assert not found.overlapping.any()


@SOUPS
@given(high=soups(), low=soups(with_uvs=True), rays=st.sampled_from(["smooth", "vertex", "face"]))
def test_baked_soups(high, low, rays):
    tangents = corner_tangents(low)
    np.testing.assert_allclose(np.linalg.norm(tangents[..., :3], axis=2), 1.0, atol=2e-7)
    maps = ("normal", "displacement", "vector-displacement")
    options = texbake.BakeOptions(size=16, maps=maps, rays=rays, fill="push-pull")
    result = attempted(lambda: texbake.bake(high, low, options), UvError)
    if result is None:
        return
    for baked in result.maps.values():
        assert np.isfinite(baked.values).all()
    lengths = np.linalg.norm(result.maps["normal"].values.astype(np.float64), axis=2)
    assert np.abs(lengths - 1.0).max() < 2e-7


@SOUPS
@given(mesh=soups(with_uvs=True))
def test_measured_and_drawn_soups(mesh):
    attempted(lambda: texbake.distortion(mesh, 64), UvError)
    assert "<svg" in layout_svg(mesh)


@SOUPS
@given(high=soups(), low=soups(with_uvs=True))
def test_checked_soups(high, low):
    options = texbake.CheckOptions(size=16, padding=1)
    for meshes in (high,), (low,), (high, low), (low, low):
        report = texbake.check(*meshes, options=options)
        for finding in report.findings:
            assert finding.count >= 1 and "nan" not in finding.problem
        if report.has_layout:
            assert np.isfinite(report.picture(32)).all()
    assert np.isfinite(texbake.draw_layout(low, 24)).all()


@SOUPS
@given(mesh=soups(with_uvs=True), azimuth=st.sampled_from([0.0, 33.0, 90.0, 180.0]))
def test_pictures_of_soups(mesh, azimuth):
    options = texbake.RenderOptions(width=24, height=16, view=(azimuth, 10.0), back_faces="show")
    frame = texbake.render(mesh, options=options)
    assert np.isfinite(frame.color).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["positions", "uvs", "normals", "tangents", "colors"])
def test_numbers_that_are_not_finite_are_refused_where_they_enter(bad, field):
    corners = np.array([[0, 1, 2]], np.int32)
    fields = {
        "positions": [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]],
        "uvs": [[0.0, 0], [1, 0], [0, 1]],
        "uv_faces": corners,
        "normals": [[0.0, 0, 1]] * 3,
        "normal_faces": corners,
        "tangents": np.ones((1, 3, 4)),
        "colors": np.ones((3, 3)),
    }
    texbake.Mesh(faces=corners, **fields)
    fields[field] = np.array(fields[field], float)
    fields[field].flat[1] = bad
    with pytest.raises(MeshError, match="not finite"):
        texbake.Mesh(faces=corners, **fields)


def test_a_color_beyond_float32_is_refused_too():
    with pytest.raises(MeshError, match="a vertex color is not finite"):
        texbake.Mesh(positions=np.eye(3), faces=[[0, 1, 2]], colors=np.full((3, 3), 1e300))
