"""The whole bench, small: what it measures, and its files."""

import json
import platform
import re
from dataclasses import fields, replace

import jsonschema
import numpy as np
import pytest

from texbake.errors import MeshError, OptionError
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.study.bench.cases import made_case
from texbake.study.bench.map_tasks import MISSED
from texbake.study.bench.programs import PROGRAMS, Product, Program
from texbake.study.bench.results_file import bench_schema
from texbake.study.bench.run import run_bench
from texbake.study.bench.tasks import TASKS, unwrap_error
from texbake.study.bench.write import write_bench
from texbake.study.options import TASK_NAMES, BenchOptions
from texbake.texture.image import write_image

ONCE = BenchOptions(quick=True, repeats=1, seconds=0.0, blender="none")


@pytest.fixture(scope="module")
def quick_bench():
    options = replace(ONCE, cases=("two-parts",), programs=("texbake", "xatlas", "blender"))
    return run_bench(options=options)


def test_every_task_is_done_and_judged(quick_bench):
    assert [contest.task.name for contest in quick_bench.contests] == list(TASK_NAMES)
    assert set(quick_bench.versions) == {"texbake", "xatlas"}
    for contest in quick_bench.contests:
        assert (contest.failures, contest.programs[0]) == ((), "texbake")
        for item in contest.measurements:
            assert 0.0 <= item.error < np.inf and min(item.seconds) > 0.0
    assert "xatlas" in {p for c in quick_bench.contests for p in c.programs}


def test_a_program_that_is_not_installed_is_named(quick_bench):
    assert list(quick_bench.missing) == ["Blender"]
    assert "No such file" in quick_bench.missing["Blender"]


def test_errors_are_those_of_the_job(quick_bench):
    """Bounds that hold for a right result and for no wrong one."""
    errors = {
        contest.task.name: {
            item.setting.label: item.error
            for item in contest.measurements
            if item.setting.series == "texbake"
        }
        for contest in quick_bench.contests
    }
    assert max(errors["bake-normals"].values()) < 0.1  # degrees
    assert max(errors["bake-displacement"].values()) < 0.02  # % of the diagonal
    assert max(errors["bake-ao"].values()) < 5.0  # %
    assert 0.0 < min(errors["unwrap"].values()) < 40.0
    assert max(errors["simplify"].values()) < 0.2 and max(errors["remesh"].values()) < 1.0
    assert errors["preview"]["4 samples"] < 0.7 * errors["preview"]["1 sample"] < 20.0


def test_the_files_have_everything(quick_bench, tmp_path):
    files = write_bench(quick_bench, tmp_path / "out")
    names = {path.name for path in files}
    assert files[0].name == "bench.html"
    assert names >= {"bench.json", "bench.md", "bake-normals-two-parts.png"}
    page = files[0].read_text("utf-8")
    assert "Blender is left out, because it is not installed" in page
    for contest in quick_bench.contests:
        assert contest.task.title in page and f'id="{contest.name}"' in page
    assert not re.search(r"(src|href)=\"https?:", page)
    report = json.loads((tmp_path / "out" / "bench.json").read_text())
    assert (report["format"], report["version"], report["quick"]) == ("texbake-bench", 2, True)
    assert report["programs"]["texbake"]["machine"]["processors"] >= 1
    assert platform.node() not in json.dumps(report)
    jsonschema.validate(report, bench_schema())
    assert report == json.loads(json.dumps(quick_bench.to_json()))
    assert len(report["contests"]) == len(TASK_NAMES)
    table = (tmp_path / "out" / "bench.md").read_text("utf-8")
    assert "| two-parts | unwrap, " in table and "xatlas" in table
    assert "cast no more rays" in page
    assert "fastest at the error that all reach" in page and "most missed texels" in page


def test_own_meshes_beside_no_made_case():
    options = replace(ONCE, cases=(), tasks=("simplify", "bake-ao"), programs=("texbake",))
    result = run_bench(icosphere(4), uv_sphere(6, 8), options=options)
    assert [c.task.name for c in result.contests] == ["bake-ao", "simplify"]
    assert result.contests[0].truth == "converged"
    assert max(item.error for item in result.contests[0].measurements) < 3.0  # a ball hides nothing
    assert result.inputs == {"high": "icosphere", "low": "uv sphere"}


