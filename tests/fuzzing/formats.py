"""Targets of the fuzzer: readers, with small valid files of their formats, and calls of the core.

Kernels trust what was validated, so they are called by the functions of Python that validate. Each
target is a format like any other: an input is a file of bytes, from which `drawn` makes arguments.
A module is loaded when it is first needed, so that the fuzzer can count its branches.
"""

import base64
import json
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
for folder in (HERE, HERE.parent, HERE.parent / "rendering"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

Maker = Callable[[Path], None]
Reader = Callable[[Path], Any]


def _mesh_seed(path):
    from texbake import write_mesh
    from texbake.mesh.shapes import uv_sphere
    from texbake.mesh.tangents import corner_tangents

    ball = uv_sphere(4, 6)
    ball = ball.replace(normals=ball.positions, normal_faces=ball.faces)
    write_mesh(ball.replace(tangents=corner_tangents(ball)), path)


def _trimesh_seed(**options):
    def make(path):
        import trimesh

        trimesh.creation.box().export(path, **options)

    return make


def _gltf_seed(path):
    """JSON with its buffer inside, from the chunks of a GLB file."""
    from texbake import write_mesh
    from texbake.mesh.shapes import uv_sphere

    whole = path.with_suffix(".glb")
    write_mesh(uv_sphere(3, 4), whole)
    _unpacked(whole, path)


def _unpacked(whole, path):
    from glb import read_glb

    document, data = read_glb(whole)
    uri = f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))


def _fbx_seed(version, form):
    def make(path):
        from fbx_writer import rich_scene, written

        path.write_bytes(written(rich_scene(version), version, form))

    return make


def _character_seed(path):
    """A skin, a morph target, animations, a camera and a light."""
    from character import character

    from texbake import write_mesh

    mesh, rig = character(3, 4)
    whole = path.with_suffix(".glb")
    write_mesh(mesh, whole, rig=rig)
    if path != whole:
        _unpacked(whole, path)


def _moving_fbx_seed(form):
    def make(path):
        from fbx_writer import moving_scene, written

        path.write_bytes(written(moving_scene(), 7400, form))

    return make


def _layered_fbx_seed(form):
    """FBX without normals, with smoothing by edge, two sets of texture coordinates, a texture."""

    def make(path):
        from fbx_writer import layer, properties, scene, written

        smoothing = layer(
            "LayerElementSmoothing", ("Smoothing", np.array([0, 1, 1, 0], np.int32)), "ByEdge"
        )
        sets = [layer("LayerElementUV", ("UV", np.arange(22.0)), index=i) for i in range(2)]
        layers = [(kind, i, [("Name", [f"map{i[0]}"], []), *rest]) for kind, i, rest in sets]
        edges = ("Edges", [np.array([0, 1, 2, 4], np.int32)], [])
        nodes = scene(layers=[smoothing, *layers, edges], materials=("red",))
        texture = [properties(7400, {"UVSet": ["map1"]}), ("Content", ["aW1hZ2U="], [])]
        nodes[1][2].append(("Texture", [60, "paint\0\1Texture", ""], texture))
        nodes[2][2].append(("C", ["OP", 60, 50, "TransparentColor"], []))
        path.write_bytes(written(nodes, 7400, form))

    return make


