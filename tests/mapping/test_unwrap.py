import json

import numpy as np
import pytest

from tests.models import HAS_REAL, model, real
from texbake.errors import MeshError, OptionError, UnwrapError
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.distortion import distortion
from texbake.mapping.options import METHODS, UnwrapOptions
from texbake.mapping.overlap import overlapping_faces
from texbake.mapping.unwrap import unwrap, unwrap_together, unwrap_with_report
from texbake.mesh.compose import join_meshes
from texbake.mesh.mesh import Mesh
from texbake.mesh.polygons import outlines
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane
from texbake.progress import ProgressSink

FAN = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [-0.5, 0.9, 0], [-0.5, -0.9, 0]]

HARD = {
    "one face": ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "three faces at an edge": (FAN, [[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
    "the same face twice": (FAN, [[0, 1, 2], [0, 1, 2], [0, 1, 3]]),
    "a face and its back": (FAN, [[0, 1, 2], [2, 1, 0]]),
    "a face with one corner twice": (FAN, [[0, 1, 2], [0, 0, 1], [3, 3, 3]]),
    "a face on a line": ([*FAN, [0, 0, 0.5]], [[0, 1, 2], [0, 5, 1]]),
    "two parts, one tiny": (
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, 1], [0.50001, 0.5, 1], [0.5, 0.50001, 1]],
        [[0, 1, 2], [3, 4, 5]],
    ),
    "two faces that touch at a corner": (FAN, [[0, 1, 2], [0, 3, 4]]),
}


def assert_sound(before: Mesh, after: Mesh, padding: int, size: tuple[int, int]) -> None:
    """Check the properties of every unwrapped mesh."""
    assert after.positions is before.positions or np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.faces, before.faces)
    corners = after.corner_uvs()
    texels = corners * size
    assert (texels >= padding).all()
    assert (texels <= np.array(size) - padding).all()
    assert (signed_areas(corners) >= 0.0).all()
    assert not overlapping_faces(corners).any()


def grouped(mesh: Mesh) -> Mesh:
    """Three bands from bottom to top, as groups."""
    height = mesh.positions[mesh.faces, 1].mean(axis=1)
    groups = np.digitize(height, [-0.4, 0.4]).astype(np.int32)
    return mesh.replace(face_groups=groups, group_names=("low", "middle", "high"))


@pytest.mark.parametrize("mesh", [cube(), icosphere(3), grid_sphere(20, 40), plane(5, 5)])
@pytest.mark.parametrize("size", [256, (512, 128)])
def test_made_meshes(mesh: Mesh, size: int | tuple[int, int]) -> None:
    unwrapped, report = unwrap_with_report(mesh, size=size, padding=3)
    assert_sound(mesh, unwrapped, 3, (size, size) if isinstance(size, int) else size)
    found = report.distortion
    assert found.n_measured == mesh.n_faces
    assert found.n_charts == report.n_charts
    assert found.fill == pytest.approx(report.fill)
    assert found.stretch.l2 < 1.03
    assert found.stretch.symmetric_dirichlet < 4.15


@pytest.mark.parametrize("name", HARD)
def test_hard_meshes(name: str) -> None:
    positions, faces = HARD[name]
    mesh = Mesh(positions=positions, faces=faces, name=name)
    unwrapped, report = unwrap_with_report(mesh, size=64, padding=1)
    assert_sound(mesh, unwrapped, 1, (64, 64))
    solid = report.distortion.n_degenerate + report.distortion.n_measured
    assert solid == mesh.n_faces
    without_area = report.tallies.get("faces without area, reduced to a point", 0)
    assert without_area == report.distortion.n_degenerate


def test_two_shells_in_one_place_get_coordinates_of_their_own() -> None:
    shell = icosphere(2)
    twice = Mesh(
        positions=np.concatenate([shell.positions, shell.positions]),
        faces=np.concatenate([shell.faces, shell.faces + shell.n_vertices]),
    )
    unwrapped, report = unwrap_with_report(twice, size=512, padding=2)
    assert_sound(twice, unwrapped, 2, (512, 512))
    assert report.distortion.n_measured == 2 * shell.n_faces


def test_everything_else_of_the_mesh_stays() -> None:
    mesh = plane(2, 2)
    mesh = mesh.replace(
        normals=[[0, 0, 1]],
        normal_faces=np.zeros_like(mesh.faces),
        tangents=np.tile([1.0, 0.0, 0.0, 1.0], (8, 3, 1)),
        colors=np.full((9, 3), 0.5),
        face_groups=np.zeros(8, dtype=np.int32),
        group_names=("top",),
        name="table.obj",
    )
    unwrapped = unwrap(mesh, size=64)
    for field in ("positions", "faces", "normals", "normal_faces", "colors", "face_groups"):
        assert getattr(unwrapped, field) is getattr(mesh, field) or np.array_equal(
            getattr(unwrapped, field), getattr(mesh, field)
        )
    assert (unwrapped.group_names, unwrapped.name) == (("top",), "table.obj")
    assert unwrapped.tangents is None  # they were made for other coordinates


