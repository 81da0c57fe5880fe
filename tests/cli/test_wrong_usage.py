"""Wrong input and wrong usage: one clear line, the exit code, and every file as it was.

What commands of verbs do alike, such as outputs over inputs and ranges of options, is in
test_verbs.py.
"""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake
from texbake_cli.signals import FAILED, WRONG_USAGE
from writing_commands import contents

from texbake import write_image, write_mesh
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.metadata import SPACE

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
STORY = "It was a dark and stormy night.\n" * 3
LIT = """[[lights]]
kind = "directional"
direction = [0, 0, -1]
[[objects]]
mesh = "MESH"
material = { shading = "lambert" }
"""
TEXTS = {
    "words.obj": STORY,
    "words.ply": STORY,
    "words.glb": STORY,
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "infinite.obj": "v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "index.obj": TRIANGLE + "f 1 2 7\n",
    "points.obj": TRIANGLE,
    "nothing.ply": "",
    "mesh.xyz": TRIANGLE,
    "negative.txt": "0 0\n-1 1\n",
    "hole.txt": "1\n1,2,3\n16\n" + "0 0 0\n" * 16,
    "binary.txt": "32\n\0\1\2\n",
    "front.toml": "position = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 45\n",
    "bad.toml": "position = [0, 0, 4]\ntarget = [0, 0, 0]\nlens = 35\n",
    "room.toml": LIT.replace("MESH", "low.obj"),
    "bare.toml": LIT.replace("MESH", "high.ply"),
    "key.toml": LIT.replace("MESH", "low.obj").replace("shading", "shadng"),
    "model.toml": LIT.replace("MESH", "low.obj").replace("lambert", "gouraud"),
    "file.toml": LIT.replace("MESH", "no.obj"),
    "dark.toml": LIT.replace("MESH", "low.obj").replace("0, 0, -1", "0, 0, 0"),
}


