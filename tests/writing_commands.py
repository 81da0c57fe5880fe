"""A line of every command that writes files, for tests of what is left when one is stopped.

The lines run in a folder with high.ply and low.obj, and the files of `make_inputs`.
"""

import numpy as np

from texbake import write_image

READING = {"info"}  # commands that write no file

BAKED = "bake high.ply low.obj -o maps --maps normal,displacement --size 32 --padding 1"

# The first word is the name of the command. Some prepare their inputs with lines before the last.
LINES = {
    "bake": (f"{BAKED} --hits hits.npz --report r.json --miss-map m.png",),
    "bake-displacement": ("bake-displacement high.ply low.obj -o d.exr --size 32 --padding 1",),
    "bake-lightmap": ("bake-lightmap room.toml -o light --size 32",),
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
    "bake-texture": ("bake-texture low.obj -o t.png --procedure noise --size 16 --report r.json",),
    "bake-texture photos": (
        "bake-texture low.obj -o t.png --photo rgb.png --camera front.toml --photo rgb.png"
        " --camera back.txt --size 64 --unseen-map u.png",
    ),
    "bake-texture mapped": (
        "bake-texture low.obj -o t.jpg --photo rgb.png --photo-uvs low.obj --size 32"
        " --report r.json",
    ),
    "bench": (
        "bench --quick --task simplify --case sphere --program texbake --size 32 --triangles 1000"
        " -o bench",
    ),
    "build": ("build pipeline.toml -o built --jobs 2 --threads 1 --html page.html",),
    "cage": ("cage high.ply low.obj -o cage.obj",),
    "check": ("check low.obj --size 64 --report r.json --layout l.png",),
    "compare": ("compare high.ply low.obj --size 48 --report r.json -o c.png",),
    "convert": ("unwrap low.obj -o two.glb --uv-set 1 --size 64", "convert two.glb two.obj"),
    "convert usd": ("convert low.obj low.usda", "convert low.usda read.obj"),
    "cubemap": ("cubemap sky.png -o faces --size 8",),
    "demo": ("demo --triangles 2000 --faces 60 --size 64 -o orange",),
    "export": (BAKED, "export low.obj --to unreal --map normal=maps/normal.png -o asset"),
    "height-to-normal": ("height-to-normal gray.png -o slopes.png",),
    "lighten": ("lighten high.ply -o light.glb --faces 400 --size 64 --views 1 --report r.json",),
    "make": ("make sphere -o ball.glb --resolution 64x32",),
    "mipmap": ("mipmap rgb.png -o levels --kind normal --roughness rough",),
    "normal-to-height": ("height-to-normal gray.png -o up.png", "normal-to-height up.png -o h.exr"),
    "pack-channels": ("pack-channels --red gray.png --green 0.5 --blue 0 -o orm.png",),
    "pack-textures": (
        "convert low.obj other.obj",
        "pack-textures rgb.png sky.png --mesh low.obj --mesh other.obj -o atlas.png"
        " --meshes-to packed",
    ),
    "preview": ("preview low.obj --albedo rgb.png -o turn --view turntable:3 --size 48",),
    "remap": (f"{BAKED} --hits hits.npz", "remap hits.npz -o more --maps normal,displacement"),
    "remesh": ("remesh high.ply -o closed.ply --resolution 16 --report r.json",),
    "repair": ("repair high.ply -o whole.obj",),
    "run": ("run high.ply -o job --faces 60 --size 32 --padding 1 --html page.html",),
    "schema": ("schema scene -o scene.schema.json",),
    "simplify": ("simplify high.ply -o low_1.obj --faces 200 --report r.json",),
    "split-channels": ("split-channels rgb.png -o apart",),
    "study": ("study --quick --knob texture-size -o study",),
    "transform": ("transform low.obj -o turned.stl --scale 2",),
    "unwrap": (
        "unwrap low.obj -o out.glb --size 64 --padding 2 --layout l.png --checker c.png"
        " --report r.json",
    ),
    "unwrap cylindrical": (
        "unwrap high.ply -o out.ply --method cylindrical --axis 0,1,1 --caps --checker c.png",
    ),
    "unwrap several": ("unwrap low.obj high.ply -o both --quality fast --tiles 2 --layout l.svg",),
    "unwrap xatlas": ("unwrap low.obj -o charts.obj --charts xatlas --size 64 --layout l.png",),
    "watch": ("watch pipeline.toml -o built --jobs 2 --threads 1",),
}  # fmt: skip

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

PIPELINE = """
[[assets]]
name = "ball"

[[assets]]
name = "egg"
options.ball.radius = 2.0

[steps.ball]
do = "make"
shape = "sphere"
resolution = [24, 16]

[steps.low]
do = "unwrap"
mesh = "ball"
method = "spherical"
output = "{asset}_{step}.{ext}"

[steps.maps]
do = "bake"
high = "ball"
low = "low"
maps = ["normal", "displacement"]
size = 32
padding = 1
output = "{asset}_{output}.{ext}"
"""


def make_inputs(folder):
    """Write the inputs of all lines but the meshes high.ply and low.obj."""
    write_image(np.linspace(0, 1, 256).reshape(16, 16, 1), folder / "gray.png", bits=16)
    write_image(np.full((8, 8, 3), 0.5), folder / "rgb.png")
    write_image(np.full((8, 16, 3), 0.5), folder / "sky.png", color=True)
    front = "position = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 45\n"
    (folder / "front.toml").write_text(front, encoding="utf-8")
    # Looks along +z, in parallel: s = (1 - x) / 2, t = (y + 1) / 2.
    back = "-0.5 0 0 0.5  0 0.5 0 0.5  0 0 1 1  0 0 0 1"
    (folder / "back.txt").write_text(back, encoding="utf-8")
    (folder / "room.toml").write_text(ROOM, encoding="utf-8")
    (folder / "pipeline.toml").write_text(PIPELINE, encoding="utf-8")


def contents(folder):
    """Return the bytes of all files in a folder and below."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
