"""`texbake info --uv`: what texture coordinates do to a mesh."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from texbake import distortion, read_mesh

Invoke = Callable[..., Result]


@pytest.fixture(autouse=True)
def at_the_workplace(workplace: Path) -> None:
    """Commands of these tests run beside the pair."""


def test_the_figures_of_the_whole_and_of_the_worst(invoke: Invoke) -> None:
    found = distortion(read_mesh("low.obj"), 2048)
    text = invoke("info low.obj --uv --size 2048").stdout
    assert f"stretch L2                   {found.stretch.l2:.4f}" in text
    assert "(4 at best)" in text
    assert f"{found.texel_density:.6g}, varying by" in text
    lines = [line.split() for line in text.splitlines()]
    start = next(i for i, line in enumerate(lines) if line[:1] == ["face"])
    named = [int(line[0]) for line in lines[start + 1 :]]
    assert named == [face.face for face in found.worst_faces]
    charts = next(i for i, line in enumerate(lines) if line[:2] == ["chart", "L2"])
    assert lines[charts + 1][:2] == ["0", f"{found.charts[0].stretch.l2:.4f}"]


def test_json_has_everything(invoke: Invoke) -> None:
    written = json.loads(invoke("info low.obj --uv --json").stdout)
    assert written["n_faces"] == 112
    assert written["distortion"] == distortion(read_mesh("low.obj")).to_json()
    assert "distortion" not in json.loads(invoke("info low.obj --json").stdout)
