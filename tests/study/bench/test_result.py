"""Curves, fronts and matches of settings with given times and errors."""

import csv
import io
import re
from dataclasses import replace

import pytest

from texbake.study.bench.result import BenchResult, Contest, Failure
from texbake.study.bench.tasks import TASKS
from texbake.study.bench.write import contest_plot, markdown
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
            measured("texbake", "fast", 1.0, 8.0, 50),
            measured("texbake", "good", 2.0, 3.0, 80),
            measured("texbake", "slow", 3.0, 5.0, 90),
            measured("Blender", "smart", 10.0, 7.9, 300),
            measured("Blender", "best", 30.0, 1.0, 300),
            measured("xatlas", "default", 0.5, 9.0, 20),
        ),
        (Failure("trimesh", "default", "exit code 1"),),
    )  # fmt: skip


def test_a_curve_has_what_no_setting_of_the_same_program_beats(contest):
    assert contest.programs == ["texbake", "Blender", "xatlas"]
    assert contest.curve("texbake") == [0, 1]
    assert contest.curve("Blender") == [3, 4]
    assert contest.curve("Blender", memory=True) == [4]
    assert contest.front == [5, 0, 1, 4]
    assert contest.memory_front == [5, 0, 1, 4]


def test_each_setting_is_matched_with_the_fastest_that_is_as_accurate(contest):
    matches = {match.theirs.setting.label: match for match in contest.matches()}
    # 8.0 is within 2 % of 7.9.
    assert matches["smart"].ours.setting.label == "fast"
    assert matches["smart"].times_as_fast == pytest.approx(10.0)
    assert matches["best"].ours is None and matches["best"].times_as_fast is None
    assert matches["default"].times_as_fast == pytest.approx(0.5)


def test_json_has_the_measurements_of_each_setting(contest):
    for found, item in zip(contest.to_json()["settings"], contest.measurements, strict=True):
        figures = item.to_json()
        assert found["program"] == figures.pop("series")
        del figures["problem"]
        assert figures.items() <= found.items()


def test_memory_is_plotted_where_it_is_known(contest):
    bare = tuple(replace(item, peak_bytes=None) for item in contest.measurements)
    for measurements, n_frames in (contest.measurements, 2), (bare, 1):
        plot = contest_plot(replace(contest, measurements=measurements))
        assert len(re.findall('id="[^"]*axes_[0-9]+"', plot.svg)) == n_frames


def test_csv_and_markdown_have_a_line_for_each_setting(contest):
    result = BenchResult(
        options=BenchOptions(),
        machine={"system": "Linux", "processor": "x86_64", "processors": 2, "python": "3.11.7"},
        versions={"texbake": "0.1.0", "Blender": "5.0.1", "xatlas": "0.0.11"},
        missing={"pymeshlab": "No module named 'pymeshlab'"},
        contests=(contest,),
    )
    rows = list(csv.DictReader(io.StringIO(result.to_csv())))
    assert len(rows) == 6
    assert rows[3]["program"] == "Blender" and rows[3]["version"] == "5.0.1"
    assert float(rows[3]["seconds_median"]) == 10.0 and rows[3]["on_front"] == "0"
    assert rows[0]["charts"] == "2.0" and rows[0]["peak_bytes"] == "50000000"
    text = markdown(result)
    assert "2 processors" in text and "Not installed: pymeshlab." in text
    lines = [line for line in text.splitlines() if line.startswith("| sphere")]
    assert len(lines) == 3
    assert "| Blender | smart | 7.9% | 10 s (9 s to 12 s) | 300 MB | fast |" in lines[0]
    assert lines[0].endswith("| 10 |") and "| none |" in lines[1]
    assert len({line.count("|") for line in text.splitlines() if line.startswith("|")}) == 1
    report = result.to_json()["contests"][0]
    assert report["left_out"] == [
        {"program": "trimesh", "setting": "default", "reason": "exit code 1"}
    ]
    assert [item["on_front"] for item in report["settings"]] == [True, True, False, False, True,
                                                                 True]  # fmt: skip
