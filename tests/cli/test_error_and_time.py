"""`--max-error` and `--time-budget` of bakes and pictures on the command line."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from texbake import write_mesh
from texbake.mesh.shapes import cube, plane
from texbake.sampling.rounds import BudgetClock

NORMALS = "bake-normals high.obj low.obj --size 64"
PICTURE = "preview cube.obj --size 96x64"


@pytest.fixture(autouse=True)
def meshes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(plane(40, 40, lambda x, y: 0.05 * abs((7 * x) % 1 - 0.5)), "high.obj")
    write_mesh(plane(), "low.obj")
    write_mesh(cube(), "cube.obj")


@pytest.mark.parametrize(("line", "error", "words"), [
    (f"{NORMALS} -o n.png", "0.5deg", "error of normal"),
    ("bake-displacement high.obj low.obj --size 64 -o h.exr", "0.1%", "model units"),
    (f"{PICTURE} -o cube.png", "2/255", "error of color"),
])  # fmt: skip
def test_a_maximum_error_is_met_and_reported(invoke, line, error, words):
    assert words in invoke(f"{line} --max-error {error} --report r.json").output
    report = json.loads(Path("r.json").read_text())
    assert report["sampling"]["max_error"] == error
    assert sum(report["sampling"]["sample_percents"].values()) == pytest.approx(100)
    if line.startswith("bake"):
        assert report["sampling"]["errors"][0]["measured_within_percent"] > 95
    else:
        assert "passes" in report and "budget" not in report


@pytest.mark.parametrize(("line", "bound"), [(NORMALS, "0.004deg"), (PICTURE, "0.0625/255")])
def test_the_bound_of_a_time_budget_gives_the_same_file(invoke, monkeypatch, line, bound):
    # The time counts from the start of the process, which has run many tests.
    monkeypatch.setattr(BudgetClock, "of_process", lambda warn: BudgetClock())
    page = "--html page.html" if line == NORMALS else "--explain"
    result = invoke(f"{line} -o a.png --time-budget 5min --report r.json {page}")
    assert f"the closest bound that is wanted; --max-error {bound}" in result.output
    budget = json.loads(Path("r.json").read_text())["budget"]
    assert budget["max_error"] == bound and budget["actual_seconds"] < 300
    if line == NORMALS:
        assert "the closest bound that is wanted" in Path("page.html").read_text()
    invoke(f"{line} -o again.png --max-error {bound}")
    assert Path("a.png").read_bytes() == Path("again.png").read_bytes()


def test_turntables_accept_a_bound(invoke):
    invoke("preview cube.obj -o turn --size 32 --view turntable:2 --max-error 0.02")
    assert sorted(path.name for path in Path("turn").iterdir()) == ["000.png", "001.png"]


def test_too_short_a_time_is_a_warning_and_still_gives_maps():
    """In a process of its own, whose start takes longer than the budget."""
    line = f"{NORMALS} -o n.png --time-budget 0.01"
    process = subprocess.run(
        [sys.executable, "-P", "-c", "from texbake_cli import run; run()", *line.split()],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    (warning,) = [text for text in process.stderr.splitlines() if "too short" in text]
    assert "--time-budget: 0.01 s is too short: the bake takes about" in warning
    assert Path("n.png").exists()


# Prints its processor seconds, which stand for the clock, when the process ends.
WITH_AGE = """
import atexit, time
from texbake import progress
time.perf_counter = progress.process_age = time.process_time
atexit.register(lambda: print("age", time.process_time(), flush=True))
from texbake_cli import run
run()
"""


@pytest.mark.parametrize("line", [
    f"{NORMALS} -o n.png",
    "simplify high.obj -o s.ply --faces 99",
    "preview cube.obj -o p.png --size 64",
])  # fmt: skip
def test_stages_add_up_to_the_life_of_the_process(line):
    process = subprocess.run(
        [sys.executable, "-P", "-c", WITH_AGE, *line.split(), "--verbose"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    *rows, age = process.stdout.split("Stages\n")[1].splitlines()
    *stages, total = [float(re.search(r"  ([\d.]+) s", row)[1]) for row in rows]
    # Each is rounded to hundredths.
    assert abs(sum(stages) - total) < 0.005 * len(rows) + 1e-9
    assert total == pytest.approx(float(age.removeprefix("age ")), rel=0.02, abs=0.01)
