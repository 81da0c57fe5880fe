"""Every stage on every mesh of the catalog: a valid result or one clear error."""

from functools import partial

import numpy as np
import pytest

import texbake
from texbake.mapping.layout_svg import layout_svg
from texbake.mapping.options.projection import SURFACES, VIAS
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import chart_ids
from texbake.mesh.normals import (
    degenerate_faces,
    face_normals,
    shading_normals,
    smooth_normals,
    vertex_normals,
)
from texbake.mesh.simplify import simplify_with_report
from texbake.mesh.tangents import corner_tangents
from texbake.mesh.topology import find_edges
from texbake.mesh.weld import weld_rows

MAPS = ("normal", "displacement", "vector-displacement")
CLASSICAL = ("planar", "cylindrical", "spherical", "box", "projector", "parametric")

# A float32 unit vector is off by at most half a step in each of its components.
UNIT = 2e-7


def assert_unit(vectors, *, or_zero=False):
    found = np.linalg.norm(np.asarray(vectors, np.float64), axis=-1)
    off = np.abs(found - 1.0) > UNIT
    assert not (off & ~(or_zero & (found == 0.0))).any()


def test_written_meshes_are_read_bit_for_bit(mesh_case, tmp_path):
    mesh = mesh_case.make()
    for suffix in "obj", "ply", "off":
        path = tmp_path / f"mesh.{suffix}"
        texbake.write_mesh(mesh, path)
        back = texbake.read_mesh(path)
        # Corner by corner: PLY may split vertices at seams. OFF has positions and faces alone.
        np.testing.assert_array_equal(back.positions[back.faces], mesh.positions[mesh.faces])
        if suffix == "off":
            np.testing.assert_array_equal(back.faces, mesh.faces)
            continue
        assert (back.uvs is None) == (mesh.uvs is None)
        if mesh.uvs is not None:
            np.testing.assert_array_equal(back.corner_uvs(), mesh.corner_uvs())
        if mesh.normals is not None:
            found, expected = (m.normals[m.normal_faces] for m in (back, mesh))
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("suffix", ["stl", "glb"])
def test_formats_of_float32_lose_only_rounding(mesh_case, suffix, tmp_path, attempt):
    mesh = mesh_case.make()
    path = tmp_path / f"mesh.{suffix}"

    def there_and_back():
        texbake.write_mesh(mesh, path)
        return texbake.read_mesh(path)

    back = attempt(mesh_case, suffix, there_and_back)
    if back is None:
        assert not path.exists()
        return
    # Half a float32 step of the farthest coordinate, twice: written, and for GLB an origin added.
    far = np.abs(mesh.positions[mesh.faces]).max()
    np.testing.assert_allclose(
        back.positions[back.faces], mesh.positions[mesh.faces], rtol=0, atol=far * 2.0**-23 + 1e-45
    )
    texbake.write_mesh(back, tmp_path / f"again.{suffix}")
    again = texbake.read_mesh(tmp_path / f"again.{suffix}")
    np.testing.assert_array_equal(again.positions[again.faces], back.positions[back.faces])


def test_normals_are_unit_or_nothing_and_zero_just_where_there_is_no_area(mesh_case):
    mesh = mesh_case.make()
    of_faces = face_normals(mesh)
    assert_unit(of_faces, or_zero=True)
    without = degenerate_faces(mesh)
    np.testing.assert_array_equal((of_faces == 0.0).all(axis=1), without)
    has_area = np.zeros(mesh.n_vertices, bool)
    has_area[mesh.faces[~without]] = True
    for make in vertex_normals, smooth_normals:
        normals = make(mesh)
        assert_unit(normals[has_area])
        assert_unit(normals, or_zero=True)
    shading, corners = shading_normals(mesh)
    assert corners.shape == mesh.faces.shape and np.isfinite(shading).all()


def test_positions_that_are_equal_get_one_smooth_normal(mesh_case):
    mesh = mesh_case.make()
    normals = smooth_normals(mesh)
    np.testing.assert_array_equal(normals, normals[weld_rows(mesh.positions)])


