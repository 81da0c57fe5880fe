"""`texbake study` and `texbake bench` through click's runner."""

import json

import pytest
from click.testing import CliRunner
from texbake_cli.measurements import bench, study

from texbake import OptionError, write_mesh
from texbake.mesh.shapes import plane
from texbake.study.options import CASE_NAMES, KNOB_NAMES, PROGRAM_NAMES, TASK_NAMES

ONCE = ["--quick", "--repeats", "1", "--seconds", "0"]


def test_a_quick_study_of_two_knobs(tmp_path):
    words = [*ONCE, "--knob", "noise", "--knob", "bump-gradient"]
    done = CliRunner().invoke(study, [*words, "-o", tmp_path / "out"], catch_exceptions=False)
    assert done.exit_code == 0
    assert "pays up to" in done.output and "study.html" in done.output
    report = json.loads((tmp_path / "out" / "study.json").read_text())
    assert [item["knob"] for item in report["knobs"]] == ["bump-gradient", "noise"]


def test_a_quick_bench_of_one_task(tmp_path):
    words = [*ONCE, "--task", "unwrap", "--case", "sphere", "--size", "32", "--blender", "none"]
    words += [word for name in ("texbake", "xatlas", "blender") for word in ("--program", name)]
    done = CliRunner().invoke(bench, [*words, "-o", tmp_path / "out"], catch_exceptions=False)
    assert done.exit_code == 0
    assert "xatlas, default" in done.output and "bench.html" in done.output
    assert "Blender: not installed" in done.output
    report = json.loads((tmp_path / "out" / "bench.json").read_text())
    assert [item["task"] for item in report["contests"]] == ["unwrap"]


@pytest.mark.parametrize(
    ("command", "names"), [(study, KNOB_NAMES), (bench, (*TASK_NAMES, *CASE_NAMES, *PROGRAM_NAMES))]
)
def test_help_names_every_choice_and_one_mesh_is_not_a_pair(tmp_path, command, names):
    text = "".join(CliRunner().invoke(command, ["--help"]).output.split())
    assert all(name in text for name in names)
    write_mesh(plane(), tmp_path / "high.obj")
    words = [str(tmp_path / "high.obj"), "-o", str(tmp_path)]
    with pytest.raises(OptionError, match="give both, or neither"):
        CliRunner().invoke(command, words, catch_exceptions=False)
