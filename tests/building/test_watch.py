"""Saved files are built again, once they are complete."""

import pytest

from texbake.building import build as module
from texbake.building.build import watch
from texbake.building.report import BuildResult
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import uv_sphere

STEPS = '[steps.r]\ndo = "repair"\nmesh = "high"\n'


@pytest.fixture(autouse=True)
def crew(inline, monkeypatch):
    """The workers of every build, in this process."""
    made = inline()
    monkeypatch.setattr(module, "local_workers", lambda options: made)
    return made


def test_saved_files_are_built_again(write, crew):
    path = write()
    text = path.read_text()
    edits = [
        text.replace("padding = 1", "padding = 2"),
        text.replace("padding = 1", "paddng = 2"),  # a typing error, which is reported
        text.replace("radius = 2.0", "radius = 2.5"),
    ]
    seen = []
    counts = []

    def built(result):
        seen.append(result)
        counts.append(len(crew.tasks))
        if edits:
            path.write_text(edits.pop(0))

    watch(path, built=built, until=lambda: len(seen) == 4, poll_seconds=0.01)
    assert [isinstance(result, BuildResult) and result.ok for result in seen] == [
        True, True, False, True,
    ]  # fmt: skip
    assert "steps.maps.paddng: unknown key; did you mean 'padding'?" in str(seen[2])
    assert counts == [6, 8, 8, 11]


def test_an_input_that_is_still_being_written_is_waited_for(write, monkeypatch, tmp_path):
    write_mesh(uv_sphere(4, 8), tmp_path / "a.ply")
    whole = (tmp_path / "a.ply").read_bytes()
    path = write('[[assets]]\ninputs.high = "*.ply"\n', STEPS)
    seen = []
    pieces = [whole[:100], whole[:200], whole[:300], whole + b""]
    monkeypatch.setattr(
        module.time,
        "sleep",
        lambda seconds: pieces and (tmp_path / "a.ply").write_bytes(pieces.pop(0)),
    )
    watch(path, built=seen.append, until=lambda: len(seen) == 2)
    assert all(isinstance(result, BuildResult) and result.ok for result in seen)


def test_a_file_that_is_saved_without_a_pause_is_built(write, monkeypatch, tmp_path):
    path = write('[[assets]]\ninputs.high = "a.ply"\n', STEPS)
    saves = 0

    def save(seconds=0.0):
        nonlocal saves
        saves += 1
        write_mesh(
            uv_sphere(4, 8, lambda theta, phi: 1.0 + saves + 0.0 * theta), tmp_path / "a.ply"
        )

    save()
    monkeypatch.setattr(module.time, "sleep", save)
    seen = []
    watch(path, built=seen.append, until=lambda: len(seen) == 3 or saves > 100)
    assert all(isinstance(result, BuildResult) and result.ok for result in seen)
    assert len(seen) == 3


def test_a_saved_file_that_an_input_names_is_built_again(write, tmp_path):
    write_mesh(uv_sphere(4, 8), tmp_path / "a.obj")
    mesh = (tmp_path / "a.obj").read_bytes()
    (tmp_path / "a.obj").write_bytes(b"mtllib a.mtl\n" + mesh)
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    seen = []

    def built(result):
        seen.append(result)
        (tmp_path / "a.mtl").write_text(f"newmtl m{len(seen)}\n")

    watch(path, built=built, until=lambda: len(seen) == 2, poll_seconds=0.01)
    assert [len(result.assets) for result in seen if result.ok] == [1, 1]
