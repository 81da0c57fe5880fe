"""`texbake bench` through click's runner."""

import json

import pytest
from click.testing import CliRunner
from texbake_cli.commands.bench import bench

from texbake.errors import OptionError
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import plane
from texbake.study.bench.options import CASE_NAMES, PROGRAM_NAMES, TASK_NAMES


def test_a_quick_bench_of_one_task(tmp_path):
    folder = tmp_path / "out"
    words = ["--quick", "--task", "unwrap", "--case", "sphere", "--size", "32", "--blender", "none"]
    programs = [word for name in ("texbake", "xatlas", "blender") for word in ("--program", name)]
    done = CliRunner().invoke(bench, [*words, *programs, "-o", folder], catch_exceptions=False)
    assert done.exit_code == 0
    assert "xatlas, default" in done.output and "bench.html" in done.output
    assert "Blender: not installed" in done.output
    report = json.loads((folder / "bench.json").read_text())
    assert [item["task"] for item in report["contests"]] == ["unwrap"]


def test_one_mesh_is_not_a_pair(tmp_path):
    write_mesh(plane(), tmp_path / "high.obj")
    with pytest.raises(OptionError, match="give both, or neither"):
        CliRunner().invoke(
            bench, [str(tmp_path / "high.obj"), "-o", str(tmp_path)], catch_exceptions=False
        )


def test_help_names_everything_and_an_example():
    text = CliRunner().invoke(bench, ["--help"]).output
    assert "Example:" in text and "texbake bench --quick" in text
    words = "".join(text.split())
    assert all(name in words for name in (*TASK_NAMES, *CASE_NAMES, *PROGRAM_NAMES))


def test_an_unknown_task_is_wrong_usage():
    assert CliRunner().invoke(bench, ["--task", "paint"]).exit_code == 2
