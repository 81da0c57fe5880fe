"""`texbake.compat.xatlas` against xatlas: each assertion holds for both modules.

The cases follow the readme of xatlas-python and the docstrings of its options.
"""

import importlib
import math
import subprocess
import sys

import numpy as np
import pytest

from texbake.errors import TexbakeError, UnwrapError
from texbake.mesh.shapes import cube, icosphere

OURS = "texbake.compat.xatlas"
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
NAMES = {"Atlas", "Chart", "ChartOptions", "ChartType", "PackOptions", "export", "parametrize"}


@pytest.fixture(params=["xatlas", OURS])
def xatlas(request):
    return importlib.import_module(request.param)


def generated(xatlas, *meshes, **options):
    atlas, pack = xatlas.Atlas(), xatlas.PackOptions()
    for positions, indices in meshes:
        atlas.add_mesh(positions, indices)
    for name, value in options.items():
        setattr(pack, name, value)
    atlas.generate(pack_options=pack)
    return atlas


def box():
    mesh = cube()
    return mesh.positions, mesh.faces


def areas(points):
    return np.linalg.norm(
        np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1
    )


def flat(uvs):
    return np.concatenate([uvs, np.zeros((*uvs.shape[:-1], 1))], axis=-1)


def public(value):
    return {name for name in dir(value) if not name.startswith("_")}


def test_all_names_are_there():
    real, own = (importlib.import_module(module) for module in ("xatlas", OURS))
    assert NAMES | {"__version__"} <= set(dir(own))
    assert public(real.Atlas) <= public(own.Atlas)
    for kind in ("ChartOptions", "PackOptions"):
        assert public(getattr(real, kind)()) == public(getattr(own, kind)())
    assert public(real.Chart) == set(own.Chart.__annotations__)


@pytest.mark.parametrize("convert", [np.asarray, np.ndarray.tolist, np.asfortranarray])
@pytest.mark.parametrize("types", [(np.float32, np.uint32), (np.float64, np.int64), (int, int)])
def test_parametrize_takes_any_arrays_and_returns_its_own_types(xatlas, convert, types):
    positions, indices = SQUARE.astype(types[0]), FACES.astype(types[1])
    mapping, faces, uvs = xatlas.parametrize(convert(positions), convert(indices))
    assert (mapping.dtype, faces.dtype, uvs.dtype) == (np.uint32, np.uint32, np.float32)
    assert (mapping.shape, faces.shape, uvs.shape) == ((4,), (2, 3), (4, 2))
    assert all(a.flags.writeable and a.flags.c_contiguous for a in (mapping, faces, uvs))


def test_parametrize_by_names_with_normals_and_coordinates(xatlas):
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    found = xatlas.parametrize(positions=SQUARE, indices=FACES, normals=normals, uvs=SQUARE[:, :2])
    assert len(found) == 3


def test_the_mapping_leads_back_to_the_mesh(xatlas):
    ball = icosphere(3)
    mapping, indices, uvs = xatlas.parametrize(ball.positions, ball.faces)
    np.testing.assert_array_equal(mapping[indices], ball.faces)
    assert set(mapping) == set(range(ball.n_vertices))
    assert len(mapping) > ball.n_vertices  # vertices on seams are doubled
    assert uvs.min() >= 0 and uvs.max() <= 1
    assert (areas(flat(uvs[indices].astype(float))) > 0).all()


def test_vertices_that_no_face_uses_are_left_out(xatlas):
    mapping, indices, _ = xatlas.parametrize(np.concatenate([SQUARE, [[9, 9, 9]]]), FACES)
    np.testing.assert_array_equal(np.sort(mapping), range(4))
    np.testing.assert_array_equal(mapping[indices], FACES)


def test_vertices_at_one_place_stay_separate(xatlas):
    faces = np.array([[0, 1, 2], [4, 6, 7]])
    mapping, indices, _ = xatlas.parametrize(np.concatenate([SQUARE, SQUARE]), faces)
    np.testing.assert_array_equal(mapping[indices], faces)


def test_faces_without_area_are_kept(xatlas):
    faces = np.concatenate([FACES, [[0, 0, 1]]])
    mapping, indices, uvs = xatlas.parametrize(SQUARE, faces)
    np.testing.assert_array_equal(mapping[indices], faces)
    assert np.isfinite(uvs).all()


