"""`--max-error` and `--time-budget` on the command line."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import write_mesh
from texbake.mesh.shapes import plane
from texbake.sampling.rounds import BudgetClock


@pytest.fixture
def pair(tmp_path: Path) -> list[str]:
    high = plane(40, 40, lambda x, y: 0.05 * abs((7 * x) % 1 - 0.5))
    paths = [tmp_path / "high.obj", tmp_path / "low.obj"]
    for mesh, path in zip((high, plane()), paths, strict=True):
        write_mesh(mesh, path)
    return [str(path) for path in paths]


def test_a_maximum_error_is_given_and_reported(pair: list[str], tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    line = ["bake-normals", *pair, "-o", str(tmp_path / "n.png"), "--size", "64"]
    result = CliRunner().invoke(texbake, [*line, "--max-error", "0.5deg", "--report", str(report)])
    assert result.exit_code == 0, result.output
    assert "error of normal" in result.output
    sampling = json.loads(report.read_text())["sampling"]
    assert sampling["max_error"] == "0.5deg"
    assert sum(sampling["sample_percents"].values()) == pytest.approx(100)
    assert sampling["errors"][0]["measured_within_percent"] > 95


def test_heights_take_a_share_of_the_diagonal(pair: list[str], tmp_path: Path) -> None:
    line = ["bake-displacement", *pair, "-o", str(tmp_path / "h.exr"), "--size", "64"]
    result = CliRunner().invoke(texbake, [*line, "--max-error", "0.1%"])
    assert result.exit_code == 0, result.output
    assert "model units" in result.output


def test_a_time_budget_is_given_and_its_bound_gives_the_same_file(
    pair: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The time counts from the start of the process, which has run many tests.
    monkeypatch.setattr(BudgetClock, "of_process", lambda warn: BudgetClock())
    paths = [tmp_path / name for name in ("n.png", "again.png", "report.json", "page.html")]
    line = ["bake-normals", *pair, "--size", "64", "-o", str(paths[0]), "--time-budget", "5min"]
    made = [*line, "--report", str(paths[2]), "--html", str(paths[3])]
    result = CliRunner().invoke(texbake, made)
    assert result.exit_code == 0, result.output
    assert "the closest bound that is wanted; --max-error 0.004deg" in result.output
    budget = json.loads(paths[2].read_text())["budget"]
    assert budget["max_error"] == "0.004deg"
    assert "the closest bound that is wanted" in paths[3].read_text()
    again = ["bake-normals", *pair, "--size", "64", "-o", str(paths[1])]
    result = CliRunner().invoke(texbake, [*again, "--max-error", budget["max_error"]])
    assert result.exit_code == 0, result.output
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_too_short_a_time_is_said_in_one_line_and_still_gives_maps(
    pair: list[str], tmp_path: Path
) -> None:
    """In a process of its own, whose start takes longer than the budget."""
    output = tmp_path / "n.png"
    line = ["bake-normals", *pair, "-o", str(output), "--size", "64", "--time-budget", "0.01"]
    done = subprocess.run(
        [sys.executable, "-P", "-c", "from texbake_cli import run; run()", *line],
        capture_output=True,
        text=True,
        check=True,
    )
    said = [text for text in done.stderr.splitlines() if "too short" in text]
    assert len(said) == 1
    assert "--time-budget: 0.01 s is too short: the bake takes about" in said[0]
    assert output.exists()