def test_options_and_changes_say_the_same() -> None:
    mesh = icosphere(1)
    first = unwrap(mesh, UnwrapOptions(size=128, padding=2))
    second = unwrap(mesh, UnwrapOptions(size=4096, padding=2), size=128)
    assert np.array_equal(first.corner_uvs(), second.corner_uvs())
    with pytest.raises(OptionError, match="size"):
        unwrap(mesh, size=0)


def test_the_report_is_json_and_the_stages_are_announced() -> None:
    class Listener(ProgressSink):
        def __init__(self) -> None:
            self.stages: list[str] = []

        def started(self, stage: str, total: int | None, unit: str) -> None:
            self.stages.append(stage)

        def advanced(self, stage: str, done: int) -> None:
            pass

        def finished(self, stage: str, seconds: float) -> None:
            pass

    listener = Listener()
    _, report = unwrap_with_report(icosphere(2), size=(256, 128), progress=listener)
    assert listener.stages == [
        "cut charts", "relax charts", "join charts", "pack charts", "measure"
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
def test_figures_and_parts(name: str, least_fill: float) -> None:
    mesh = model(name)
    unwrapped, report = unwrap_with_report(mesh, size=1024, padding=1)
    assert_sound(mesh, unwrapped, 1, (1024, 1024))
    assert report.fill > least_fill
    assert report.distortion.stretch.l2 < 1.02
    assert report.distortion.n_measured == mesh.n_faces


@pytest.mark.parametrize("method", [m for m in METHODS if m not in ("atlas", "parametric")])
def test_classical_methods_keep_everything_but_the_coordinates(method: str) -> None:
    mesh = grouped(icosphere(3))
    mapped, report = unwrap_with_report(mesh, method=method)
    assert np.array_equal(mapped.positions, mesh.positions)
    assert np.array_equal(mapped.faces, mesh.faces)
    assert mapped.uvs is not None and np.isfinite(mapped.uvs).all()
    assert [stage.name for stage in report.stages] == [f"map ({method})", "measure"]
    assert json.loads(json.dumps(report.to_json(), allow_nan=False))["options"]["method"] == method


def test_a_function_is_given_by_its_name() -> None:
    def shear(points: np.ndarray) -> np.ndarray:
        return points @ [[1.0, 0.0], [0.5, 1.0]]

    _, report = unwrap_with_report(icosphere(1), method="spherical", warp=shear)
    assert report.to_json()["options"]["warp"] == "shear"


def test_several_meshes_share_one_texture_at_one_density() -> None:
    small, large = cube(), icosphere(2)
    large = large.replace(positions=3.0 * large.positions)
    results = unwrap_together([small, large], size=512, padding=2)
    both = join_meshes([mesh for mesh, _ in results])
    assert not overlapping_faces(both.corner_uvs()).any()
    found = distortion(both, 512)
    assert found.stretch.l2 < 1.03
    densities = [report.distortion.texel_density for _, report in results]
    assert densities[0] == pytest.approx(densities[1], rel=1e-3)


def test_groups_get_tiles_of_their_own() -> None:
    mesh = grouped(icosphere(3))
    mapped, report = unwrap_with_report(mesh, size=256, padding=2, by_group=True)
    tiles = np.floor(mapped.corner_uvs()).astype(int)
    assert (tiles == tiles[:, :1]).all()  # no face lies in two
    for group in range(3):
        columns = tiles[mesh.face_groups == group][:, 0, 0]
        assert (columns == columns[0]).all()
    assert report.distortion.n_tiles == 3


def test_more_tiles_hold_more_texels() -> None:
    mesh = icosphere(3)
    one, four = (unwrap_with_report(mesh, size=256, tiles=n)[1].distortion for n in (1, 4))
    assert four.n_tiles > 1
    assert four.texel_density > 1.5 * one.texel_density


def test_no_chart_stretches_more_than_promised() -> None:
    _, report = unwrap_with_report(icosphere(3), max_stretch=1.002)
    assert max(chart.l2_alone for chart in report.distortion.charts) <= 1.002
    assert report.notes == ()


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_every_quality_is_sound(quality: str) -> None:
    mesh = grid_sphere(24, 40)
    mapped, report = unwrap_with_report(mesh, quality=quality, size=512)
    assert_sound(mesh, mapped, 4, (512, 512))
    assert report.distortion.stretch.l2 < {"fast": 1.06, "good": 1.03, "best": 1.1}[quality]


def test_best_fills_no_less_than_good() -> None:
    # A sphere of few faces, whose large charts leave more empty than many small ones.
    mesh = icosphere(1)
    fills = [
        distortion(unwrap(mesh, size=256, quality=quality), 256).fill
        for quality in ("good", "best")
    ]
    assert fills[1] >= fills[0]


def test_bytes_do_not_depend_on_threads() -> None:
    mesh = icosphere(4)
    first = unwrap(mesh, threads=1)
    assert all(np.array_equal(unwrap(mesh, threads=n).uvs, first.uvs) for n in (2, 3))


def test_only_an_atlas_takes_several_meshes() -> None:
    with pytest.raises(OptionError, match="box maps one mesh at a time"):
        unwrap_together([cube(), cube()], method="box")
    with pytest.raises(OptionError, match="there are none"):
        unwrap_together([])


@pytest.mark.parametrize(
    "name",
    ["fused cells", "crossing figures", "organs", *real("broken/openscad-nonmanifold-crash.obj")],
)
def test_broken_meshes(name: str) -> None:
    mesh = model(name)
    assert_sound(mesh, unwrap(mesh, size=1024, padding=1), 1, (1024, 1024))


@pytest.mark.parametrize("scale", [1e-300, 1e160, 1e300])
@pytest.mark.parametrize("method", ["atlas", "spherical"])
def test_sizes_whose_areas_float64_cannot_hold_are_one_error(scale: float, method: str) -> None:
    mesh = icosphere(1)
    with pytest.raises(MeshError, match="its areas cannot be computed; scale it first"):
        unwrap(mesh.replace(positions=mesh.positions * scale), method=method)


def test_coordinates_far_beyond_any_texture_are_refused() -> None:
    with pytest.raises(OptionError, match="up to 1e\\+300 tiles from the origin"):
        unwrap(plane(), method="planar", offset=(1e300, 0.0))


def test_a_mesh_that_a_mapping_flattens_still_gets_its_coordinates() -> None:
    mesh = plane(2, 2)  # seen edge-on
    mapped, report = unwrap_with_report(mesh, method="planar", axis="x")
    assert mapped.uvs is not None and np.isfinite(mapped.uvs).all()
    assert report.distortion is None
    assert (report.n_charts, report.fill) == (0, 0.0)
    assert report.tallies["faces seen edge-on"] == 8
    assert json.loads(json.dumps(report.to_json(), allow_nan=False))["distortion"] is None


def test_groups_are_kept_apart_though_their_charts_were_one() -> None:
    mesh = plane(2, 2).replace(face_groups=[0, 1] * 4, group_names=("x", "y"))
    mapped, report = unwrap_with_report(mesh, keep=True, by_group=True, size=128)
    tiles = np.floor(mapped.corner_uvs()[:, 0, 0]).astype(int)
    assert tiles.tolist() == [0, 1] * 4
    assert report.distortion is not None and report.distortion.n_tiles == 2


@pytest.mark.parametrize("quality", ["good", "best"])
def test_a_single_face_is_no_reason_to_search(quality: str) -> None:
    mesh = Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    one, fast = (unwrap(mesh, quality=name) for name in (quality, "fast"))
    assert np.array_equal(one.corner_uvs(), fast.corner_uvs())


def test_too_many_groups_are_refused_before_the_work() -> None:
    mesh = icosphere(3)
    names = tuple(f"part {i}" for i in range(mesh.n_faces))
    crowd = mesh.replace(face_groups=np.arange(mesh.n_faces), group_names=names)

    class NoWork(ProgressSink):
        def started(self, stage: str, total: int | None, unit: str) -> None:
            raise AssertionError(stage)

    with pytest.raises(UnwrapError, match="are 1,280 tiles, more than 1,000"):
        unwrap(crowd, by_group=True, progress=NoWork())


@pytest.mark.parametrize("quality", ["fast", "best"])
def test_charts_do_not_cut_polygons(quality):
    ball = grid_sphere(14, 24)
    stretched = ball.positions * (1 + 0.3 * np.sin(5 * ball.positions[:, [1]]))
    rough = ball.replace(positions=stretched)
    whole = rough.replace(polygon_of=np.arange(rough.n_faces) // 2)
    options = UnwrapOptions(quality=quality)
    cut, kept = (distortion(unwrap(mesh, options), 512) for mesh in (rough, whole))
    assert kept.n_charts > 1
    assert outlines(unwrap(whole, options)).n_split == 0
    assert outlines(unwrap(rough, options).replace(polygon_of=whole.polygon_of)).n_split > 0
    assert kept.n_charts < 1.5 * cut.n_charts