def test_a_mesh_without_area_is_left_out(xatlas):
    atlas = generated(xatlas, (SQUARE, FACES), (SQUARE * [1, 0, 0], FACES), (SQUARE, FACES))
    assert (atlas.mesh_count, atlas.chart_count) == (3, 2)
    assert [atlas.get_mesh_chart_count(i) for i in range(3)] == [1, 0, 1]
    mapping, indices, uvs = atlas[1]
    np.testing.assert_array_equal(mapping[indices], FACES)
    assert (uvs == 0.0).all()
    assert all((ids == 2**32 - 1).all() for ids in atlas.get_mesh_vertex_assignment(1))


def test_an_empty_mesh_has_an_empty_result(xatlas):
    mapping, indices, uvs = xatlas.parametrize(SQUARE[:0], FACES[:0])
    assert (mapping.shape, indices.shape, uvs.shape) == ((0,), (0, 3), (0, 2))


@pytest.mark.parametrize("arguments, error", [
    ((SQUARE[:, :2], FACES), r"Position array expected to be Nx3\."),
    ((SQUARE.ravel(), FACES), r"Position array expected to be Nx3\."),
    ((SQUARE, FACES[:, :2]), r"Index array expected to be Nx3\."),
    ((SQUARE, FACES, SQUARE[:2]), r"Normal array .* \(expected 4, got 2\)"),
    ((SQUARE, FACES, None, SQUARE), r"Texture coordinate array expected to be Nx2\."),
    ((SQUARE, FACES, None, SQUARE[:2, :2]), r"coordinate array .* \(expected 4, got 2\)"),
])  # fmt: skip
def test_wrong_shapes_are_value_errors(xatlas, arguments, error):
    with pytest.raises(ValueError, match=error):
        xatlas.parametrize(*arguments)


@pytest.mark.parametrize(
    "indices, error",
    [(FACES + 9, "Index out of range"), (-FACES.astype(int), "out of range"), (FACES[:0], "count")],
)
def test_meshes_that_cannot_be_added_are_runtime_errors(xatlas, indices, error):
    with pytest.raises(RuntimeError, match=f"Adding mesh failed: .*{error}"):
        xatlas.Atlas().add_mesh(SQUARE, indices)


@pytest.mark.parametrize("arguments", [("a", FACES), (SQUARE,), (SQUARE, [["x"]])])
def test_wrong_types_are_type_errors(xatlas, arguments):
    with pytest.raises((TypeError, ValueError) if len(arguments) > 1 else TypeError):
        xatlas.parametrize(*arguments)


def test_an_atlas_is_empty_until_it_is_generated(xatlas):
    atlas = xatlas.Atlas()
    atlas.add_mesh(SQUARE, FACES)
    assert (len(atlas), atlas.mesh_count, atlas.chart_count, atlas.atlas_count) == (0, 0, 0, 0)
    assert (atlas.width, atlas.height, atlas.texels_per_unit) == (0, 0, 0.0)
    atlas.generate()
    assert (len(atlas), atlas.mesh_count, atlas.chart_count, atlas.atlas_count) == (1, 1, 1, 1)


@pytest.mark.parametrize("read", [
    lambda atlas: atlas.get_mesh(0), lambda atlas: atlas[0],
    lambda atlas: atlas.get_mesh_chart_count(0), lambda atlas: atlas.get_mesh_chart(0, 0),
    lambda atlas: atlas.get_mesh_vertex_assignment(0), lambda atlas: atlas.utilization,
    lambda atlas: atlas.get_utilization(0), lambda atlas: atlas.chart_image,
    lambda atlas: atlas.get_chart_image(0),
])  # fmt: skip
def test_what_is_not_there_is_an_index_error(xatlas, read):
    with pytest.raises(IndexError, match="index 0 out of bounds"):
        read(xatlas.Atlas())


def test_indices_are_whole_numbers_from_0_to_the_last(xatlas):
    atlas = generated(xatlas, (SQUARE, FACES))
    with pytest.raises(IndexError, match=r"Mesh index 1 out of bounds for atlas with 1 meshes\."):
        atlas.get_mesh(1)
    with pytest.raises(IndexError, match=r"Chart index 1 out of bounds for mesh with 1 charts\."):
        atlas.get_mesh_chart(0, 1)
    with pytest.raises(IndexError, match=r"Atlas index 1 out of bounds\."):
        atlas.get_utilization(1)
    with pytest.raises(TypeError):
        atlas.get_mesh(-1)
    with pytest.raises(TypeError):
        atlas.get_mesh("0")