def test_tangents_are_unit_and_signed(textured_case):
    tangents = corner_tangents(textured_case.make())
    assert_unit(tangents[..., :3])
    assert np.isin(tangents[..., 3], (-1.0, 1.0)).all()


def test_figures_add_up(mesh_case):
    mesh = mesh_case.make()
    info = texbake.mesh_info(mesh)
    assert info.n_faces == mesh.n_faces
    assert np.isfinite(info.diagonal)
    edges = find_edges(mesh.faces)
    # Each corner of a face with three different vertices begins one half of an edge.
    whole = (np.diff(np.sort(mesh.faces, axis=1), axis=1) != 0).all(axis=1).sum()
    assert edges.n_faces.sum() == 3 * whole


def test_a_closed_mesh_has_no_boundary(closed_case):
    mesh = closed_case.make()
    assert not find_edges(weld_rows(mesh.positions)[mesh.faces]).boundary.any()


@pytest.mark.parametrize("quality", ["fast", "best"])
def test_simplified_meshes_are_meshes(mesh_case, quality, attempt):
    mesh = mesh_case.make()
    n_faces = max(4, mesh.n_faces // 2)
    result = attempt(
        mesh_case, "simplify", lambda: simplify_with_report(mesh, n_faces, quality=quality)
    )
    if result is None:
        return
    simplified, report = result
    assert report.reached or report.notes
    assert simplified.n_faces <= mesh.n_faces and np.isfinite(simplified.positions).all()
    low, high = mesh.bounds
    slack = mesh.diagonal * (1e-6 if quality == "fast" else 0.5)
    assert (simplified.bounds[0] >= low - slack).all() and (
        simplified.bounds[1] <= high + slack
    ).all()


def test_classical_mappings_add_finite_coordinates_alone(mesh_case, attempt):
    mesh = mesh_case.make()
    for method in CLASSICAL:
        unwrap = partial(texbake.unwrap, mesh, method=method)
        if method == "parametric" and mesh.uvs is None:
            with pytest.raises(texbake.TexbakeError):
                unwrap()
            continue
        stage = method if method in mesh_case.refused else "unwrap"
        _assert_mapped(mesh, attempt(mesh_case, stage, unwrap))


@pytest.mark.pairwise(surface=SURFACES, via=VIAS)
def test_two_part_mappings_too(mesh_case, surface, via, attempt):
    mesh = mesh_case.make()
    eye = (3.0, 2.0, 1.0) if via == "reflection" else None

    def unwrap():
        return texbake.unwrap(mesh, method="two-part", surface=surface, via=via, eye=eye)

    _assert_mapped(mesh, attempt(mesh_case, "unwrap", unwrap))


def _assert_mapped(mesh, mapped):
    if mapped is None:
        return
    assert np.isfinite(mapped.uvs).all()
    np.testing.assert_array_equal(mapped.positions, mesh.positions)
    np.testing.assert_array_equal(mapped.faces, mesh.faces)


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_an_atlas_has_no_overlap_and_no_mirror(mesh_case, quality, attempt):
    mesh = mesh_case.make()
    mapped = attempt(
        mesh_case,
        "atlas",
        lambda: texbake.unwrap(mesh, size=256, padding=1, quality=quality, threads=1),
    )
    if mapped is None:
        return
    _assert_mapped(mesh, mapped)
    corners = mapped.corner_uvs()
    assert corners.min() >= 0.0 and corners.max() <= 1.0
    found = find_overlaps(corners)
    assert not found.overlapping.any() and not found.unsure.any()
    edges = corners[:, 1:] - corners[:, :1]
    doubles = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    assert (doubles >= 0.0).all()


def test_coordinates_are_measured_and_drawn(textured_case, attempt):
    mesh = textured_case.make()
    measured = attempt(textured_case, "distortion", lambda: texbake.distortion(mesh, 64))
    if measured is not None:
        assert measured.n_measured + measured.n_degenerate + measured.n_collapsed == mesh.n_faces
        assert measured.stretch.l2 >= 1.0 - 1e-9 or measured.n_mirrored
    assert len(chart_ids(mesh)) == mesh.n_faces
    for draw in layout_svg, lambda m: texbake.draw_layout(m, 64):
        drawn = attempt(textured_case, "layout", lambda draw=draw: draw(mesh))
        if drawn is not None and not isinstance(drawn, str):
            assert np.isfinite(drawn).all() and drawn.min() >= 0.0 and drawn.max() <= 1.0


@pytest.mark.parametrize("rays", ["smooth", "vertex", "face"])
def test_maps_of_a_mesh_onto_itself_are_finite_and_unit(mesh_case, rays, in_cells, attempt):
    mesh = in_cells(mesh_case)
    options = texbake.BakeOptions(size=32, maps=MAPS, rays=rays, fill="push-pull", threads=1)
    result = attempt(mesh_case, "bake", lambda: texbake.bake(mesh, mesh, options))
    if result is None:
        return
    for baked in result.maps.values():
        assert np.isfinite(baked.values).all()
    assert_unit(result.maps["normal"].values)
    report = result.report
    assert report.texels_covered == np.count_nonzero(result.texel_faces >= 0)
    assert report.texels_missed == np.count_nonzero(result.missed)
    # A mesh is never farther from itself than rays reach.
    reach = max(report.front or 0.0, report.back)
    assert all(distance <= reach * (1 + 1e-6) for distance in report.distance_percentiles.values())


def test_a_mesh_bakes_flat_onto_itself(flat_case, in_cells):
    mesh = in_cells(flat_case)
    result = texbake.bake(mesh, mesh, texbake.BakeOptions(size=64, maps=MAPS, threads=1))
    assert result.report.texels_missed == 0
    normals = result.maps["normal"].values.astype(np.float64)
    tilt = np.degrees(np.arctan2(np.hypot(normals[..., 0], normals[..., 1]), normals[..., 2]))
    # Which triangle is hit is found in float32. On walls of 1e-5 that is 1 % of the way from one
    # side to the next, over which smooth normals turn by 90 degrees.
    assert tilt.max() < (90.0 * 2.0**-23 / 1e-5 if "thin" in flat_case.traits else 0.01)
    heights = np.abs(result.maps["displacement"].values.astype(np.float64))
    assert heights.max() <= 1e-6 * mesh.diagonal


def test_a_mesh_lies_on_itself(mesh_case):
    mesh = mesh_case.make()
    distance = texbake.surface_distance(mesh, mesh, n_samples=300)
    # Closest points are found in float64 of the joint frame; a subnormal length has few bits.
    assert distance.max <= 1e-13 * distance.diagonal + 1e-313


@pytest.mark.parametrize("back_faces", ["cull", "show"])
def test_pictures_are_finite(mesh_case, back_faces, attempt):
    mesh = mesh_case.make()
    options = texbake.RenderOptions(width=32, height=24, back_faces=back_faces)
    frame = attempt(mesh_case, "preview", lambda: texbake.render(mesh, options=options, threads=1))
    if frame is None:
        return
    assert np.isfinite(frame.color).all() and frame.color.min() >= 0.0
    assert ((frame.coverage >= 0.0) & (frame.coverage <= 1.0)).all()
    assert_unit(frame.normals, or_zero=True)


def test_a_solid_shows_no_back_face(solid_case):
    """Where a front face is missing by a rounding, a back face shines through."""
    mesh = solid_case.make()
    pictures = [
        texbake.render(
            mesh,
            options=texbake.RenderOptions(width=64, height=48, back_faces=back_faces),
            threads=1,
        )
        for back_faces in ("cull", "show")
    ]
    np.testing.assert_array_equal(pictures[0].face_ids, pictures[1].face_ids)
    np.testing.assert_array_equal(pictures[0].color, pictures[1].color)


def test_a_mesh_compares_as_itself(flat_case):
    mesh = flat_case.make()
    options = texbake.RenderOptions(width=24, height=16)
    compared = texbake.compare(mesh, mesh, options=options, views=[(30.0, 20.0)], threads=1)
    for closeness in compared.bare, compared.mapped:
        # NaN where nothing is seen: an open mesh from behind.
        assert closeness.mean_deg == 0.0 or np.isnan(closeness.mean_deg)
        assert closeness.outline_mismatch == closeness.depth_mismatch == 0.0
        assert closeness.psnr_db == np.inf


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
