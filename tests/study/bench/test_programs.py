"""Commands and settings of the programs."""

import json
import sys
from pathlib import Path

import pytest
from texbake_cli.main import texbake as command_line

from texbake.study.bench.programs import PROGRAMS, RUNNERS
from texbake.study.bench.tasks import TASKS
from texbake.study.options import (
    BLENDER_VARIABLE,
    CASE_NAMES,
    PROGRAM_NAMES,
    TASK_NAMES,
    BenchOptions,
)

JOB = {
    "high": "high.ply", "low": "low.obj", "mesh": "mesh.ply", "scene": "scene.toml", "gap": 2,
    "size": 64, "distance": 0.1, "padding": 16, "samples": 1,
}  # fmt: skip


def test_programs_and_tasks_are_those_of_the_options():
    assert tuple(PROGRAMS) == PROGRAM_NAMES
    assert tuple(TASKS) == TASK_NAMES
    assert all(set(program.settings) <= set(TASKS) for program in PROGRAMS.values())
    assert set(PROGRAMS["texbake"].settings) == set(TASKS)


@pytest.mark.parametrize("task", TASK_NAMES)
def test_every_command_of_texbake_parses(task, tmp_path):
    program, options = PROGRAMS["texbake"], BenchOptions(quick=True)
    labels = []
    for label, added in program.settings[task](options):
        labels.append(label)
        command, product = program.command({**JOB, **added, "task": task}, tmp_path / "x", options)
        assert command[0] == sys.executable and "texbake_cli" in command[3]
        words = command[4:]
        for name in ("high.ply", "low.obj", "mesh.ply", "scene.toml"):
            words = [str(tmp_path / name) if word == name else word for word in words]
            (tmp_path / name).touch()
        subcommand = command_line.get_command(None, words[0])
        context = subcommand.make_context(words[0], words[1:])  # parses and checks
        assert context.params["quiet"] is True if "quiet" in context.params else True
        assert product.path.is_relative_to(tmp_path)
    assert len(set(labels)) == len(labels) > 0


@pytest.mark.parametrize("name", [name for name in PROGRAM_NAMES if name != "texbake"])
def test_a_runner_has_every_task_of_its_program(name):
    program, options = PROGRAMS[name], BenchOptions(quick=True, blender="python3")
    text = (RUNNERS / program.runner).read_text(encoding="utf-8")
    prefix = "" if name == "blender" else f"{name.replace('-', '_')}_"
    for task, settings in program.settings.items():
        assert f"def {prefix}{task.replace('-', '_')}(job)" in text
        for _, added in settings(options):
            job = {**JOB, **added, "task": task}
            command, product = program.command(job, Path("/tmp/x"), options)
            given = json.loads(command[2])
            assert (given["program"], given["task"]) == (name, task)
            assert given["out"] == str(product.path)
    assert "def version(job)" in text


def test_blender_needs_a_python(monkeypatch):
    monkeypatch.delenv(BLENDER_VARIABLE, raising=False)
    version, reason = PROGRAMS["blender"].version(BenchOptions())
    assert version == "" and BLENDER_VARIABLE in reason
    monkeypatch.setenv(BLENDER_VARIABLE, sys.executable)  # which has no bpy
    version, reason = PROGRAMS["blender"].version(BenchOptions())
    assert version == "" and "No module named 'bpy'" in reason


def test_an_installed_program_has_a_version():
    for name in "texbake", "xatlas":
        version, reason = PROGRAMS[name].version(BenchOptions())
        assert version[0].isdigit() and reason == ""


def test_options_are_in_order_and_checked():
    options = BenchOptions(
        tasks=("simplify", "unwrap", "simplify"), cases=("terrain", "sphere"), sizes=(64, 32, 64)
    )
    assert options.ordered_tasks == ("unwrap", "simplify")
    assert options.ordered_cases == ("sphere", "terrain")
    assert options.map_sizes == (32, 64) and options.one_size == 64
    assert BenchOptions().one_size == 1024 and BenchOptions(sizes=(4096,)).one_size == 4096
    assert BenchOptions(cases=()).ordered_cases == ()
    assert BenchOptions().ordered_cases == CASE_NAMES
