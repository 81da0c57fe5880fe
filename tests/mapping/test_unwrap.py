import inspect
import json
import subprocess
import sys

import numpy as np
import pytest

import texbake
from tests.models import HAS_REAL, model, real
from texbake import Mesh, OptionError, UnwrapOptions, distortion, unwrap
from texbake.errors import MeshError, UnwrapError
from texbake.mapping.atlas.bevels import angles_between
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import seam_edges
from texbake.mapping.unwrap import unwrap_together, unwrap_with_report
from texbake.mesh.compose import join_meshes
from texbake.mesh.distance import area_vectors
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane
from texbake.mesh.topology import find_edges, opposite_half_edges
from texbake.mesh.weld import weld_rows
from texbake.progress import ProgressSink


def assert_sound(before, after, padding, size):
    assert after.positions is before.positions or np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.faces, before.faces)
    corners = after.corner_uvs()
    texels = corners * size
    assert (texels >= padding).all() and (texels <= np.array(size) - padding).all()
    assert (signed_areas(corners) >= 0.0).all()
    assert not find_overlaps(corners).overlapping.any()


def grouped(mesh):
    """Three bands from bottom to top, as groups."""
    height = mesh.positions[mesh.faces, 1].mean(axis=1)
    groups = np.digitize(height, [-0.4, 0.4]).astype(np.int32)
    return mesh.replace(face_groups=groups, group_names=("low", "middle", "high"))


@pytest.mark.parametrize("mesh", [cube(), icosphere(3), grid_sphere(20, 40), plane(5, 5)])
@pytest.mark.parametrize("size", [256, (512, 128)])
def test_made_meshes(mesh, size):
    unwrapped, report = unwrap_with_report(mesh, size=size, padding=3)
    assert_sound(mesh, unwrapped, 3, (size, size) if isinstance(size, int) else size)
    found = report.distortion
    assert found.n_measured == mesh.n_faces
    assert found.n_charts == report.n_charts
    assert found.fill == pytest.approx(report.fill)
    assert found.stretch.l2 < 1.03 and found.stretch.symmetric_dirichlet < 4.15


def test_two_shells_in_one_place_get_coordinates_of_their_own():
    shell = icosphere(2)
    twice = Mesh(
        positions=np.concatenate([shell.positions, shell.positions]),
        faces=np.concatenate([shell.faces, shell.faces + shell.n_vertices]),
    )
    unwrapped, report = unwrap_with_report(twice, size=512, padding=2)
    assert_sound(twice, unwrapped, 2, (512, 512))
    assert report.distortion.n_measured == 2 * shell.n_faces


def test_options_and_changes_say_the_same():
    mesh = icosphere(1)
    first = unwrap(mesh, UnwrapOptions(size=128, padding=2))
    second = unwrap(mesh, UnwrapOptions(size=4096, padding=2), size=128)
    assert np.array_equal(first.corner_uvs(), second.corner_uvs())
    with pytest.raises(OptionError, match="size"):
        unwrap(mesh, size=0)


def test_the_report_is_json_and_the_stages_are_announced():
    class Listener(ProgressSink):
        def __init__(self):
            self.stages: list[str] = []

        def started(self, stage, total, unit):
            self.stages.append(stage)

        def advanced(self, stage, done):
            pass

        def finished(self, stage, seconds):
            pass

    listener = Listener()
    _, report = unwrap_with_report(icosphere(2), size=(256, 128), progress=listener)
    assert listener.stages == [
        "find mirror plane", "weigh edges", "cut charts", "weigh edges", "cut charts",
        "mirror charts", "join charts", "straighten borders", "pack charts", "measure",
    ]  # fmt: skip
    written = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert written["charts"] == report.n_charts
    assert written["options"]["size"] == [256, 128]
    assert written["options"]["method"] == "atlas"
    assert "theta" not in written["options"]  # only what an atlas reads
    assert written["distortion"]["l2"] == report.distortion.stretch.l2
    assert written["seconds"] == pytest.approx(sum(s["seconds"] for s in written["stages"]))


@pytest.mark.parametrize(
    ("name", "least_fill"),
    [("figure", 0.67), ("bracket", 0.65), *(("pairs/spot/low.obj", 0.67),) * HAS_REAL],
)
def test_figures_and_parts(name, least_fill):
    mesh = model(name)
    unwrapped, report = unwrap_with_report(mesh, size=1024, padding=1)
    assert_sound(mesh, unwrapped, 1, (1024, 1024))
    assert report.fill > least_fill and report.distortion.stretch.l2 < 1.02
    assert report.distortion.n_measured == mesh.n_faces


