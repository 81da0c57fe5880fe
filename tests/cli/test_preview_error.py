"""Errors and time budgets of a picture, and of the whole job, on the command line."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import write_mesh
from texbake.mesh.shapes import cube
from texbake.sampling.rounds import BudgetClock


@pytest.fixture
def mesh(tmp_path: Path) -> str:
    path = tmp_path / "cube.obj"
    write_mesh(cube(), path)
    return str(path)


def preview(mesh: str, tmp_path: Path, *words: str):
    line = ["preview", mesh, "-o", str(tmp_path / "cube.png"), "--size", "96x64", *words]
    return CliRunner().invoke(texbake, line)


def test_a_bound_is_given_and_reported(mesh: str, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    result = preview(mesh, tmp_path, "--max-error", "2/255", "--report", str(report))
    assert result.exit_code == 0, result.output
    assert "error of color" in result.output
    words_shown = json.loads(report.read_text())
    assert words_shown["sampling"]["max_error"] == "2/255"
    assert sum(words_shown["sampling"]["sample_percents"].values()) == pytest.approx(100)
    assert "passes" in words_shown and "budget" not in words_shown


def test_a_time_budget_is_given_and_its_bound_gives_the_same_file(
    mesh: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The time counts from the start of the process, which has run many tests.
    monkeypatch.setattr(BudgetClock, "of_process", lambda warn: BudgetClock())
    report = tmp_path / "report.json"
    result = preview(mesh, tmp_path, "--time-budget", "5min", "--report", str(report), "--explain")
    assert result.exit_code == 0, result.output
    assert "the closest bound that is wanted; --max-error 0.0625/255" in result.output
    budget = json.loads(report.read_text())["budget"]
    assert budget["max_error"] == "0.0625/255" and budget["actual_seconds"] < 300
    written = (tmp_path / "cube.png").read_bytes()
    result = preview(mesh, tmp_path, "--max-error", budget["max_error"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "cube.png").read_bytes() == written


def test_turntables_accept_a_bound(mesh: str, tmp_path: Path) -> None:
    line = ["preview", mesh, "-o", str(tmp_path / "turn"), "--size", "32", "--view", "turntable:2"]
    result = CliRunner().invoke(texbake, [*line, "--max-error", "0.02"])
    assert result.exit_code == 0, result.output
    assert len(list((tmp_path / "turn").glob("*.png"))) == 2
