"""Wrong input: one clear line, the right exit code, no partial file, nothing lost."""

import os
import resource
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import read_mesh, write_mesh
from texbake.mesh.shapes import icosphere, uv_sphere

Invoke = Callable[..., Result]
Run = Callable[..., subprocess.CompletedProcess[str]]

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

# Text of files that are wrong, by their names.
WRONG_FILES = {
    "words.obj": "It was a dark and stormy night.\n" * 3,
    "words.ply": "It was a dark and stormy night.\n" * 3,
    "words.glb": "It was a dark and stormy night.\n" * 3,
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "infinite.obj": "v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "index.obj": TRIANGLE + "f 1 2 7\n",
    "points.obj": TRIANGLE,
    "nothing.ply": "",
    "mesh.xyz": TRIANGLE,
}


@pytest.fixture
def snapshot(workplace: Path) -> Callable[[], dict[str, bytes]]:
    """Every file of the current folder with its content."""
    (workplace / "out.png").write_bytes(b"what was there")
    for name, text in WRONG_FILES.items():
        (workplace / name).write_text(text)
    for name, whole in ("cut.ply", workplace / "high.ply"), ("cut.glb", workplace / "whole.glb"):
        if name == "cut.glb":
            write_mesh(icosphere(2), whole)
        content = whole.read_bytes()
        (workplace / name).write_bytes(content[: len(content) // 2])
    write_mesh(icosphere(1), workplace / "bare.obj")
    ball = uv_sphere(8, 8)
    assert ball.uvs is not None
    write_mesh(ball.replace(uvs=np.zeros_like(ball.uvs)), workplace / "collapsed.obj")

    def snapshot() -> dict[str, bytes]:
        return {
            str(path.relative_to(workplace)): path.read_bytes()
            for path in workplace.rglob("*")
            if path.is_file()
        }

    return snapshot


def names_in(folder: Path) -> list[str]:
    """Every name, hidden ones as well, as a half-written file's would be."""
    return sorted(path.name for path in folder.iterdir())


BAKE = "bake-normals high.ply low.obj -o out.png --size 32"


@pytest.mark.parametrize(
    ("line", "exit_code", "message"),
    [
        # files
        ("info no_such.ply", 1, "no_such.ply: there is no such file"),
        ("info .", 1, "it is a folder"),
        ("info words.obj", 1, "words.obj"),
        ("info words.ply", 1, "words.ply"),
        ("info words.glb", 1, "words.glb"),
        ("info cut.ply", 1, "cut.ply"),
        ("info cut.glb", 1, "cut.glb"),
        ("info nan.obj", 1, "nan.obj"),
        ("info infinite.obj", 1, "infinite.obj"),
        ("info index.obj", 1, "index.obj"),
        ("info points.obj", 1, "points.obj: it has no faces"),
        ("info nothing.ply", 1, "nothing.ply: the file is empty"),
        ("info mesh.xyz", 1, "'.xyz'"),
        ("preview low.obj --normal-map no_such.png -o p.png", 1, "no_such.png"),
        ("preview low.obj --normal-map words.obj -o p.png", 1, "words.obj"),
        # unsuitable meshes
        ("bake-normals high.ply bare.obj -o out.png", 1, "bare.obj: it has no texture coord"),
        ("bake-normals high.ply collapsed.obj -o out.png", 1, "collapsed.obj"),
        (f"{BAKE} --cage bare.obj", 1, "bare.obj"),
        ("preview bare.obj --normal-map out.png -o p.png", 1, ""),
        # numbers
        (f"{BAKE} --front -1", 2, "front: -1.0"),
        (f"{BAKE} --back -0.5", 2, "back: -0.5"),
        (f"{BAKE} --front nan", 2, "front: nan"),
        (f"{BAKE} --front 0 --back 0", 2, "--front, --back"),
        (f"{BAKE} --padding -1", 2, "padding: -1"),
        (f"{BAKE} --samples 3", 2, "samples: 3"),
        (f"{BAKE} --bits 12", 2, "bits: 12"),
        (f"{BAKE} --threads 0", 2, "threads: 0"),
        (f"{BAKE} --fail-on-miss 101", 2, "fail-on-miss: 101"),
        ("bake-normals high.ply low.obj -o out.png --size 0", 2, "size: 0"),
        ("bake-normals high.ply low.obj -o out.png --size 100000", 2, "size: 100000"),
        ("bake-normals high.ply low.obj -o out.png --size 64x0", 2, "size: 0"),
        ("bake-displacement high.ply low.obj -o out.png --scale 0", 2, "scale: 0"),
        ("unwrap low.obj -o out.obj --size 0", 2, "size: 0"),
        ("unwrap low.obj -o out.obj --size 100000", 2, "size: 100000"),
        ("unwrap low.obj -o out.obj --method planar --axis 0,0,0", 2, "axis: (0.0, 0.0, 0.0)"),
        ("unwrap low.obj -o out.obj --method planar --normal nan,0,1", 2, "normal: (nan"),
        ("unwrap low.obj -o out.obj --method planar --axis x --normal 0,0,1", 2, "one of them"),
        ("unwrap low.obj -o out.obj --method cylindrical --theta 30,30", 2, "theta: (30.0, 30.0)"),
        ("unwrap low.obj -o out.obj --method spherical --caps", 2, "caps: the method spherical"),
        ("unwrap low.obj -o out.obj --method two-part --via reflection", 2, "eye: a reflection"),
        ("unwrap low.obj -o out.obj --method mercator", 2, "mercator"),
        ("unwrap low.obj -o out.obj --warp melt", 2, "warp: melt is not one of"),
        ("unwrap low.obj -o out.obj --warp bulge:2", 2, "warp: a bulge of 2.0"),
        ("unwrap low.obj -o out.obj --only lid", 2, "only: low.obj has no"),
        ("unwrap low.obj -o out.obj --tiles 0", 2, "tiles: 0"),
        ("unwrap low.obj -o out.obj --max-stretch 1", 2, "--max-stretch: 1.0"),
        ("unwrap low.obj -o out.obj --heat", 2, "heat: it colors the layout"),
        ("unwrap low.obj -o out.obj --size 64 --texel-density 4000", 1, "low.obj: "),
        ("unwrap bare.obj -o out.obj --keep", 1, "bare.obj: it has no texture coord"),
        ("unwrap bare.obj -o out.obj --method parametric", 1, "bare.obj: it has no texture coord"),
        ("unwrap low.obj low.obj -o both", 2, "two outputs"),
        ("unwrap low.obj high.ply -o low.obj", 1, "is a file"),
        ("unwrap low.obj high.ply -o both --method planar", 2, "one mesh at a time"),
        ("unwrap low.obj -o out.obj --method projector --matrix words.txt", 1, "words.txt"),
        ("preview low.obj -o out.png --size 100000", 2, "100000"),
        ("preview low.obj -o out.png --view 10,20,-1", 2, "view"),
        ("lighten high.ply -o out.obj", 1, "use .glb"),
        ("lighten high.ply -o out.glb --images gif", 2, "gif"),
        ("remesh high.ply -o out.obj --resolution 2", 2, "resolution: 2"),
        ("remesh high.ply -o out.obj --close wide", 2, "close: 'wide' is not a width"),
        ("simplify high.ply -o out.obj --faces 1", 2, "faces: 1"),
        ("simplify high.ply -o out.obj --faces -5", 2, "faces: -5"),
        ("run high.ply -o job --faces 0", 2, "faces: 0"),
        ("demo --triangles 3", 2, "triangles: 3"),
        # outputs
        ("bake-normals high.ply low.obj -o out.webp", 1, "'.webp'"),
        ("bake-normals high.ply low.obj -o out", 1, "out"),
        (f"{BAKE} --bits 32", 2, "PNG holds 8 or 16"),
        ("bake-normals high.ply low.obj -o out.tga --bits 16", 2, "TGA holds 8"),
        ("bake-normals high.ply low.obj -o nowhere/out.png", 1, "there is no folder"),
        (f"{BAKE} --report nowhere/r.json", 1, "there is no folder"),
        (f"{BAKE} --miss-map out.png", 2, "two outputs"),
        ("bake high.ply low.obj -o low.obj", 2, "is a file"),
        ("simplify high.ply -o out.gltf --faces 100", 1, "'.gltf'"),
        ("unwrap low.obj -o out.png", 1, "'.png'"),
        ("run high.ply -o low.obj/job --faces 100", 1, "is a file"),
        # rays
        (f"{BAKE} --front 0 --back 1e-9 --fail-on-miss 1", 1, "%"),
    ],
)
def test_one_line_the_exit_code_and_nothing_else(
    snapshot: Callable[[], dict[str, bytes]],
    invoke: Invoke,
    line: str,
    exit_code: int,
    message: str,
) -> None:
    before = snapshot()
    result = invoke(line, exit_code)
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith("texbake")
    assert message in result.stderr
    assert snapshot() == before


def test_outputs_are_checked_before_the_work(
    snapshot: Callable[[], dict[str, bytes]], invoke: Invoke
) -> None:
    # The mesh is wrong too, but that shows only when it is read.
    assert "there is no folder" in invoke("simplify cut.ply -o a/b.obj --faces 9", 1).stderr
    assert "'.gif'" in invoke("bake-normals cut.ply low.obj -o out.gif", 1).stderr
    assert "TGA" in invoke("bake-normals cut.ply low.obj -o o.tga --bits 32", 2).stderr


@pytest.mark.parametrize(
    "line",
    [
        "bake-normals high.ply low.obj --size 32 -o n.png",
        "bake high.ply low.obj --size 32 -o maps",
        "simplify high.ply -o low_1.obj --faces 100",
        "run high.ply -o job --faces 100",
    ],
)
def test_a_folder_that_may_not_be_written_to(
    workplace: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    # Root, who may run the tests, may write anywhere: so the system's answer is simulated.
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    assert "cannot be written to" in invoke(line, 1).stderr


@pytest.mark.parametrize(
    "line",
    [
        "bake-normals high.ply low.obj --size 256 -o there.png",
        "bake-normals high.ply low.obj --size 256 -o there.exr",
        "simplify high.ply --faces 5000 -o there.ply",
        "simplify high.ply --faces 5000 -o there.obj",
        "unwrap low.obj -o there.glb --layout there.png",
    ],
)
def test_a_full_disk_loses_nothing(workplace: Path, run: Run, line: str) -> None:
    def fill_the_disk() -> None:
        # A file may not grow past 4 KiB, as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    # Once without the limit, so that no kernel is left to be compiled, and its code to be cached.
    assert run(line).returncode == 0
    name = line.split("-o ")[1].split()[0]
    Path(name).write_bytes(b"what was there")
    before = names_in(workplace)
    done = run(line, preexec_fn=fill_the_disk)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert f"{name}: cannot be written" in done.stderr
    assert Path(name).read_bytes() == b"what was there"
    assert names_in(workplace) == before


@pytest.mark.parametrize(
    ("number", "exit_code", "message"),
    [
        (signal.SIGINT, 130, "texbake: interrupted\n"),
        (signal.SIGTERM, 143, "texbake: terminated\n"),
    ],
)
def test_a_signal_in_the_middle_loses_nothing(
    workplace: Path, script: Path, number: signal.Signals, exit_code: int, message: str
) -> None:
    Path("there.png").write_bytes(b"what was there")
    before = names_in(workplace)
    # Enough rays that the work would take a minute.
    line = "bake-normals high.ply low.obj --size 4096 --samples 16 -o there.png --progress json"
    process = subprocess.Popen(
        [script, *line.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test runner in the background may have SIGINT ignored, which a child would inherit.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stderr is not None
    for row in process.stderr:
        if '"advanced"' in row:  # in the middle of the rays
            break
    process.send_signal(number)
    start = time.perf_counter()
    output, errors = process.communicate(timeout=60)
    assert time.perf_counter() - start < 10
    assert process.returncode == exit_code
    lines = [row for row in errors.splitlines(keepends=True) if not row.startswith("{")]
    assert lines == [message]
    assert output == ""
    assert Path("there.png").read_bytes() == b"what was there"
    assert names_in(workplace) == before


@pytest.mark.parametrize("words", ["info low.obj", "--help", "--version", "bake --help"])
def test_results_that_cannot_be_printed(workplace: Path, script: Path, words: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [script, *words.split()], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60
        )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line == "texbake: standard output: cannot be written: No space left on device"


def test_inputs_are_read_before_outputs_replace_them(workplace: Path, invoke: Invoke) -> None:
    before = read_mesh("low.obj")
    invoke("unwrap low.obj -o low.obj --size 128")
    after = read_mesh("low.obj")
    np.testing.assert_array_equal(before.positions, after.positions)


def test_no_input_is_overwritten(snapshot: Callable[[], dict[str, bytes]], invoke: Invoke) -> None:
    before = snapshot()
    Path("alias.json").symlink_to("low.obj")
    before["alias.json"] = before["low.obj"]
    for line in (
        "bake-normals high.ply low.obj -o new.png --report low.obj",
        "bake-normals high.ply low.obj -o new.png --report alias.json",
        "unwrap low.obj -o new.obj --report low.obj",
        "simplify high.ply -o new.obj --faces 100 --report high.ply",
        "preview low.obj --normal-map out.png -o out.png",
        "compare high.ply low.obj --normal-map out.png -o out.png",
    ):
        assert "also an input" in invoke(line, exit_code=2).output
        assert snapshot() == before


def test_links_in_a_circle(workplace: Path, invoke: Invoke) -> None:
    Path("round.png").symlink_to("round.png")
    result = invoke("bake-normals high.ply low.obj -o round.png", 1)
    assert "its links form a circle" in result.output


def test_a_closed_standard_output(workplace: Path, script: Path) -> None:
    done = subprocess.run(
        ["sh", "-c", f"'{script}' info low.obj >&-"],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    assert "Traceback" not in done.stderr