def test_several_meshes_share_one_texture_at_one_density(xatlas):
    atlas = generated(xatlas, (SQUARE, FACES), (2 * SQUARE + 5, FACES), box())
    assert len(atlas) == 3 and atlas.atlas_count == 1
    assert atlas.chart_count == sum(atlas.get_mesh_chart_count(i) for i in range(3))
    size = np.array([atlas.width, atlas.height])
    for i, (positions, faces) in enumerate(((SQUARE, FACES), (2 * SQUARE + 5, FACES), box())):
        mapping, indices, uvs = atlas[i]
        for one, other in zip(atlas.get_mesh(i), (mapping, indices, uvs), strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(mapping[indices], faces)
        texels = areas(flat(uvs[indices] * size))
        solid = areas(positions[faces].astype(float))
        np.testing.assert_allclose(np.sqrt(texels / solid), atlas.texels_per_unit, rtol=0.02)


def test_meshes_can_be_generated_again(xatlas):
    atlas = generated(xatlas, (SQUARE, FACES))
    atlas.generate()
    assert len(atlas) == 1 and len(atlas[0][0]) == 4


def test_charts_have_faces_and_vertices_belong_to_charts(xatlas):
    positions, faces = box()
    atlas = generated(xatlas, (positions, faces))
    n = atlas.get_mesh_chart_count(0)
    charts = [atlas.get_mesh_chart(0, i) for i in range(n)]
    assert sorted(np.concatenate([chart.faces for chart in charts])) == list(range(12))
    atlases, of_vertices = atlas.get_mesh_vertex_assignment(0)
    mapping, indices, _ = atlas[0]
    assert atlases.dtype == of_vertices.dtype == np.uint32
    assert atlases.shape == of_vertices.shape == mapping.shape
    for number, chart in enumerate(charts):
        assert chart.faces.dtype == np.uint32
        assert (chart.atlas_index, chart.material) == (0, 0)
        assert chart.type in xatlas.ChartType.__members__.values()
        assert set(of_vertices[indices[chart.faces]].ravel()) == {number}


def test_the_types_of_charts_are_numbered(xatlas):
    names = ("Planar", "Ortho", "LSCM", "Piecewise", "Invalid")
    assert tuple(xatlas.ChartType.__members__) == names
    assert [int(getattr(xatlas.ChartType, name)) for name in names] == list(range(5))
    assert (xatlas.ChartType(1).name, xatlas.ChartType.Ortho.value) == ("Ortho", 1)


def test_without_a_resolution_the_texture_has_about_1024_texels_per_side(xatlas):
    atlas = generated(xatlas, box())
    assert 700 < math.sqrt(atlas.width * atlas.height) < 1100
    assert 0.4 < atlas.utilization <= 1.0
    assert atlas.utilization == atlas.get_utilization(0)


def test_a_resolution_is_approximately_reached(xatlas):
    atlas = generated(xatlas, box(), resolution=256, padding=2)
    assert 220 < math.sqrt(atlas.width * atlas.height) < 290


def test_a_density_is_kept(xatlas):
    atlas = generated(xatlas, (SQUARE, FACES), texels_per_unit=32.0)
    assert atlas.texels_per_unit == pytest.approx(32.0, rel=1e-5)
    assert 32 <= atlas.width <= 40 and 32 <= atlas.height <= 40


def test_a_resolution_and_a_density_make_several_textures_of_that_size(xatlas):
    atlas = generated(xatlas, box(), (SQUARE, FACES), resolution=256, texels_per_unit=200.0)
    assert (atlas.width, atlas.height, atlas.atlas_count) == (256, 256, 7)
    assert atlas.texels_per_unit == pytest.approx(200.0, rel=1e-5)
    for i in range(2):
        assert atlas[i][2].min() >= 0 and atlas[i][2].max() <= 1
    used = {atlas.get_mesh_chart(0, i).atlas_index for i in range(6)}
    used.add(atlas.get_mesh_chart(1, 0).atlas_index)
    assert used == set(range(7))
    assert all(atlas.get_utilization(i) == pytest.approx(0.63, abs=0.05) for i in range(7))


def test_padding_keeps_charts_apart(xatlas):
    close = generated(xatlas, box(), resolution=128, padding=0, bilinear=False)
    apart = generated(xatlas, box(), resolution=128, padding=8, bilinear=False)
    assert apart.utilization < close.utilization
    boxes = []
    for i in range(6):
        faces = apart.get_mesh_chart(0, i).faces
        corners = apart[0][2][apart[0][1][faces]].reshape(-1, 2) * [apart.width, apart.height]
        boxes.append((corners.min(axis=0), corners.max(axis=0)))
    for i, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:i]:
            assert np.maximum(other_low - high, low - other_high).max() > 7.0


