"""Files that mesh files name are part of what a step depends on."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from texbake.pipeline.building.companions import companions

OBJ = "mtllib my stuff.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
MTL = "newmtl a\nKd 1 0 0\nmap_Kd -s 1 1 1 my wood.png\nbump -bm 0.5 gone.png\n"
STEPS = '[steps.r]\ndo = "repair"\nmesh = "high"\n'


def test_those_of_an_obj_file(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    assert companions(tmp_path / "a.obj") == [tmp_path / "my stuff.mtl"]
    (tmp_path / "my stuff.mtl").write_text(MTL)
    (tmp_path / "my wood.png").write_text("x")
    names = [path.name for path in companions(tmp_path / "my stuff.mtl")]
    assert names == ["my wood.png", "gone.png"]


def test_those_of_a_gltf_file(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(
        '{"buffers": [{"uri": "a%20b.bin"}, {"uri": "data:;base64,AA"}],'
        ' "images": [{"uri": "c.png"}]}'
    )
    assert [path.name for path in companions(tmp_path / "a.gltf")] == ["a b.bin", "c.png"]
    (tmp_path / "b.gltf").write_text("{")
    assert companions(tmp_path / "b.gltf") == []
    assert companions(tmp_path / "nothing.obj") == []


@pytest.mark.parametrize("name", ["my stuff.mtl", "my wood.png", "gone.png"])
def test_a_change_in_one_builds_again(
    name: str, tmp_path: Path, write: Any, run: Callable[..., Any]
) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my stuff.mtl").write_text(MTL)
    (tmp_path / "my wood.png").write_text("x")
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    assert run(path)[1] == ["a.r"]
    assert run(path)[1] == []
    with (tmp_path / name).open("a") as file:
        file.write("\n# more")
    assert run(path)[1] == ["a.r"]
    assert run(path)[1] == []


def test_what_a_changed_material_names_counts_from_then_on(
    tmp_path: Path, write: Any, run: Callable[..., Any]
) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my stuff.mtl").write_text("newmtl a\n")
    path = write('[[assets]]\ninputs.high = "a.obj"\n', STEPS)
    time.sleep(0.1)  # beyond a tick of the clock, so that it is remembered
    run(path)
    (tmp_path / "my stuff.mtl").write_text(MTL)
    run(path)
    (tmp_path / "my wood.png").write_text("new")
    assert run(path)[1] == ["a.r"]