@pytest.fixture(scope="module")
def place(pair, tmp_path_factory):
    """A folder of meshes, images and texts, most of which have a fault."""
    folder = tmp_path_factory.mktemp("wrong")
    for file in pair.iterdir():
        shutil.copy(file, folder)
    for name, text in TEXTS.items():
        (folder / name).write_text(text)
    write_mesh(icosphere(2), folder / "whole.glb")
    for whole, cut in (("high.ply", "cut.ply"), ("whole.glb", "cut.glb")):
        content = (folder / whole).read_bytes()
        (folder / cut).write_bytes(content[: len(content) // 2])
    write_mesh(icosphere(1), folder / "bare.obj")
    ball = uv_sphere(8, 8)
    write_mesh(ball.replace(uvs=np.zeros_like(ball.uvs)), folder / "collapsed.obj")
    sheet = plane()
    write_mesh(sheet, folder / "plane.obj")
    write_mesh(sheet.replace(uvs=2.0 * sheet.uvs), folder / "tiled.obj")
    (folder / "out.png").write_bytes(b"what was there")
    colors = np.random.default_rng(5).integers(0, 256, (12, 24, 3), dtype=np.uint8)
    write_image(colors, folder / "rgb.png")
    write_image(colors[..., 0], folder / "gray.png")
    write_image(np.zeros((2, 2)), folder / "small.png")
    write_image(np.zeros((1, 1, 1)), folder / "dot.png")
    write_image(colors[:, :12], folder / "square.png")
    write_image(np.full((4, 4, 3), 0.5), folder / "world.png", bits=8, metadata={SPACE: "world"})
    return folder


BAKE = "bake-normals high.ply low.obj -o out.png --size 32"
DRAW = "preview low.obj -o p.png --size 96x64"
SCENE = "preview room.toml -o p.png"
PACK = "pack-channels -o x.png --blue 0"
TEXTURE = "bake-texture low.obj -o t.png"
ATLAS = "pack-textures rgb.png gray.png -o a.png"
UNWRAP = "unwrap low.obj -o u.obj"

# Lines of a command that are wrong usage, each with words of its message.
USAGE = {
    "--nonsense": "texbake: no such option",
    "nonsense": "texbake: no such command 'nonsense'",
    "info": "texbake info: missing argument 'MESH'",
    "bake high.ply low.obj": "texbake bake: missing option '-o'",
    "run high.ply -o asset": "texbake run: --faces, --error: neither is given",
    "simplify high.ply -o low.obj": "texbake simplify: --faces, --error: neither is given",
    f"{BAKE} --size huge": "'huge' is not a size such as",
    f"{BAKE} --front nan": "front: nan",
    f"{BAKE} --front 0 --back 0": "--front, --back",
    f"{BAKE} --samples 3": "samples: 3",
    f"{BAKE} --samples some": "samples: some is not one of",
    f"{BAKE} --samples 4 --max-error 1deg": "leave nothing to choose",
    f"{BAKE} --max-error 0.5": "bounds nothing of normal",
    f"{BAKE} --max-error small": "is not an error",
    f"{BAKE} --time-budget later": "is not a duration",
    f"{BAKE} --bits 32": "PNG holds 8 or 16",
    "bake high.ply low.obj -o m --secondary-rays 100": "100 is not a power of two",
    f"{BAKE} --bits 12": "bits: 12",
    f"{BAKE} --size 100000": "size: 100000",
    f"{BAKE} --size 64x0": "size: 0",
    "bake-displacement high.ply low.obj -o d.png --scale 0": "scale: 0",
    "make sphere -o a.obj --resolution 0": "resolution: 0",
    f"{BAKE} --miss-map out.png": "two outputs",
    "bake-normals high.ply low.obj -o out.tga --bits 16": "TGA holds 8",
    "bake-normals cut.ply low.obj -o out.tga --bits 32": "TGA holds 8",
    "bake high.ply low.obj -o low.obj": "is a file",
    "bake high.ply low.obj --maps lightmap -o m": "lightmap is not one of normal,",
    "bake -o m": "HIGH: it is missing",
    "bake high.ply -o m": "LOW: it is missing",
    "bake-lightmap room.toml -o m --front 1": "no such option '--front'",
    "bake-lightmap room.toml -o m --samples adaptive": "'adaptive' is not a valid integer",
    f"{UNWRAP} --method planar --axis 0,0,0": "axis: (0.0, 0.0, 0.0)",
    f"{UNWRAP} --method planar --normal nan,0,1": "normal: (nan",
    f"{UNWRAP} --method planar --axis x --normal 0,0,1": "one of them",
    f"{UNWRAP} --method cylindrical --theta 30,30": "theta: (30.0, 30.0)",
    f"{UNWRAP} --method spherical --caps": "caps: the method spherical",
    f"{UNWRAP} --method two-part --via reflection": "eye: a reflection",
    f"{UNWRAP} --warp melt": "warp: melt is not one of",
    f"{UNWRAP} --warp bulge:2": "warp: a bulge of 2.0",
    f"{UNWRAP} --only lid": "only: low.obj has no",
    f"{UNWRAP} --heat": "heat: it colors the layout",
    "unwrap low.obj low.obj -o both": "two outputs",
    "unwrap low.obj high.ply -o both --method planar": "one mesh at a time",
    "remesh high.ply -o r.obj --close wide": "close: 'wide' is not a width",
    "simplify high.ply -o s.obj --error x": "--error: 'x' is not a distance",
    "run high.ply -o job --faces 20 --samples 4 --max-error 1deg": "leave nothing to choose",
    "run high.ply -o job --faces 9 --html high.ply": "also an input",
    "check low.obj --fail-on sometimes": "'sometimes' is not one of",
    "check low.obj --report low.obj": "also an input",
    "compare high.ply low.obj --normal-map rgb.png -o rgb.png": "also an input",
    "info low.obj --size 512": "give --uv as well",
    "info low.obj --uv --size 0": "size: 0 is out of range",
    f"{DRAW} --view 10,20,-1": "view",
    f"{DRAW} --space object": "give --normal-map as well",
    f"{DRAW} --max-error 0.5deg": "is not an error of a picture",
    f"{DRAW} --time-budget later": "is not a duration",
    f"{DRAW} --max-error 0.01 --supersampling 4": "leaves --max-error nothing to choose",
    f"{DRAW} --time-budget 9s --edges supersample": "leaves --time-budget nothing",
    f"{DRAW} --time-budget 9s --filter nearest,ewa": "is for one picture",
    f"{DRAW} --time-budget 9s --view turntable:3": "is for one picture",
    f"{DRAW} --max-error 0.01 --buffer depth": "which has no error",
    f"{DRAW} --max-error 0.01 --interpolation scanline": "give one of the two",
    "preview low.obj --normal-map rgb.png -o rgb.png": "also an input",
    "preview room.toml": "--output",
    f"{SCENE} --normal-map n.png": "a scene has its own materials",
    f"{SCENE} --buffer heat": "heat",
    f"{SCENE} --filter sharp": "sharp",
    f"{SCENE} --view turntable:0": "turntable",
    f"{SCENE} --affine-vs-perspective --interpolation affine": "names",
    f"{SCENE} --report low.obj": "low.obj: it is also an input",
    "preview room.toml -o room.toml": "room.toml: it is also an input",
    "preview room.toml -o p --view turntable:2 --filter nearest,ewa": "name one of each",
    f"{PACK} --red 0 --green 1": "none is an image",
    f"{PACK} --red gray.png --green 2": "2 is not from 0 to 1",
    f"{PACK} --red rgb.png --green 0": "such as rgb.png:g",
    f"{PACK} --red rgb.png:a --green 0": "has no alpha channel",
    f"{PACK} --red gray.png --green gray.png:g": "has no green channel",
    f"{PACK} --red small.png --green gray.png": "small.png 2 x 2",
    "pack-channels --red gray.png --green 0 --blue 0 -o gray.png": "also an input",
    "pack-channels --red gray.png --green 0 --blue 0 -o x.jpg": "JPEG changes",
    "split-channels gray.png -o m --names a,b": "2 are given, but gray.png has 1 channel",
    "split-channels rgb.png -o m --names a,a": "a is given twice",
    "split-channels rgb.png -o m --names ,": "all are empty",
    "split-channels rgb.png -o m --names ../a": "part of a file name",
    "cubemap rgb.png -o c.png --layout faces": "faces go to a folder",
    "cubemap rgb.png -o c --layout cross": "cross is one image",
    "cubemap rgb.png -o c.hdr --layout latlong": "rgb.png is a latlong already",
    "mipmap rgb.png -o m --roughness b": "only normals have one",
    "mipmap gray.png -o m --kind normal": "no three channels",
    "export low.obj -o e --to godot --map normal": "'normal' is not KIND=FILE",
    "export low.obj -o e --to godot --map ao=a.png --map ao=b.png": "ao is given twice",
    "export low.obj -o e --to unity --compress": "Unity does not read compressed",
    "make sphere -o a.obj --resolution 1000000000": "2,000,000,000,000,000,000 triangles",
    "make sphere -o a.obj --resolution fine": "'fine' is not a size",
    "make sphere -o a.obj --radius nan": "radius: nan",
    "make sphere -o a.obj --caps": "caps: the shape sphere does not use it",
    "make ball -o a.obj": "'ball'",
    "make bezier -o a.obj": "patches: the shape bezier needs it",
    "make height-field -o a.obj --image dot.png": "--image: an array of the shape (1, 1, 1) is not",
    TEXTURE: "give a procedure, a volume or photographs",
    f"{TEXTURE} --procedure wood --photo rgb.png --camera front.toml": "give a procedure, a volu",
    f"{TEXTURE} --photo rgb.png": "0 are given for 1 photograph",
    f"{TEXTURE} --procedure wood --camera front.toml": "goes with --photo",
    f"{TEXTURE} --procedure wood --param rings": "KEY=VALUE",
    f"{TEXTURE} --procedure wood --param speed=3": "wood.speed",
    f"{TEXTURE} --procedure wood --param rings=few": "wood.rings: 'few'",
    f"{TEXTURE} --procedure wood --colors red": "not a color such as",
    f"{TEXTURE} --procedure wood --scale 0": "scale: 0",
    f"{TEXTURE} --procedure wood --bits 12": "8 or 16 bits",
    f"{ATLAS} --mesh plane.obj --meshes-to o": "1 is given for 2",
    f"{ATLAS} --mesh plane.obj": "give both",
    "pack-textures rgb.png -o a.png --mesh plane.obj --meshes-to .": "also an input",
    "pack-textures rgb.png -o a.png --size 8 --padding 4": "has no room",
    "normal-to-height rgb.png -o h.png --bits 32": "not 32",
}

# Lines where a file or its place is at fault.
FILES = {
    "info no_such.ply": "no_such.ply: there is no such file",
    "info .": "it is a folder",
    "remap words.obj -o m": "it is not a file of hits",
    "bake high.ply low.obj -o m --maps base-color": "names no base color",
    "info words.obj": "words.obj",
    "info words.ply": "words.ply",
    "info words.glb": "words.glb",
    "info cut.ply": "cut.ply",
    "info cut.glb": "cut.glb",
    "info nan.obj": "nan.obj",
    "info infinite.obj": "infinite.obj",
    "info index.obj": "index.obj",
    "info points.obj": "points.obj: it has no faces",
    "info nothing.ply": "nothing.ply: the file is empty",
    "info mesh.xyz": "'.xyz'",
    "info high.ply --uv": "high.ply: it has no texture coordinates; make some with:",
    "check none.obj": "there is no such file",
    f"{DRAW} --normal-map no_such.png": "no_such.png: there is no such file",
    f"{DRAW} --normal-map words.obj": "words.obj",
    f"{DRAW} --albedo words.obj": "words.obj",
    "preview bare.obj --normal-map rgb.png -o p.png": "bare.obj: it has no texture coord",
    "preview missing.toml -o p.png": "missing.toml",
    "preview room.toml -o p.txt": "p.txt",
    "preview key.toml -o p.png": "key.toml: objects[0].material.shadng: unknown key",
    "preview model.toml -o p.png": "model.toml: objects[0].material.shading: 'gouraud'",
    "preview file.toml -o p.png": "no.obj",
    "preview dark.toml -o p.png": "dark.toml: lights[0].direction: (0.0, 0.0, 0.0)",
    "bake-lightmap bare.toml -o m": "none of its lit objects has the texture coordinates",
    "bake-normals high.ply bare.obj -o out.png": "bare.obj: it has no texture coord",
    "bake-normals high.ply collapsed.obj -o out.png": "collapsed.obj",
    "bake-normals high.ply low.obj -o out.webp": "'.webp'",
    "bake-normals cut.ply low.obj -o out.gif": "'.gif'",
    f"{BAKE} --cage bare.obj": "bare.obj",
    f"{BAKE} --front 0 --back 1e-9 --fail-on-miss 1": "%",
    f"{UNWRAP} --size 64 --texel-density 4000": "low.obj: ",
    f"{UNWRAP} --method projector --matrix words.txt": "words.txt",
    f"{UNWRAP} --seams low.obj": "low.obj: it has no lines",
    "unwrap bare.obj -o u.obj --keep": "bare.obj: it has no texture coord",
    "unwrap bare.obj -o u.obj --method parametric": "bare.obj: it has no texture coord",
    "unwrap low.obj high.ply -o low.obj": "is a file",
    "unwrap low.obj -o out.png": "'.png'",
    "lighten high.ply -o out.obj": "use .glb",
    "convert low.obj low.fbx": "low.fbx",
    "simplify high.ply -o out.gltf --faces 100": "'.gltf'",
    "simplify cut.ply -o a/b.obj --faces 9": "there is no folder",
    "run high.ply -o low.obj/job --faces 100": "is a file",
    "compare high.ply low.obj --html x.png": "use .html",
    "cubemap rgb.png -o a.xyz": "'.xyz' is not known",
    "cubemap square.png -o a": "12 x 12 pixels are neither a latlong",
    "cubemap . -o a.hdr": "the face px is missing",
    "export low.obj -o e --to godot --map ao=no.png": "no.png",
    "export low.obj -o e --to godot --maps nowhere": "no such folder",
    "export bare.obj -o e --to unity --map normal=rgb.png": "bare.obj: it has no texture coord",
    "make sphere -o a.png": "'.png'",
    "make revolution -o a.obj --profile no.txt": "no.txt: there is no such file",
    "make revolution -o a.obj --profile negative.txt": "negative.txt: a radius is negative",
    "make bezier -o a.obj --patches hole.txt": "hole.txt: line 3: it has 1 word;",
    "make bezier -o a.obj --patches binary.txt": "binary.txt: it is not a patch file",
    "make height-field -o a.obj --image hole.txt": "hole.txt",
    "bake-texture high.ply -o t.png --procedure wood": "high.ply: it has no texture coord",
    f"{TEXTURE} --photo rgb.png --camera bad.toml": "bad.toml: lens",
    f"{TEXTURE} --photo no.png --camera front.toml": "no.png",
    "pack-textures rgb.png -o a.png --mesh tiled.obj --meshes-to o": "tiled.obj: 3 of its",
    "normal-to-height world.png -o h.png": "world.png: its normals are in world space",
}
LONG = 300 * "x"


@pytest.mark.parametrize(("line", "exit_code", "message"), [
    *((line, WRONG_USAGE, message) for line, message in USAGE.items()),
    *((line, FAILED, message) for line, message in FILES.items()),
    *(
        (line.replace("LONG", LONG), FAILED, "File name too long")
        for line in (
            "unwrap low.obj -o LONG.obj",
            "run low.obj -o LONG --faces 20",
            "bake LONG.obj low.obj -o maps",
            "bake low.obj LONG.obj -o maps",
        )
    ),
])  # fmt: skip
def test_one_line_the_exit_code_and_nothing_else(place, monkeypatch, line, exit_code, message):
    monkeypatch.chdir(place)
    before = contents(Path())
    result = CliRunner().invoke(texbake, line.split())
    assert isinstance(result.exception, SystemExit), result.exception
    assert (result.exit_code, result.stdout) == (exit_code, ""), result.output
    assert result.stderr.count("\n") == 1 and result.stderr.startswith("texbake"), result.stderr
    assert message in result.stderr and ("--help)" in result.stderr) == (exit_code == WRONG_USAGE)
    assert contents(Path()) == before


@pytest.mark.parametrize("line", [
    "bake-normals high.ply low.obj --size 32 -o n.png",
    "bake high.ply low.obj --size 32 -o maps",
    "simplify high.ply -o low_1.obj --faces 100",
    "run high.ply -o job --faces 100",
])  # fmt: skip
def test_a_folder_that_may_not_be_written_to(workplace, invoke, monkeypatch, line):
    # Root, who may run the tests, may write anywhere: so the system's answer is simulated.
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    assert "cannot be written to" in invoke(line, FAILED).stderr


def test_links(workplace, invoke):
    """A link to an input is that input; links in a circle are an error."""
    Path("round.png").symlink_to("round.png")
    line = "bake-normals high.ply low.obj -o"
    assert "its links form a circle" in invoke(f"{line} round.png", FAILED).output
    before = Path("low.obj").read_bytes()
    Path("alias.json").symlink_to("low.obj")
    result = invoke(f"{line} new.png --report alias.json", WRONG_USAGE)
    assert "also an input" in result.output and Path("low.obj").read_bytes() == before
