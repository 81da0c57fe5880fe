"""Size, place, direction and order change nothing, and neither does the number of threads."""

import numpy as np
import pytest

import texbake
from texbake.mesh.normals import face_normals, smooth_normals

SCALES = (2.0**-40, 2.0**50)
# A quarter turn about y: exact in floating point.
QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
MAPS = ("normal", "displacement")


def sized(mesh, scale):
    return mesh.replace(positions=mesh.positions * scale)


def baked(mesh, **options):
    return texbake.bake(mesh, mesh, texbake.BakeOptions(size=32, maps=MAPS, **options))


@pytest.mark.parametrize("scale", SCALES)
def test_a_power_of_two_changes_no_bit_of_a_normal(mesh_case, scale):
    mesh = mesh_case.make()
    with np.errstate(over="ignore", under="ignore"):
        positions = mesh.positions * scale
    if not (np.isfinite(positions).all() and np.array_equal(positions / scale, mesh.positions)):
        scale = 1.0 / scale  # of the meshes at the ends of the range
    other = sized(mesh, scale)
    np.testing.assert_array_equal(face_normals(other), face_normals(mesh))
    np.testing.assert_array_equal(smooth_normals(other), smooth_normals(mesh))


@pytest.mark.parametrize("scale", SCALES)
def test_a_power_of_two_changes_no_bit_of_a_mapping(plain_case, scale):
    mesh = plain_case.make()
    for method in "planar", "cylindrical", "spherical", "box":
        np.testing.assert_array_equal(
            texbake.unwrap(sized(mesh, scale), method=method).corner_uvs(),
            texbake.unwrap(mesh, method=method).corner_uvs(),
        )
    ours, theirs = (
        texbake.unwrap(m, size=128, padding=1, quality="fast", threads=1).corner_uvs()
        for m in (sized(mesh, scale), mesh)
    )
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("scale", SCALES)
def test_a_power_of_two_scales_baked_maps(plain_case, scale, in_cells):
    mesh = in_cells(plain_case)
    ours, theirs = baked(sized(mesh, scale)), baked(mesh)
    np.testing.assert_array_equal(ours.texel_faces, theirs.texel_faces)
    np.testing.assert_array_equal(ours.maps["normal"].values, theirs.maps["normal"].values)
    np.testing.assert_allclose(
        ours.maps["displacement"].values,
        theirs.maps["displacement"].values * np.float32(scale),
        rtol=0.0,
        atol=2.0**-149,  # one step of a subnormal, which the smallest of these meshes come down to
    )


def test_a_quarter_turn_turns_normals(plain_case):
    mesh = plain_case.make()
    turned = mesh.replace(positions=mesh.positions @ QUARTER.T)
    # Products are added in another order: some units in the last place.
    for make in face_normals, smooth_normals:
        np.testing.assert_allclose(make(turned), make(mesh) @ QUARTER.T, atol=1e-13)


def test_a_move_changes_normals_only_by_rounding(plain_case):
    mesh = plain_case.make()
    shift = mesh.diagonal * 1024.0
    moved = mesh.replace(positions=mesh.positions + shift)
    # Positions lose 11 bits of 53; the shortest edge of these meshes is 1e-5 of their size.
    np.testing.assert_allclose(face_normals(moved), face_normals(mesh), atol=1e-7)


def test_the_order_of_vertices_changes_no_bit(mesh_case):
    mesh = mesh_case.make()
    order = np.random.default_rng(5).permutation(mesh.n_vertices)
    places = np.argsort(order)
    other = mesh.replace(positions=mesh.positions[order], faces=places[mesh.faces])
    np.testing.assert_array_equal(face_normals(other), face_normals(mesh))
    np.testing.assert_array_equal(smooth_normals(other), smooth_normals(mesh)[order])
    ours, theirs = texbake.mesh_info(other), texbake.mesh_info(mesh)
    assert ours.closed == theirs.closed and ours.genus == theirs.genus
    assert ours.n_non_manifold_edges == theirs.n_non_manifold_edges


def test_the_order_of_faces_changes_sums_by_rounding(flat_case):
    mesh = flat_case.make()
    order = np.random.default_rng(6).permutation(mesh.n_faces)
    other = texbake.Mesh(positions=mesh.positions, faces=mesh.faces[order])
    plain = texbake.Mesh(positions=mesh.positions, faces=mesh.faces)
    np.testing.assert_array_equal(face_normals(other), face_normals(plain)[order])
    np.testing.assert_allclose(smooth_normals(other), smooth_normals(plain), atol=1e-13)


def test_threads_change_no_byte(plain_case, in_cells):
    mesh = in_cells(plain_case)
    one, more = baked(mesh, threads=1), baked(mesh, threads=3)
    for name in MAPS:
        np.testing.assert_array_equal(one.maps[name].values, more.maps[name].values)
    options = texbake.RenderOptions(width=40, height=30)
    np.testing.assert_array_equal(
        texbake.render(mesh, options=options, threads=1).color,
        texbake.render(mesh, options=options, threads=3).color,
    )


def test_a_displaced_bake_gives_back_its_offset(flat_case, in_cells):
    """Bake, displace: the high-poly mesh is the low-poly one moved along its smooth normals."""
    low = in_cells(flat_case)
    offset = 1e-3 * low.diagonal
    high = low.replace(positions=low.positions + offset * smooth_normals(low))
    result = texbake.bake(
        high,
        low,
        texbake.BakeOptions(size=48, maps=("displacement",), front=4 * offset, back=4 * offset),
    )
    found = result.maps["displacement"].values[..., 0][result.has_data]
    # Closed form: a point of a face moves by the offset times its interpolated normal, which is
    # shorter than 1; the ray of its texel goes the same way.
    faces = result.texel_faces[result.has_data]
    rows, columns = np.nonzero(result.has_data)
    centers = np.column_stack([columns + 0.5, 48 - rows - 0.5]) / 48.0
    corners = low.corner_uvs()[faces]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    b = np.linalg.solve(edges, (centers - corners[:, 0])[..., None])[..., 0]
    weights = np.column_stack([1.0 - b.sum(axis=1), b])
    normals = np.einsum("nc,ncx->nx", weights, smooth_normals(low)[low.faces[faces]])
    expected = offset * np.linalg.norm(normals, axis=1)
    assert len(found)
    # The offset is a thousandth of the size, and directions of rays are float32.
    np.testing.assert_allclose(found, expected, rtol=1e-4)
