"""JSON and CSV hold what was measured, under fixed names."""

import csv
import io
import json

import pytest

from texbake.errors import MeshError, OptionError
from texbake.mesh.shapes import cube, plane
from texbake.study.findings import findings, spread
from texbake.study.knob import Evaluation, Knob, Setting
from texbake.study.options import KNOB_NAMES, StudyOptions
from texbake.study.result import CSV_COLUMNS, KnobResult, Measurement
from texbake.study.study import run_study
from texbake.study.write import write_study


def measured(label, seconds, error, problem=""):
    setting = Setting(label, None, problem=problem)
    return Measurement(setting, Evaluation(error), tuple(seconds), 1000)


def result_of(*measurements):
    knob = Knob("k", "K", "", "error", "°", "angle", prepare=lambda case: None)
    return KnobResult(knob, "s", "converged", "", measurements)


def test_json_has_its_schema(quick_study):
    report = json.loads(json.dumps(quick_study.to_json(), allow_nan=False))
    assert report["schema"] == "texbake-study-1"
    assert [item["knob"] for item in report["knobs"]] == list(KNOB_NAMES)
    for item in report["knobs"]:
        assert {"title", "error", "unit", "kind", "subject", "truth", "truth_text"} <= set(item)
        labels = [setting["setting"] for setting in item["settings"]]
        assert set(item["front"]) <= set(labels)
        assert set(item["stops_paying"]) <= set(item["front"])
        for setting in item["settings"]:
            assert set(setting) == {
                "setting", "series", "problem", "error", "figures", "seconds", "seconds_median",
                "seconds_min", "seconds_max", "peak_bytes",
            }  # fmt: skip
            assert setting["seconds_min"] <= setting["seconds_median"] <= setting["seconds_max"]


def test_csv_has_a_line_a_setting_with_the_same_figures(quick_study):
    rows = list(csv.DictReader(io.StringIO(quick_study.to_csv())))
    report = quick_study.to_json()
    settings = [(k["knob"], s) for k in report["knobs"] for s in k["settings"]]
    assert tuple(rows[0])[: len(CSV_COLUMNS)] == CSV_COLUMNS
    assert len(rows) == len(settings)
    for row, (knob, setting) in zip(rows, settings, strict=True):
        assert (row["knob"], row["setting"]) == (knob, setting["setting"])
        assert float(row["error"]) == setting["error"]
        assert float(row["seconds_median"]) == setting["seconds_median"]
        assert int(row["runs"]) == len(setting["seconds"])
        figures = {name: row[name] for name in list(row)[len(CSV_COLUMNS) :] if row[name] != ""}
        finite = {name: x for name, x in setting["figures"].items() if x is not None}
        assert {name: float(x) for name, x in figures.items()} == finite
    assert {name for _, s in settings for name in s["figures"]} == set(rows[0]) - set(CSV_COLUMNS)


def test_settings_compete_only_within_their_problem():
    result = result_of(
        measured("a", [1.0], 1.0, "easy"), measured("b", [2.0], 0.5, "easy"),
        measured("c", [3.0], 9.0, "hard"), measured("d", [4.0], 20.0, "hard"),
    )  # fmt: skip
    assert result.fronts == [[0, 1], [2]]
    assert result.knees == [1, 2]


def test_errors_are_the_same_in_every_study_and_for_any_threads(quick_study):
    names = ("bump-gradient", "interpolation", "noise", "texture-size")
    again = run_study(options=StudyOptions(quick=True, repeats=1, knobs=names, threads=1))
    before = {item.knob.name: item for item in quick_study.knobs}
    for item in again.knobs:
        assert [m.error for m in item.measurements] == [
            m.error for m in before[item.knob.name].measurements
        ]


def test_a_knob_that_does_not_fit_is_left_out_and_told(tmp_path):
    names = ("low-poly", "noise")
    result = run_study(cube(), cube(), options=StudyOptions(quick=True, repeats=1, knobs=names))
    assert [item.knob.name for item in result.knobs] == ["noise"]
    assert list(result.skipped) == ["low-poly"]
    assert "has 12 triangles" in result.to_json()["skipped"]["low-poly"]
    page = write_study(result, tmp_path)[0].read_text(encoding="utf-8")
    assert "low-poly is left out: " in page and "has 12 triangles" in page


def test_a_study_of_nothing_that_fits_is_one_clear_error():
    with pytest.raises(MeshError, match=r"^study low-poly: .* has 12 triangles, too few"):
        run_study(cube(), cube(), options=StudyOptions(quick=True, knobs=("low-poly",)))


def test_half_a_pair_is_refused():
    with pytest.raises(OptionError, match="a high-poly and a low-poly mesh"):
        run_study(plane())


@pytest.mark.parametrize(
    "wrong",
    [{"knobs": ("sharpness",)}, {"knobs": ()}, {"repeats": 0}, {"seconds": -1.0}, {"threads": 0}],
)
def test_options_that_make_no_study_are_refused(wrong):
    with pytest.raises(OptionError):
        StudyOptions(**wrong)


def test_knobs_are_studied_once_and_in_the_order_of_the_list():
    options = StudyOptions(knobs=("noise", "samples", "noise"))
    assert options.ordered_knobs == ("samples", "noise")


def test_no_time_lies_farther_from_the_median_than_is_told():
    item = measured("a", [1.0, 1.0, 3.0], 5.0)
    assert spread(item) == 2.0
    assert "within ±200 % of their median" in findings(result_of(item))[-1]
