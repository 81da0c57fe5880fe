"""Every command of the documentation runs, and every link of it leads somewhere."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from texbake_cli.main import texbake as command_line

import texbake
from tests.building.conftest import Inline
from texbake.mapping.corner_uvs import selected

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
try:
    import commands
    import reference
finally:
    sys.path.remove(str(DOCS))

PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "README.md"])
MADE = reference.pages()
WITH_COMMANDS = [page for page in PAGES if commands.commands_of(page)]
LONGEST_SIDE = 128  # texels or pixels: what a page asks for is made smaller here
N_TRIANGLES = 4000
READS_SIZE = {"bench", "cubemap", "info", "pack-textures"}  # without it, that of the input
NEVER_ENDS = {"watch"}
MEASURES = {"bench", "study"}
RUN_BY_GOLDENS = "samples/pipeline.toml"

SCENE = """
[camera]
view = [30, 20]
[[lights]]
kind = "directional"
direction = [-1, -2, -1]
[[objects]]
shape = "sphere"
resolution = [24, 12]
material = {base_color = {procedure = "checker", space = "uv", scale = 8}}
"""


def name_of(page):
    return page.relative_to(ROOT).as_posix()


@pytest.fixture(scope="session")
def world(tmp_path_factory):
    """Files that pages take for granted: a scan, low-poly meshes, images, scenes."""
    folder = tmp_path_factory.mktemp("docs")
    high = texbake.make("torus", resolution=(120, 60))
    low = texbake.make("torus", resolution=(16, 10))
    low = low.replace(uvs=None, uv_faces=None)
    low_uv = texbake.unwrap(low, size=128, quality="fast", padding=4)
    colors = 0.5 + 0.5 * np.sin(3 * high.positions)
    texbake.write_mesh(high, folder / "scan.ply")
    texbake.write_mesh(low, folder / "low.obj")
    for name in "low_uv.obj", "lod1.obj", "lod2.obj":
        texbake.write_mesh(low_uv, folder / name)
    texbake.write_mesh(selected(low, np.arange(low.n_faces) < 10), folder / "face.obj")
    ends = low.positions[low.faces[0, :2]]
    corners = "".join("v {} {} {}\n".format(*end) for end in ends.tolist())
    (folder / "seams.obj").write_text(corners + "l 1 2\n")
    for part, kind in (("high", high), ("low", low_uv)):
        mesh = kind.replace(
            group_names=(f"ring_{part}",), face_groups=np.zeros(kind.n_faces, dtype=np.int32)
        )
        texbake.write_mesh(mesh, folder / f"parts_{part}.obj")
    rows, columns = np.mgrid[0:32, 0:64] / 64
    picture = np.stack([columns, rows, 0.5 + 0.5 * np.sin(20 * rows * columns)], axis=-1)
    for name in "photo.png", "paint.png", "a.png", "b.png", "wood.png":
        texbake.write_image(picture, folder / name, color=True, bits=8)
    for name in "skew.png", "offset.png":
        texbake.write_image(picture[..., :1], folder / name, color=False, bits=8)
    roughness = np.full((LONGEST_SIDE, LONGEST_SIDE, 1), 0.4)
    texbake.write_image(roughness, folder / "roughness.png", color=False, bits=8)
    texbake.write_image(picture.astype(np.float32), folder / "studio.hdr", color=False)
    baked = texbake.bake(
        high, low_uv, texbake.BakeOptions(maps=("normal", "displacement"), size=64)
    )
    baked.maps["normal"].write(folder / "normal.png")
    baked.maps["displacement"].write(folder / "height.exr")
    colored = high.replace(colors=colors)
    texbake.write_mesh(colored, folder / "scan.glb", base_color=folder / "photo.png")
    for name in "scene.toml", "room.toml":
        (folder / name).write_text(SCENE)
    for name in "scans/a.ply", "hero/hero_v12.ply":
        (folder / name).parent.mkdir()
        texbake.write_mesh(high, folder / name)
    (folder / "studio.toml").write_text(first_toml(DOCS / "how-to" / "build.md"))
    shutil.copytree(ROOT / "samples", folder / "samples", ignore=shutil.ignore_patterns("gallery*"))
    shutil.copytree(ROOT / "samples" / "scenes", folder / "scenes")
    return folder


def first_toml(page):
    found = re.search(r"^```toml\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    return found[1]


def smaller(words):
    """Return a command line with sizes of at most LONGEST_SIDE, and one task of a study."""
    line = list(words)
    for i, word in enumerate(line[:-1]):
        if word == "--size":
            sides = [min(int(side), LONGEST_SIDE) for side in line[i + 1].split("x")]
            line[i + 1] = "x".join(map(str, sides))
        if word == "--triangles":
            line[i + 1] = str(min(int(line[i + 1]), N_TRIANGLES))
    if "--size" not in line and line[0] not in READS_SIZE:
        command = command_line.get_command(click.Context(command_line), line[0])
        if any(parameter.name == "size" for parameter in command.params):
            line += ["--size", str(LONGEST_SIDE)]
    if line[0] == "remesh":
        line += ["--resolution", "32"]
    if line[0] == "demo" and "--triangles" not in line:
        line += ["--triangles", str(N_TRIANGLES), "--faces", "100"]
    if line[0] == "study" and "--knob" not in line:
        line += ["--knob", "noise", "--repeats", "1", "--seconds", "0"]
    if line[0] == "bench":
        task = ["--task", "simplify"] if "--task" not in line else []
        line += ["--quick", "--repeats", "1", "--program", "texbake", "--case", "sphere", *task]
    if line[0] == "lighten":
        line += ["--faces", "500"] * ("--faces" not in line)
        line += ["--views", "1"] * ("--min-psnr" not in line)
    return line


def kind_of(words):
    """A command line without its numbers and names of files; of measurements, the command."""
    if words[0] in MEASURES:
        return (words[0],)
    return tuple("" if re.search(r"[\d./]", word) else word for word in words)


def needed_by(later, words):
    outputs = [words[i + 1] for i, word in enumerate(words[:-1]) if word == "-o"]
    found = tuple(outputs or [words[0]])
    return any(word.startswith(found) for line in later for word in line[2:])


RAN: set[tuple[str, ...]] = set()  # kinds of lines, on any page


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=name_of)
def test_every_command_runs(page, world, tmp_path, monkeypatch, small_pictures):
    """Commands that differ from an earlier one only in numbers and file names are only parsed."""
    monkeypatch.setattr("texbake.building.build.LocalWorkers", lambda *_: Inline())
    folder = tmp_path / "reader"
    shutil.copytree(world, folder, copy_function=os.link)
    monkeypatch.chdir(folder)
    for name, text in commands.files_of(page).items():
        Path(name).write_text(text.replace('do = "page"', 'do = "page"\nsize = 64'), "utf-8")
    lines = commands.commands_of(page)
    for at, (program, *words) in enumerate(lines):
        if program == "mkdir":
            Path(words[0]).mkdir(exist_ok=True)
            continue
        kind = kind_of(words)
        is_known = kind in RAN and not needed_by(lines[at + 1 :], words)
        if words[0] in NEVER_ENDS or is_known or RUN_BY_GOLDENS in words:
            command = command_line.get_command(click.Context(command_line), words[0])
            command.make_context(words[0], words[1:])  # parses and checks
            continue
        RAN.add(kind)
        with pytest.raises(SystemExit) as stop:
            command_line([*smaller(words), "--quiet"], prog_name="texbake")
        # A check that finds errors exits with 1, which is what it is for.
        assert stop.value.code in ({0, 1} if words[0] == "check" else {0, None}), words


LINK = re.compile(r"!?\[[^]]*\]\(([^)#\s]*)(#[^)\s]*)?\)")


def anchors_of(page):
    """Anchors of a page's headings, as MkDocs and GitHub make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    plain = (re.sub(r"[^\w\s-]", "", heading.lower()).strip() for heading in headings)
    return {re.sub(r"[\s]+", "-", heading) for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_somewhere(page):
    broken = []
    for target, anchor in LINK.findall(page.read_text("utf-8")):
        if "://" in target or target.startswith("mailto:"):
            continue
        path = page if not target else (page.parent / target)
        if not path.exists():
            broken.append(target)
        elif anchor and path.suffix == ".md" and anchor[1:] not in anchors_of(path):
            broken.append(target + anchor)
    assert not broken


def test_tutorials_show_pictures_that_their_commands_draw():
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        for name in commands.pictures_of(page):
            assert (DOCS / "images" / page.stem / f"{name}.png").exists()
            assert any(
                f"{name}.png" in word or name in word
                for line in commands.commands_of(page)
                for word in line
            )


@pytest.mark.parametrize("page", MADE, ids=name_of)
def test_the_reference_is_what_the_program_says(page):
    assert page.read_text("utf-8") == MADE[page], "run: python docs/reference.py"


def test_the_site_is_built_without_a_warning(tmp_path):
    command = [sys.executable, "-P", "-m", "mkdocs", "build", "--strict", "--quiet"]
    done = subprocess.run(
        [*command, "-f", "docs/mkdocs.yml", "-d", tmp_path], cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "reference" / "commands" / "index.html").exists()