def _tristrips_seed(path):
    from texbake.mesh.shapes import uv_sphere

    positions = uv_sphere(4, 6).positions.astype("<f4")
    strip = np.array([0, 1, 2, 3, -1, 4, 5, 6, 7, 8], "<i4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(positions)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += ["element tristrips 1", "property list int int vertex_indices", "end_header", ""]
    content = np.array([len(strip)], "<i4").tobytes() + strip.tobytes()
    path.write_bytes("\n".join(header).encode() + positions.tobytes() + content)


MTL = """
newmtl red
Kd 0.8 0.1 0.2
Ke 0.0 0.0 0.5
d 0.5
Pr 0.25
Pm 1.0
map_Kd -o 0.5 0.25 -s 2 2 -clamp on seed.mtl
norm -bm 0.5 seed.mtl
map_d "seed.mtl"
newmtl blue
Kd 0.5
map_Ke missing image.png
"""


def _mtl_seed(path):
    faces = "usemtl red\nf 1 2 3\nusemtl blue\nf 1/1 3/1 2/1\n"
    for name in "seed", "mutant":
        text = f"mtllib {name}.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}"
        path.with_name(f"{name}.obj").write_text(text)
    path.write_text(MTL)


def _materials_seed(suffix):
    """A mesh with a texture for each channel."""

    def make(path):
        from texbake import write_image, write_mesh
        from texbake.mesh.shapes import uv_sphere

        image = path.with_name("image.png")
        write_image(np.full((2, 2, 3), 0.5, np.float32), image)
        whole = path.with_suffix(".glb") if suffix == ".gltf" else path
        write_mesh(uv_sphere(3, 4), whole, normal_map=image, base_color=image, orm=image)
        if suffix == ".gltf":
            _unpacked(whole, path)

    return make


def _image_seed(channels, bits):
    def make(path):
        from texbake import write_image

        values = np.random.default_rng(1).random((48, 40, channels)).astype(np.float32)
        write_image(values, path, bits=bits, metadata={"texbake:space": "tangent"})

    return make


def _hits_seed(path):
    from texbake import BakeOptions, bake
    from texbake.baking.hits_file import write_hits
    from texbake.mesh.shapes import uv_sphere

    ball = uv_sphere(4, 6)
    write_hits(bake(ball, ball, BakeOptions(size=8, keep_hits=True)), path)


def _text_seed(text):
    return lambda path: path.write_text(text) and None


SCENE = """
[render]
width = 32
height = 24
[camera]
position = [0.0, 0.5, 3.0]
target = [0.0, 0.0, 0.0]
[ambient]
color = [0.1, 0.1, 0.12]
[fog]
mode = "exp"
density = 0.1
[[lights]]
kind = "point"
position = [2.0, 3.0, 4.0]
intensity = 20.0
shadow = {size = 64}
[materials.red]
shading = "blinn-phong"
base_color = "#e08020"
exponent = 40.0
bump_map = {texture = {procedure = "noise", scale = 30}, height = 0.01}
[[objects]]
shape = "sphere"
resolution = [8, 4]
material = "red"
translate = [0.0, 0.1, 0.0]
rotate = [-90, 0, 0]
"""

PIPELINE = """
folder = "built"
[[assets]]
name = "boulder"
inputs.high = "scans/boulder.ply"
options.maps = {size = 256, samples = 4}
[[assets]]
name = "{stem}"
inputs.high = "more/*.ply"
[steps.levels]
do = "simplify"
mesh = "high"
faces = [1000, 400]
[steps.low]
do = "unwrap"
mesh = "levels"
size = 512
padding = 4
output = "{asset}/{asset}_low.{ext}"
[steps.limits]
do = "check"
mesh = "low"
max_stretch = 1.3
[steps.maps]
do = "bake"
after = "limits"
high = "high"
low = "low"
maps = ["normal", "displacement"]
fail_on_miss = 2.0
format = {displacement = "exr"}
output = "{asset}/{asset}_{output}.{ext}"
"""

# Long enough that a million bytes are some hundreds of files.
MATRIX = "\n".join(
    " ".join(f"{1.0 / (3.0 + 4 * row + column):.40f}" for column in range(4)) + "  # a row"
    for row in range(4)
)
SEAMS = "v -0.5 -0.5 -0.5\nv 0.5 -0.5 -0.5\nv 0.5 0.5 0.5 1 1\nl 1 2\nl -3 2/1 3\n"
PROFILE = "# radius height\n" + "\n".join(
    f"{1.5 + np.sin(i / 9.0):.6f}, {i / 50.0:.5e}" for i in range(150)
)
PATCHES = "\n".join(
    f"{i / 3.0:.20f} {j / 3.0:.20f} {(i - 1) * (j - 2) / 9.0:.20f}"
    for i in range(4)
    for j in range(4)
)


def _by(module, name):
    """Return a function that is loaded when a file is read."""
    return lambda path: getattr(import_module(module), name)(path)


_read_mesh = _by("texbake", "read_mesh")
_read_scene = _by("texbake", "read_scene")


def _read_all(path):
    """Read a mesh with its materials and what else its file says."""
    from texbake import read_mesh
    from texbake.mesh.files.contents import read_contents
    from texbake.mesh.materials import read_materials

    read_contents(path)
    return read_materials(path, read_mesh(path))


def _read_character(path):
    """Read what moves a mesh, pose it, and write it again."""
    from texbake import read_mesh, write_mesh
    from texbake.mesh.rig import read_rig, with_poses

    mesh, rig = read_mesh(path), read_rig(path)
    again = path.with_name("again.glb")
    write_mesh(with_poses(mesh, rig), again, rig=rig)
    return read_mesh(again), read_rig(again)


def _read_mtl(path):
    return _read_all(path.with_suffix(".obj"))


def _read_image(path):
    from texbake import read_image

    return read_image(path, color=True)


def _read_hits(path):
    from texbake import BakeOptions
    from texbake.baking.bake import remap_hits
    from texbake.baking.hits_file import read_hits

    # Accepted values must not make kernels fail either.
    return remap_hits(read_hits(path), BakeOptions(maps=("normal", "displacement")))


_read_matrix = _by("texbake.mapping.classical.projector", "read_matrix")


def _read_seams(path):
    from texbake.mapping.marked_seams import read_seams
    from texbake.mesh.shapes import cube

    return read_seams(path, cube())


_SURFACES = "texbake.mesh.parametric"
FORMATS: dict[str, tuple[str, Maker, Reader]] = {
    "obj": (".obj", _mesh_seed, _read_mesh),
    "ply binary": (".ply", _mesh_seed, _read_mesh),
    "ply ascii": (".ply", _trimesh_seed(encoding="ascii"), _read_mesh),
    "stl binary": (".stl", _mesh_seed, _read_mesh),
    "stl ascii": (".stl", _trimesh_seed(file_type="stl_ascii"), _read_mesh),
    "ply strips": (".ply", _tristrips_seed, _read_mesh),
    "mtl": (".mtl", _mtl_seed, _read_mtl),
    "off": (".off", _mesh_seed, _read_mesh),
    "glb": (".glb", _mesh_seed, _read_mesh),
    "gltf": (".gltf", _gltf_seed, _read_mesh),
    "fbx binary": (".fbx", _fbx_seed(7400, "binary"), _read_mesh),
    "fbx binary 64": (".fbx", _fbx_seed(7700, "binary"), _read_mesh),
    "fbx binary 6": (".fbx", _fbx_seed(6100, "binary"), _read_mesh),
    "fbx ascii": (".fbx", _fbx_seed(7400, "ascii"), _read_mesh),
    "fbx ascii 6": (".fbx", _fbx_seed(6100, "ascii"), _read_mesh),
    "fbx binary layers": (".fbx", _layered_fbx_seed("binary"), _read_all),
    "fbx ascii layers": (".fbx", _layered_fbx_seed("ascii"), _read_all),
    "glb character": (".glb", _character_seed, _read_character),
    "gltf character": (".gltf", _character_seed, _read_character),
    "fbx binary character": (".fbx", _moving_fbx_seed("binary"), _read_character),
    "fbx ascii character": (".fbx", _moving_fbx_seed("ascii"), _read_character),
    "glb materials": (".glb", _materials_seed(".glb"), _read_all),
    "gltf materials": (".gltf", _materials_seed(".gltf"), _read_all),
    "glb scene": (".glb", _mesh_seed, _read_scene),
    "gltf scene": (".gltf", _gltf_seed, _read_scene),
    "gltf materials scene": (".gltf", _materials_seed(".gltf"), _read_scene),
    "png 8": (".png", _image_seed(3, 8), _read_image),
    "png 16": (".png", _image_seed(1, 16), _read_image),
    "exr": (".exr", _image_seed(3, 16), _read_image),
    "tiff": (".tif", _image_seed(3, 16), _read_image),
    "tga": (".tga", _image_seed(3, 8), _read_image),
    "hdr": (".hdr", _image_seed(3, 32), _read_image),
    "jpeg": (".jpg", _image_seed(3, 8), _read_image),
    "scene": (".toml", _text_seed(SCENE), _read_scene),
    "seams": (".obj", _text_seed(SEAMS), _read_seams),
    "matrix": (".txt", _text_seed(MATRIX), _read_matrix),
    "profile": (".txt", _text_seed(PROFILE), _by(f"{_SURFACES}.revolution", "profile_of")),
    "patches": (".txt", _text_seed(PATCHES), _by(f"{_SURFACES}.bezier", "patches_of")),
    "hits": (".npz", _hits_seed, _read_hits),
    "pipeline": (".toml", _text_seed(PIPELINE), _by("texbake.building.file", "read_pipeline")),
    "dae": (".dae", _trimesh_seed(), _read_mesh),
    "3mf": (".3mf", _trimesh_seed(), _read_mesh),
}
# They come last, because each file takes a process of its own, some 0.3 s.
if find_spec("pxr") is not None:
    FORMATS |= {
        "usda": (".usda", _mesh_seed, _read_mesh),
        "usda materials": (".usda", _materials_seed(".usda"), _read_all),
        "usdc": (".usdc", _mesh_seed, _read_mesh),
        "usd": (".usd", _mesh_seed, _read_mesh),
        "usdz": (".usdz", _mesh_seed, _read_mesh),
    }

# The functions of each module that are targets.
MODULES = {
    "mesh_targets": (
        "files", "surface", "repair", "simplify", "pieces", "parts", "remesh", "distance", "check",
        "atlas", "mappings", "layout", "rays", "bake", "cage", "streamed", "paint",
    ),
    "picture_targets": (
        "image_lookup", "padding", "coding", "heights", "cubes", "procedures", "scenes", "preview",
        "numbers",
    ),
}  # fmt: skip
SEED_BYTES = 1024

# Functions of the core that no target and no format reaches, and why.
UNREACHED = {
    "stitch_charts": "charts of a few faces are not joined; tests/mapping/test_join.py does",
    "relax_chart": "charts of a few faces are not joined; tests/mapping/test_join.py does",
    "find_shortest_paths": "bodies have 100 faces or more; tests/mapping/test_body.py cuts them",
    "unfold_triangles": "bodies have 100 faces or more; tests/mapping/test_body.py cuts them",
    "flatten_within": "few charts have four corners; tests/mapping/test_rectangles.py lays some",
    "take_over_samples": "bakes of a few texels do not divide a texel twice; its tests do",
    "has_x86_64_v3": "it takes nothing, and is called while the library is chosen",
}


def _seed(name):
    def make(path):
        path.write_bytes(np.random.default_rng([*name.encode()]).bytes(SEED_BYTES))

    return make


def _target(module, name):
    def read(path):
        from drawn import Drawn

        getattr(import_module(module), name)(Drawn(path.read_bytes()))

    return read


TARGETS: dict[str, tuple[str, Maker, Reader]] = {
    f"core {name}": (".bin", _seed(name), _target(module, name))
    for module, names in MODULES.items()
    for name in names
}
READ = FORMATS | TARGETS


def unreached():
    """Return the functions of the core that have not been called in this process."""
    from texbake.core import core

    return set(core._prototypes) - set(vars(core))