def test_a_picture_of_the_charts(xatlas):
    with pytest.raises(RuntimeError, match="does not have an image"):
        _ = generated(xatlas, box()).chart_image
    atlas = generated(xatlas, box(), resolution=64, create_image=True)
    image = atlas.chart_image
    assert image.shape == (atlas.height, atlas.width, 3) and image.dtype == np.uint8
    assert image.any(axis=2).mean() == pytest.approx(atlas.utilization, abs=0.1)
    np.testing.assert_array_equal(image, atlas.get_chart_image(0))


def test_meshes_with_coordinates_are_packed_again(xatlas):
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh(SQUARE[:, :2], FACES)
    atlas.add_uv_mesh(uvs=0.5 * SQUARE[:, :2], indices=FACES, face_materials=[[3], [3]])
    atlas.generate()
    assert (len(atlas), atlas.chart_count) == (2, 2)
    sizes = [np.ptp(atlas[i][2] * [atlas.width, atlas.height], axis=0) for i in range(2)]
    np.testing.assert_allclose(sizes[0], 2 * sizes[1], rtol=0.01)
    assert atlas.get_mesh_chart(1, 0).material == 3
    for i in range(2):
        np.testing.assert_array_equal(atlas[i][0][atlas[i][1]], FACES)


def test_meshes_with_coordinates_have_checked_shapes(xatlas):
    atlas = xatlas.Atlas()
    with pytest.raises(ValueError, match=r"Texture coordinate array expected to be Nx2\."):
        atlas.add_uv_mesh(SQUARE, FACES)
    with pytest.raises(ValueError, match=r"Face material ID array expected to be Nx1\."):
        atlas.add_uv_mesh(SQUARE[:, :2], FACES, [0, 1])
    with pytest.raises(ValueError, match="expected 2, got 1"):
        atlas.add_uv_mesh(SQUARE[:, :2], FACES, [[0]])
    with pytest.raises(RuntimeError, match="Index out of range"):
        atlas.add_uv_mesh(SQUARE[:, :2], FACES + 7)
    atlas.add_uv_mesh(SQUARE[:, :2], FACES)
    with pytest.raises(RuntimeError, match="Adding mesh failed"):
        atlas.add_mesh(SQUARE, FACES)


def test_use_input_mesh_uvs_keeps_the_charts(xatlas):
    atlas, options = xatlas.Atlas(), xatlas.ChartOptions()
    positions, faces = box()
    separate = positions[faces].reshape(-1, 3)
    uvs = np.tile([[0, 0], [1, 0], [1, 1]], (12, 1)) * 0.1 + np.repeat(np.arange(12), 3)[:, None]
    atlas.add_mesh(separate, np.arange(36).reshape(-1, 3), uvs=uvs)
    options.use_input_mesh_uvs = True
    atlas.generate(options)
    assert atlas.chart_count == 12


def test_options_have_the_same_defaults():
    real, own = (importlib.import_module(module) for module in ("xatlas", OURS))
    for kind in ("ChartOptions", "PackOptions"):
        one, other = getattr(real, kind)(), getattr(own, kind)()
        for name in (name for name in dir(one) if not name.startswith("_")):
            assert getattr(other, name) == pytest.approx(getattr(one, name)), name
            assert type(getattr(other, name)) is type(getattr(one, name)), name


