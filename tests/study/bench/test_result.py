"""Curves, fronts and matches of settings with given times and errors."""

import re
from dataclasses import replace

import jsonschema
import pytest

from texbake.study.bench.result import BenchResult, Contest, Failure
from texbake.study.bench.results_file import bench_schema
from texbake.study.bench.tasks import TASKS
from texbake.study.bench.write import contest_plot, machine_words, markdown
from texbake.study.knob import Evaluation, Setting
from texbake.study.options import BenchOptions
from texbake.study.result import Measurement


def measured(program, label, seconds, error, megabytes):
    setting = Setting(label, None, program)
    times = (0.9 * seconds, seconds, 1.2 * seconds)
    return Measurement(
        setting, Evaluation(error, figures={"charts": 2.0}), times, megabytes * 10**6
    )


@pytest.fixture
def contest():
    return Contest(
        TASKS["unwrap"], "sphere", "a sphere", "exact values", "By formula.",
        (
            measured("texbake", "fast", 1.0, 8.0, 50), measured("texbake", "good", 2.0, 3.0, 80),
            measured("texbake", "slow", 3.0, 5.0, 90), measured("Blender", "smart", 10.0, 7.9, 300),
            measured("Blender", "best", 30.0, 1.0, 300),
            measured("xatlas", "default", 0.5, 9.0, 20),
        ),
        (Failure("meshoptimizer", "default", "exit code 1"),),
    )  # fmt: skip


def test_a_curve_has_what_no_setting_of_the_same_program_beats(contest):
    assert contest.programs == ["texbake", "Blender", "xatlas"]
    assert (contest.curve("texbake"), contest.curve("Blender")) == ([0, 1], [3, 4])
    assert (contest.curve("Blender", memory=True), contest.front) == ([4], [5, 0, 1, 4])
    assert contest.memory_front == [5, 0, 1, 4]


def test_each_setting_is_matched_with_the_fastest_that_is_as_accurate(contest):
    matches = {match.theirs.setting.label: match for match in contest.matches()}
    # 8.0 is within 2 % of 7.9.
    assert matches["smart"].ours.setting.label == "fast"
    assert matches["smart"].times_as_fast == pytest.approx(10.0)
    assert matches["best"].ours is None and matches["best"].times_as_fast is None
    assert matches["default"].times_as_fast == pytest.approx(0.5)


def test_memory_is_plotted_where_it_is_known(contest):
    colors = dict.fromkeys(contest.programs, "#000000")
    bare = tuple(replace(item, peak_bytes=None) for item in contest.measurements)
    for measurements, n_frames in (contest.measurements, 2), (bare, 1):
        plot = contest_plot(replace(contest, measurements=measurements), colors)
        assert len(re.findall('id="[^"]*axes_[0-9]+"', plot.svg)) == n_frames


@pytest.fixture
def result(contest):
    machine = {"system": "Linux", "processor": "x86_64", "processors": 2, "python": "3.11.7"}
    versions = {"texbake": "0.1.0", "Blender": "5.0.1", "xatlas": "0.0.11"}
    return BenchResult(
        options=BenchOptions(), machines=dict.fromkeys(versions, machine), versions=versions,
        missing={"pymeshlab": "No module named 'pymeshlab'"}, contests=(contest,),
        date="2026-11-27",
    )  # fmt: skip


def test_markdown_has_a_row_for_a_task(result):
    text = markdown(result)
    assert "Measured on 2026-11-27, on x86_64, 2 processors" in text
    assert "Not installed: pymeshlab." in text
    rows = [line for line in text.splitlines() if line.startswith("| sphere")]
    (summary,) = rows
    # Of Blender's two settings the second; none of texbake is as accurate, so its best is shown.
    assert summary == (
        "| sphere | unwrap, best (texbake: good) | 2 s | 30 s | less accurate | 3% / 1% "
        "| 80 MB / 300 MB |"
    )


def test_json_follows_the_schema_and_names_what_failed(result):
    report = result.to_json()
    jsonschema.validate(report, bench_schema())
    report = report["contests"][0]
    assert report["left_out"] == [
        {"program": "meshoptimizer", "setting": "default", "reason": "exit code 1"}
    ]
    assert [item["on_front"] for item in report["settings"]] == [True, True, False, False, True,
                                                                 True]  # fmt: skip


def test_programs_are_compared_at_the_error_that_all_reach(contest):
    found = {item.program: item for item in contest.standings()}
    # xatlas reaches 9 % and nothing less.
    labels = {name: item.equal and item.equal.setting.label for name, item in found.items()}
    assert labels == {
        "texbake": "fast", "Blender": "smart", "xatlas": "default", "meshoptimizer": None
    }  # fmt: skip
    assert found["meshoptimizer"].n_failures == 1 and found["Blender"].worst("charts") == 2.0
    assert found["meshoptimizer"].worst("charts") is None


def test_times_of_another_machine_are_named(result):
    elsewhere = {"system": "Windows", "processor": "AMD64", "processors": 32, "model": "Fast"}
    machines = {**result.machines, "Blender": elsewhere}
    text = machine_words(replace(result, machines=machines))
    assert text.endswith(
        "Blender ran on Fast, 32 processors, Windows: compare these times with care."
    )