def test_a_function_is_given_by_its_name():
    def shear(points):
        return points @ [[1.0, 0.0], [0.5, 1.0]]

    _, report = unwrap_with_report(icosphere(1), method="spherical", warp=shear)
    assert report.to_json()["options"]["warp"] == "shear"


def test_several_meshes_share_one_texture_at_one_density():
    small, large = cube(), icosphere(2)
    large = large.replace(positions=3.0 * large.positions)
    results = unwrap_together([small, large], size=512, padding=2)
    both = join_meshes([mesh for mesh, _ in results])
    assert not find_overlaps(both.corner_uvs()).overlapping.any()
    found = distortion(both, 512)
    assert found.stretch.l2 < 1.03
    densities = [report.distortion.texel_density for _, report in results]
    assert densities[0] == pytest.approx(densities[1], rel=1e-3)


def test_groups_get_tiles_of_their_own():
    mesh = grouped(icosphere(3))
    mapped, report = unwrap_with_report(mesh, size=256, padding=2, by_group=True)
    tiles = np.floor(mapped.corner_uvs()).astype(int)
    assert (tiles == tiles[:, :1]).all()  # no face lies in two
    for group in range(3):
        columns = tiles[mesh.face_groups == group][:, 0, 0]
        assert (columns == columns[0]).all()
    assert report.distortion.n_tiles == 3


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_more_tiles_hold_more_texels(quality):
    mesh = icosphere(3)
    one, four = (
        unwrap_with_report(mesh, size=256, quality=quality, tiles=n)[1].distortion for n in (1, 4)
    )
    assert four.n_tiles > 1 and four.texel_density > 1.5 * one.texel_density


def test_no_chart_stretches_more_than_promised():
    _, report = unwrap_with_report(icosphere(3), max_stretch=1.002)
    assert max(chart.l2_alone for chart in report.distortion.charts) <= 1.002
    assert report.notes == ()


def test_only_an_atlas_takes_several_meshes():
    with pytest.raises(OptionError, match="box maps one mesh at a time"):
        unwrap_together([cube(), cube()], method="box")
    with pytest.raises(OptionError, match="there are none"):
        unwrap_together([])


@pytest.mark.parametrize("scale", [1e-300, 1e160, 1e300])
@pytest.mark.parametrize("method", ["atlas", "spherical"])
def test_sizes_whose_areas_float64_cannot_hold_are_one_error(scale, method):
    mesh = icosphere(1)
    with pytest.raises(MeshError, match="its areas cannot be computed; scale it first"):
        unwrap(mesh.replace(positions=mesh.positions * scale), method=method)


def test_coordinates_far_beyond_any_texture_are_refused():
    with pytest.raises(OptionError, match="up to 1e\\+300 tiles from the origin"):
        unwrap(plane(), method="planar", offset=(1e300, 0.0))
    corners = unwrap(plane(), method="planar", offset=(1e12 - 1.0, 0.0)).corner_uvs()
    assert corners.max() == 1e12


def test_a_mesh_that_a_mapping_flattens_still_gets_its_coordinates():
    mesh = plane(2, 2)  # seen edge-on
    mapped, report = unwrap_with_report(mesh, method="planar", axis="x")
    assert mapped.uvs is not None and np.isfinite(mapped.uvs).all()
    assert report.distortion is None
    assert (report.n_charts, report.fill) == (0, 0.0)
    assert report.tallies["faces seen edge-on"] == 8
    assert json.loads(json.dumps(report.to_json(), allow_nan=False))["distortion"] is None


def test_groups_are_kept_apart_though_their_charts_were_one():
    mesh = plane(2, 2).replace(face_groups=[0, 1] * 4, group_names=("x", "y"))
    mapped, report = unwrap_with_report(mesh, keep=True, by_group=True, size=128)
    tiles = np.floor(mapped.corner_uvs()[:, 0, 0]).astype(int)
    assert tiles.tolist() == [0, 1] * 4
    assert report.distortion is not None and report.distortion.n_tiles == 2