def test_options_are_checked_when_they_are_set(xatlas):
    pack, charts = xatlas.PackOptions(), xatlas.ChartOptions()
    for options, name, value in [
        (pack, "padding", "x"), (pack, "padding", -1), (pack, "padding", 1.5),
        (charts, "max_cost", "a"), (charts, "max_iterations", 1.5),
    ]:  # fmt: skip
        with pytest.raises(TypeError):
            setattr(options, name, value)
    for options in (pack, charts):
        with pytest.raises(AttributeError):
            options.no_such_option = 1
    pack.texels_per_unit, pack.bilinear, pack.padding = 3, 0, np.int64(2)
    assert (pack.texels_per_unit, pack.bilinear, pack.padding) == (3.0, False, 2)
    with pytest.raises(TypeError):
        xatlas.PackOptions(padding=2)
    with pytest.raises(TypeError):
        generated(xatlas, (SQUARE, FACES)).generate(pack)


def test_verbose_prints_the_size(xatlas, capfd):
    atlas = xatlas.Atlas()
    atlas.add_mesh(SQUARE, FACES)
    atlas.generate(xatlas.ChartOptions(), xatlas.PackOptions(), True)
    printed = capfd.readouterr().out
    assert "Charts: 1" in printed and f"Size: {atlas.width}x{atlas.height}" in printed


@pytest.mark.parametrize("given", [(), ("uvs",), ("normals",), ("uvs", "normals")])
def test_export_writes_the_same_file(tmp_path, given):
    extra = {"uvs": SQUARE[:, :2] / 3, "normals": SQUARE}
    for module in ("xatlas", OURS):
        path = str(tmp_path / f"{module}.obj")
        arrays = {name: extra[name] for name in given}
        importlib.import_module(module).export(path, SQUARE / 7, FACES, **arrays)
    lines = [(tmp_path / f"{module}.obj").read_text().split() for module in ("xatlas", OURS)]
    assert lines[0] == lines[1]


def test_export_checks_its_arrays(xatlas, tmp_path):
    path = str(tmp_path / "a.obj")
    xatlas.export(path, SQUARE)
    for arguments, error in [
        ((path, SQUARE[:, :2]), r"Position array expected to be Nx3\."),
        ((path, SQUARE, FACES, SQUARE), r"Texture coordinates array expected to be Nx2\."),
        ((path, SQUARE, FACES, None, SQUARE[:2]), "Normal array has invalid number"),
        ((str(tmp_path / "none" / "a.obj"), SQUARE), "Cannot open path"),
    ]:
        with pytest.raises(ValueError, match=error):
            xatlas.export(*arguments)
    with pytest.raises(TypeError):
        xatlas.export(tmp_path / "a.obj", SQUARE)


PROGRAM = """
import sys
import numpy as np
import trimesh
import {module} as xatlas

meshes = [trimesh.creation.icosphere(2), trimesh.creation.box()]
vmapping, indices, uvs = xatlas.parametrize(meshes[0].vertices, meshes[0].faces)
xatlas.export(sys.argv[1], meshes[0].vertices[vmapping], indices, uvs)
atlas = xatlas.Atlas()
for mesh in meshes:
    atlas.add_mesh(mesh.vertices, mesh.faces, mesh.vertex_normals)
chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
chart_options.max_iterations = 4
pack_options.padding = 2
pack_options.resolution = 512
pack_options.create_image = True
atlas.generate(chart_options=chart_options, pack_options=pack_options)
for i in range(len(atlas)):
    mapping, faces, uvs = atlas[i]
    textured = trimesh.Trimesh(meshes[i].vertices[mapping], faces, process=False)
    textured.visual = trimesh.visual.TextureVisuals(uv=uvs)
    assert abs(textured.area - meshes[i].area) < 1e-9
print(atlas.chart_image.shape == (atlas.height, atlas.width, 3), len(atlas), atlas.atlas_count)
"""


def test_a_program_changes_one_import(xatlas, tmp_path):
    """It uses trimesh as the readme of xatlas-python does."""
    program = PROGRAM.format(module=xatlas.__name__)
    command = [sys.executable, "-P", "-c", program, str(tmp_path / "ball.obj")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.stdout.split(), done.stderr) == (["True", "2", "1"], "")
    assert (tmp_path / "ball.obj").read_text().startswith("v ")


def test_own_errors_are_those_of_texbake_as_well():
    own = importlib.import_module(OURS)
    for arguments in ((SQUARE[:, :2], FACES), (SQUARE, FACES + 9), (SQUARE * np.nan, FACES)):
        with pytest.raises(TexbakeError):
            own.parametrize(*arguments)
    with pytest.raises(UnwrapError, match="no face has an area"):
        own.parametrize(0 * SQUARE, FACES)
