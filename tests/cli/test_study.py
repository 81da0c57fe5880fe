"""`texbake study` through click's runner."""

import json

import pytest
from click.testing import CliRunner
from texbake_cli.commands.study import study

from texbake.errors import OptionError
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import plane
from texbake.study.options import KNOB_NAMES


def test_a_quick_study_of_two_knobs(tmp_path):
    folder = tmp_path / "out"
    done = CliRunner().invoke(
        study,
        ["--quick", "--repeats", "1", "--knob", "noise", "--knob", "bump-gradient", "-o", folder],
        catch_exceptions=False,
    )
    assert done.exit_code == 0
    assert "pays up to" in done.output and "study.html" in done.output
    report = json.loads((folder / "study.json").read_text())
    assert [item["knob"] for item in report["knobs"]] == ["bump-gradient", "noise"]


def test_one_mesh_is_not_a_pair(tmp_path):
    write_mesh(plane(), tmp_path / "high.obj")
    with pytest.raises(OptionError, match="give both, or neither"):
        CliRunner().invoke(
            study, [str(tmp_path / "high.obj"), "-o", str(tmp_path)], catch_exceptions=False
        )


def test_help_names_every_knob_and_an_example():
    text = CliRunner().invoke(study, ["--help"]).output
    assert "Example:" in text and "texbake study --quick" in text
    assert all(name in "".join(text.split()) for name in KNOB_NAMES)


def test_an_unknown_knob_is_wrong_usage():
    done = CliRunner().invoke(study, ["--knob", "sharpness"])
    assert done.exit_code == 2
