"""The files of a command appear together: one that is interrupted keeps all of the older ones."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from texbake_cli.main import texbake

from texbake import write_image

Invoke = Callable[..., Result]

# Commands that write several files. Some prepare theirs with commands before them.
BAKED = "bake high.ply low.obj -o maps --maps normal,displacement --size 32 --padding 1"
LINES = {
    "bake": (f"{BAKED} --hits hits.npz --report r.json --miss-map m.png",),
    "bake-normals": (
        "bake-normals high.ply low.obj -o n.png --size 32 --padding 1 --miss-map m.png"
        " --report r.json",
    ),
    "bake parts": (
        "make plane -o a_high.obj",
        "make plane -o a_low.obj",
        "bake a_high.obj a_low.obj -o maps --match-by-name --maps normal,ao --size 16"
        " --report r.json",
    ),
    "bake-lightmap": ("bake-lightmap room.toml -o light --size 32",),
    "bake-texture": ("bake-texture low.obj -o t.png --procedure noise --size 16 --report r.json",),
    "check": ("check low.obj --size 64 --report r.json --layout l.png",),
    "compare": ("compare high.ply low.obj --size 48 --report r.json",),
    "convert": ("unwrap low.obj -o two.glb --set 1 --size 64", "convert two.glb two.obj"),
    "cubemap": ("cubemap sky.png -o faces --size 8",),
    "demo": ("demo --triangles 2000 --faces 100 --size 64",),
    "export": (BAKED, "export low.obj --to unreal --map normal=maps/normal.png -o asset"),
    "lighten": ("lighten high.ply -o light.glb --faces 400 --size 64 --views 1 --report r.json",),
    "mipmap": ("mipmap gray.png -o levels",),
    "remap": (f"{BAKED} --hits hits.npz", "remap hits.npz -o more --maps normal,displacement"),
    "remesh": ("remesh high.ply -o closed.ply --resolution 16 --report r.json",),
    "run": ("run high.ply -o job --faces 100 --size 64 --padding 2 --html page.html",),
    "simplify": ("simplify high.ply -o low_1.obj --faces 200 --report r.json",),
    "split-channels": ("split-channels rgb.png -o apart",),
    "unwrap": (
        "unwrap low.obj -o out.glb --size 64 --padding 2 --layout l.png --checker c.png"
        " --report r.json",
    ),
    "unwrap several": ("unwrap low.obj high.ply -o both --quality fast --tiles 2 --layout l.svg",),
}

ROOM = """
[[lights]]
kind = "directional"
direction = [0, 0, -1]

[[objects]]
name = "near"
mesh = "low.obj"
material = { shading = "lambert" }

[[objects]]
name = "far"
mesh = "low.obj"
material = { shading = "lambert" }
"""


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("name", LINES)
def test_an_interrupted_command_keeps_the_older_files(
    name: str, workplace: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_image(np.linspace(0, 1, 256).reshape(16, 16, 1), "gray.png", bits=16)
    write_image(np.full((8, 8, 3), 0.5), "rgb.png")
    write_image(np.full((8, 16, 3), 0.5), "sky.png", color=True)
    Path("room.toml").write_text(ROOM, encoding="utf-8")
    *before, line = LINES[name]
    for prepare in before:
        invoke(prepare)
    inputs = contents(workplace)
    invoke(line)
    for file in sorted(contents(workplace).keys() - inputs.keys()):
        (workplace / file).write_bytes(b"older")
    older = contents(workplace)
    assert sum(content == b"older" for content in older.values()) > 1

    opened = os.open
    made: list[str] = []
    last = 0

    def open_file(path: str, flags: int, *rest: int) -> int:
        if flags & os.O_EXCL and Path(path).parent.is_relative_to(workplace):
            made.append(path)
            if len(made) == last:
                raise KeyboardInterrupt
        return opened(path, flags, *rest)

    monkeypatch.setattr("texbake.files.os.open", open_file)
    CliRunner().invoke(texbake, line.split())
    n_files = len(made)
    for file, content in older.items():
        if content == b"older":
            assert (workplace / file).read_bytes() != content
            (workplace / file).write_bytes(content)
    for last in {2, n_files}:
        made.clear()
        stopped = CliRunner().invoke(texbake, line.split())
        assert stopped.exit_code != 0 and len(made) == last
        assert contents(workplace) == older