@pytest.mark.parametrize("quality", ["good", "best"])
def test_a_single_face_is_no_reason_to_search(quality):
    mesh = Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    one, fast = (unwrap(mesh, quality=name) for name in (quality, "fast"))
    assert np.array_equal(one.corner_uvs(), fast.corner_uvs())


def test_too_many_groups_are_refused_before_the_work():
    mesh = icosphere(3)
    names = tuple(f"part {i}" for i in range(mesh.n_faces))
    crowd = mesh.replace(face_groups=np.arange(mesh.n_faces), group_names=names)

    class NoWork(ProgressSink):
        def started(self, stage, total, unit):
            raise AssertionError(stage)

    with pytest.raises(UnwrapError, match="are 1,280 tiles, more than 1,000"):
        unwrap(crowd, by_group=True, progress=NoWork())


@pytest.fixture
def arrays():
    torus = texbake.make("torus", resolution=(12, 8))
    return torus.positions.astype(np.float32), torus.faces.astype(np.uint32)


def test_parametrize_indexes_the_input_vertices(arrays):
    positions, faces = arrays
    mapping, indices, uvs = texbake.parametrize(positions, faces)
    assert (mapping.dtype, indices.dtype, uvs.dtype) == (np.uint32, np.uint32, np.float32)
    np.testing.assert_array_equal(mapping[indices], faces)
    assert uvs.shape == (len(mapping), 2)
    assert uvs.min() >= 0.0 and uvs.max() <= 1.0
    assert set(indices.ravel()) == set(range(len(mapping)))


def test_parametrize_gives_the_coordinates_of_unwrap(arrays):
    positions, faces = arrays
    _, indices, uvs = texbake.parametrize(positions, faces, quality="fast", size=256)
    mesh = texbake.Mesh(positions=positions.astype(np.float64), faces=faces.astype(np.int32))
    unwrapped = texbake.unwrap(mesh, quality="fast", size=256)
    np.testing.assert_array_equal(uvs[indices], unwrapped.corner_uvs().astype(np.float32))


def test_parametrize_is_called_and_answers_as_xatlas_does(arrays):
    xatlas = pytest.importorskip("xatlas", reason="xatlas has no wheel for this Python")
    positions, faces = arrays
    ours, theirs = texbake.parametrize(positions, faces), xatlas.parametrize(positions, faces)
    assert [array.dtype for array in ours] == [array.dtype for array in theirs]
    assert [array.ndim for array in ours] == [array.ndim for array in theirs]
    np.testing.assert_array_equal(ours[0][ours[1]], theirs[0][theirs[1]])
    named = list(inspect.signature(texbake.parametrize).parameters)[:4]
    assert named == ["positions", "indices", "normals", "uvs"]


@pytest.mark.parametrize(("values", "message"), [
    ({"method": "magic"}, "method: magic is not one of atlas"),
    ({"size": 0}, "size: 0 is out of range"),
    ({"size": (1, 2, 3)}, "neither a whole number nor"),
    ({"padding": -1}, "padding: -1 is out of range; it must be 0 or more"),
    ({"size": (1024, 8), "padding": 4}, "leave no room in 1024 x 8"),
    ({"timeout": 0.0}, "timeout: 0.0"),
    ({"keep": True, "max_stretch": 1.1}, "max_stretch: charts that are kept are not cut"),
    ({"keep": True, "charts": "xatlas"}, "charts: charts that are kept are not cut"),
    ({"timeout": 9.0}, "timeout: it is for xatlas; leave it out, or use charts xatlas"),
    ({"method": "projector", "matrix": ((1.0, 0.0, 0.0, 0.0),) * 4, "fov": 50.0},
     "fov: the matrix has its own"),
    ({"method": "projector", "camera": 5}, "camera: 5 is neither 2 finite numbers nor 3"),
    ({"method": "planar", "warp": ("twirl",)}, "is not a name with its strength"),
    ({"rotate": float("inf")}, "rotate: inf is not a finite number"),
    ({"texel_density": 9.0, "scale": 2.0}, "texel_density: an atlas is packed at"),
    ({"method": "two-part", "surface": "box", "theta": (0.0, 90.0)}, "theta: the surface box"),
    ({"method": "two-part", "eye": (0.0, 0.0, 9.0)}, "eye: via centroid does not use it"),
    ({"method": "cylindrical", "theta": (0.0, 1e-320)}, "theta: .* is an empty range"),
])  # fmt: skip
def test_a_value_that_cannot_be_is_one_clear_error(values, message):
    with pytest.raises(OptionError, match=message):
        UnwrapOptions(**values)