def test_a_pair_is_whole_and_there_is_something_to_do():
    with pytest.raises(OptionError, match="give both"):
        run_bench(plane())
    with pytest.raises(OptionError, match="cases: none is named"):
        run_bench(options=BenchOptions(cases=()))
    with pytest.raises(MeshError, match="no program did any task"):
        run_bench(options=BenchOptions(quick=True, cases=("sphere",), tasks=("bake-ao",)))


def test_a_setting_that_fails_is_left_out_and_not_run_again(monkeypatch):
    commands = []

    class Faulty(Program):
        def command(self, job, stem, options):
            commands.append(job)
            command, product = super().command(job, stem, options)
            broken = [command[0], "-c", "raise SystemExit('no memory')"]
            return (broken if len(commands) == 1 else command), product

    ours = PROGRAMS["xatlas"]
    values = {field.name: getattr(ours, field.name) for field in fields(ours)}
    monkeypatch.setitem(PROGRAMS, "xatlas", Faulty(**values))
    options = replace(ONCE, tasks=("unwrap",), cases=("sphere",), programs=("xatlas",),
                      triangles=1000)  # fmt: skip
    (contest,) = run_bench(options=options).contests
    assert [item.label for item in contest.failures] == ["default"]
    assert contest.failures[0].reason == "exit code 1: no memory"
    assert [item.setting.label for item in contest.measurements] == ["brute force"]
    assert len(commands) == 2


def test_an_atlas_of_the_whole_square_wastes_nothing():
    assert unwrap_error(plane()).error == pytest.approx(0.0, abs=1e-9)
    quarter = plane().replace(uvs=plane().uvs * 0.5)
    assert unwrap_error(quarter).error == pytest.approx(75.0)
    # Twice as long in one direction: L2 stretch is the root of (1/2 + 2) / 2 at equal areas.
    stretched = plane().replace(uvs=plane().uvs * [1.0, 0.5])
    assert unwrap_error(stretched).error == pytest.approx(100.0 * (1.0 - 0.5 / 1.25))


def test_a_program_that_writes_object_space_is_judged_in_it(tmp_path):
    """The mean normal of a face, written as pymeshlab writes it."""
    options, case = BenchOptions(quick=True), made_case("two-parts", 4000)
    prepared = TASKS["bake-normals"].prepare(case, options, tmp_path)
    up = np.full((64, 64, 3), 0.5, np.float32)
    up[..., 2] = 1.0
    write_image(up, tmp_path / "up.png", bits=16)
    error = prepared.judge(Product(tmp_path / "up.png", "object")).error
    # The floor is flat; the ball, a sixth of the area, is 90 degrees off in the mean.
    area = np.pi * 4.0 * 0.25
    assert error == pytest.approx(90.0 * area / (16.0 + area), rel=0.05)


def test_texels_that_a_program_left_empty_count_as_missed(tmp_path):
    options, case = BenchOptions(quick=True), made_case("displaced-sphere", 4000)
    prepared = TASKS["bake-normals"].prepare(case, options, tmp_path)
    codes = np.full((64, 64, 3), 0.5, np.float32)
    codes[..., 2] = 1.0
    write_image(codes, tmp_path / "flat.png", bits=16)
    figures = prepared.judge(Product(tmp_path / "flat.png", "tangent")).figures
    # All but the probes whose true normal happens to be that of the low-poly mesh.
    assert figures[MISSED] > 90.0
    codes[:] = (0.6, 0.5, 0.9)  # wrong, but somebody has written it
    write_image(codes, tmp_path / "wrong.png", bits=16)
    figures = prepared.judge(Product(tmp_path / "wrong.png", "tangent")).figures
    assert figures[MISSED] == 0.0 and figures["angle, 99th percentile (°)"] > 10.0
