"""Remembered digests of files are used only while they are intact."""

import json
from pathlib import Path
from typing import Any

import pytest

from texbake.building.digests import Digests, file_digest
from texbake.building.locations import file_signature


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "a.ply"
    path.write_text("x")
    return path


@pytest.fixture
def kept(tmp_path: Path, mesh: Path) -> Path:
    path = tmp_path / "digests.json"
    digests = Digests(path)
    digests.remember(str(mesh), file_signature(mesh), "what was remembered")
    digests.save()
    return path


def test_remembered_digests_are_used(mesh: Path, kept: Path) -> None:
    assert Digests(kept).digest(str(mesh)) == "what was remembered"
    assert Digests(kept, trusting=False).digest(str(mesh)) == file_digest(mesh)


def test_a_flipped_bit_discards_the_digests(mesh: Path, kept: Path) -> None:
    kept.write_text(kept.read_text().replace("was remembered", "was remembereD"))
    assert Digests(kept).digest(str(mesh)) == file_digest(mesh)


def test_digests_of_results_that_no_step_has_are_forgotten(write: Any, run: Any) -> None:
    """Otherwise `watch` would remember, read and write one more set of them with each save."""
    path: Path = write()
    run(path)
    kept = path.parent / "build" / ".texbake" / "digests.json"
    n_files = len(json.loads(kept.read_bytes())["files"])
    text = path.read_text()
    for radius in (2.5, 2.6, 2.7):
        path.write_text(text.replace("radius = 2.0", f"radius = {radius}"))
        _, steps = run(path)
        assert len(steps) == 3
        assert len(json.loads(kept.read_bytes())["files"]) == n_files
    run(path, only=("ball",))
    assert len(json.loads(kept.read_bytes())["files"]) == n_files
    path.write_text(text)
    result, steps = run(path)
    assert result.ok and not steps