def test_numbers_of_numpy_are_numbers():
    center = tuple(np.float32([1, 2, 3]))
    assert UnwrapOptions(method="spherical", center=center).center == (1.0, 2.0, 3.0)


def test_defaults_are_read_without_loading_numpy():
    code = "import sys, texbake.mapping.options; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", real("meshes/ADIS16480.STL"))
def test_a_plate_with_beveled_holes_is_cut_at_hard_edges_in_fast(name):
    mesh = unwrap(model(name), quality="fast")
    seams = seam_edges(mesh).ravel()
    corners = weld_rows(mesh.positions)[mesh.faces]
    opposite = opposite_half_edges(corners)
    edges = np.flatnonzero(seams & (opposite >= 0))
    crosses = area_vectors(mesh.positions, corners)
    angles = angles_between(crosses[edges // 3], crosses[opposite[edges] // 3])
    steps = mesh.positions[np.roll(corners, -1, axis=1)] - mesh.positions[corners]
    lengths = np.linalg.norm(steps.reshape(-1, 3)[edges], axis=1)
    assert lengths[angles >= 30.0].sum() >= 0.7 * lengths.sum()


@pytest.mark.parametrize("changes", [
    {"tiles": 1}, {"tiles": 4}, {"tiles": 4, "texel_density": 10.0},
])  # fmt: skip
def test_a_note_says_that_charts_use_fewer_tiles(changes):
    _, report = unwrap_with_report(plane(4, 4), **changes)
    expected = changes == {"tiles": 4}
    assert any("use 1 of 4 tiles" in note for note in report.notes) == expected


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
@pytest.mark.parametrize("step", [1, -1])
def test_a_note_says_that_repeated_faces_cut_charts(quality, step):
    ball = icosphere(2)
    doubled = ball.replace(faces=np.vstack([ball.faces, ball.faces[:, ::step]]))
    _, report = unwrap_with_report(doubled, quality=quality)
    assert f"{ball.n_faces} faces repeat others" in report.notes[-1]
    _, report = unwrap_with_report(ball, quality=quality)
    assert not any("repeat" in note for note in report.notes)


def test_a_note_says_that_faces_in_opposite_directions_end_charts():
    ball = icosphere(3)
    is_flipped = np.random.default_rng(0).uniform(size=ball.n_faces) < 0.5
    mixed = ball.replace(faces=np.where(is_flipped[:, None], ball.faces[:, ::-1], ball.faces))
    _, report = unwrap_with_report(mixed, quality="fast")
    edges = find_edges(mixed.faces)
    said = f"opposite directions at {edges.misoriented.sum()} edges, so charts end there"
    assert said in report.notes[-1]
    _, report = unwrap_with_report(ball, quality="fast")
    assert report.notes == ()


def scattered_cubes(n):
    """Cubes of one size anywhere, turned anyhow."""
    random = np.random.default_rng(0)
    turns = np.linalg.qr(random.normal(size=(n, 3, 3)))[0]
    turns *= np.linalg.det(turns)[:, None, None]
    box, places = cube(), random.uniform(0.0, 20.0, (n, 1, 3))
    cubes = zip(turns, places, strict=True)
    return join_meshes([box.replace(positions=box.positions @ turn + at) for turn, at in cubes])


def test_many_equal_parts_that_unfold_without_stretch_are_not_stretched():
    found = unwrap_with_report(scattered_cubes(300), quality="fast", size=4096)[1].distortion
    assert found.stretch.l2 < 1.0001
    assert found.n_charts < 4 * 300  # of 6 sides each


def test_a_note_says_that_padding_leaves_no_room():
    said = {}
    for padding in (1, 4):
        _, report = unwrap_with_report(scattered_cubes(200), size=256, padding=padding)
        said[padding] = any("use a padding of 1" in note for note in report.notes)
    assert said == {1: False, 4: True}


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
@pytest.mark.parametrize(("steps", "sizes"), [(1, (1, 2, 6)), (3, (1,) * 7)])
def test_separate_plates_stay_whole(steps, sizes, quality):
    plate = plane(steps, steps)
    plates = [
        plate.replace(positions=plate.positions * k + 9.0 * k * i) for i, k in enumerate(sizes)
    ]
    assert distortion(unwrap(join_meshes(plates), quality=quality)).n_charts == len(sizes)
