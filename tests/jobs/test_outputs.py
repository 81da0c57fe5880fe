"""Reports as JSON."""

import json
import math
from pathlib import Path

import pytest

from texbake import FileError
from texbake.jobs.outputs import write_report


def test_a_report_comes_back_as_it_was(tmp_path: Path) -> None:
    report = {"a": [1, 2.5, None], "b": {"c": True, "d": "é"}, "e": (1, 2)}
    write_report(tmp_path / "r.json", {**report, "f": Path("g/h.png")})
    read = json.loads((tmp_path / "r.json").read_text("utf-8"))
    assert read == {**report, "e": [1, 2], "f": "g/h.png"}


def test_numbers_that_json_lacks_are_null(tmp_path: Path) -> None:
    write_report(tmp_path / "r.json", {"psnr": math.inf, "deep": [{"mean": math.nan}]})
    text = (tmp_path / "r.json").read_text()
    assert json.loads(text) == {"psnr": None, "deep": [{"mean": None}]}
    assert "NaN" not in text


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    path.write_text("earlier")
    with pytest.raises(TypeError):
        write_report(path, {"what": object()})
    assert path.read_text() == "earlier"
    with pytest.raises(FileError, match="there is no folder"):
        write_report(tmp_path / "no" / "r.json", {})
