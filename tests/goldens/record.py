"""Checksums of the files that the program writes: the demo, the samples, a pipeline, every command.

    python tests/goldens/record.py                   # write goldens.json again
    python tests/goldens/record.py commands out      # leave one group's files in a folder
    env $(python tests/goldens/record.py lowered) pytest tests/goldens     # as an older processor

A change that is meant to alter no result leaves goldens.json as it is; one that alters results
records it again and says why. Meshes, images and traces count byte by byte. What people read
(pages, reports, tables, notes) counts by its name alone, because its words may change.

The checksums hold on every processor. `lowered` prints environment variables that make NumPy, its
BLAS and the core use only the instructions of an old one: the files must stay the same.
"""

import csv
import hashlib
import importlib.util
import json
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

HERE = Path(__file__).parent
GOLDENS = HERE / "goldens.json"
SAMPLES = HERE.parents[1] / "samples"
FOR_PEOPLE = {".json", ".html", ".csv", ".txt", ".md", ".log", ".toml"}

# Command lines, run in this order in one folder; later ones read what earlier ones wrote.
COMMANDS = """
make sphere -o high.ply --resolution 256x128
make torus -o high.obj --resolution 160x80
make height-field -o field.obj --image picture.png
make sphere -o sphere.obj --resolution 24x12
make torus -o torus.obj --resolution 24x12
make cylinder -o prism.obj --sides 6 --caps --height 3
make mobius -o strip.glb --resolution 96x12 --twists 3
make plane -o plane.stl --resolution 4x4
simplify high.obj -o low.obj --faces 300
simplify high.obj -o best.ply --faces 300 --quality best
unwrap low.obj -o low_uv.obj --size 256 --padding 2 --layout layout.png --heat --checker checker.png
simplify low_uv.obj -o level.glb --faces 150 --seams keep
unwrap low.obj -o fast.glb --size 256 --quality fast --layout layout.svg
unwrap low.obj -o best_uv.obj --size 256 --quality best
unwrap prism.obj sphere.obj -o tiles --tiles 2 --size 256 --by-group
unwrap sphere.obj -o planar.obj --method planar --fit pca --sides
unwrap sphere.obj -o cylindrical.ply --method cylindrical --caps --warp twirl
unwrap torus.obj -o box.obj --method box --overlap --rotate 30 --scale 2
unwrap torus.obj -o two_part.obj --method two-part --surface sphere --via object-normal
unwrap torus.obj -o projector.obj --method projector --camera 20,10
unwrap torus.obj -o parametric.obj --method parametric --linear 2,0,0,0,2,0
cage high.obj low_uv.obj -o cage.obj
bake high.obj low_uv.obj -o plain --size 256 --maps normal,displacement,vector-displacement,\
position,world-position,curvature,convexity,concavity,object-id,material-id,opacity \
--hits hits.npz --miss-map misses.png
bake colored.ply low_uv.obj -o colors --size 128 --maps vertex-color,base-color \
--high-texture picture.png
bake high.obj low_uv.obj -o occlusion --size 128 --maps ao,bent-normal,thickness \
--secondary-rays 16
bake high.obj low_uv.obj -o caged --size 128 --samples 4 --cage cage.obj \
--fill push-pull --format tif
bake high.obj low_uv.obj -o faces --size 128 --rays face --space object \
--high-shading flat --bits 8
bake high.obj low_uv.obj -o vertex --size 128 --rays vertex --convention directx --hit-back-faces
bake high.obj low_uv.obj -o chunks --size 128 --max-memory 20M
bake high.obj low_uv.obj -o error --size 128 --maps normal,displacement --max-error 0.5deg,0.01%
bake high.obj low_uv.obj -o adaptive --size 128 --samples adaptive --format exr
bake high.obj low_uv.obj -o masked --size 128 --skew-mask checker.png --offset-map layout.png
bake high.obj low_uv.obj -o udim --size 128 --name-pattern {asset}_{map}.{udim}.{ext}
bake high.ply tiles/sphere.obj --high high.obj --low low_uv.obj \
-o several --size 128 --texture-sets groups
bake-normals high.obj low_uv.obj -o normal.png --size 256 --samples 4
bake-displacement high.obj low_uv.obj -o height.exr --size 256
bake-displacement high.obj low_uv.obj -o height.png --size 256 --scale 0.2 --mid 0.4
remap hits.npz -o remapped --maps normal,curvature,position --format exr --space world
bake-texture low_uv.obj -o marble.png --procedure marble --size 128 --param amount=5
bake-texture low_uv.obj -o granite.png --procedure granite --size 128 --samples 1
pack-textures marble.png normal.png --mesh low_uv.obj --mesh fast.glb \
-o atlas.png --meshes-to packed
height-to-normal height.exr -o slopes.png --width 2 --derivative scharr
normal-to-height slopes.png -o heights.exr
normal-to-height slopes.png -o waves.exr --method frankot-chellappa --wrap clamp
mipmap marble.png -o levels
mipmap normal.png -o normals.png --kind normal --filter kaiser --roughness rough
bake-texture sphere.obj -o pano.png --procedure fractal --size 256x128
cubemap pano.png -o faces_of_cube --size 64
cubemap faces_of_cube -o cross.exr --layout cross --size 32
preview low_uv.obj --normal-map normal.png --displacement height.exr -o preview.png --size 320x200
preview low_uv.obj --albedo marble.png -o filters.png --filter nearest,bilinear,ewa --size 200x150
preview low_uv.obj --albedo marble.png -o adaptive.png --max-error 2/255 --size 200x150
preview strip.glb -o turn --view turntable:3 --size 120x90 --back-faces show
compare high.obj low_uv.obj --normal-map normal.png --displacement height.exr \
-o compare.png --size 320x200
check high.obj low_uv.obj --layout found.png --sides sides.png --fail-on never
export low_uv.obj --to unreal --maps plain -o unreal
export low_uv.obj --to blender --maps plain -o blender --layers
export low_uv.obj --to unity --maps plain -o unity --mesh-format usda
export low_uv.obj --to godot --maps plain -o godot --textures dds
export low_uv.obj --to threejs --maps plain --level level.glb -o threejs
run high.obj -o whole --faces 300 --size 256
run colored.ply -o painted --faces 300 --size 128
lighten colored.ply -o light.glb --faces 300 --size 128 --images png --views 0
"""

# The same in a folder with a character of each format.
CHARACTERS = """
convert character.fbx -o converted.glb
transform character.glb -o turned.glb --scale 3 --up z
simplify character.glb -o low.glb --faces 300
unwrap low.glb -o low_uv.glb --size 256
lighten character.glb -o light.glb --faces 300 --size 128 --images png --views 0
"""


def command_lines(commands=COMMANDS):
    """Words of each command line, with continued lines joined."""
    return [line.split() for line in commands.replace("\\\n", "").strip().splitlines()]


def run_commands():
    """Run every command line in the current folder, on a picture and a colored mesh made here."""
    import numpy as np

    import texbake

    rows, columns = np.mgrid[0:32, 0:48] / 48
    picture = np.stack([columns, rows, 0.5 + 0.5 * np.sin(20 * rows * columns)], axis=-1)
    texbake.write_image(picture, "picture.png", color=True, bits=8)
    torus = texbake.make("torus", resolution=(160, 80))
    colors = 0.5 + 0.5 * np.sin(3 * torus.positions)
    texbake.write_mesh(torus.replace(colors=colors), "colored.ply")
    for words in command_lines():
        started = time.perf_counter()
        run_command(*words)
        print(f"{time.perf_counter() - started:6.2f} s  texbake {' '.join(words)}")


def run_characters():
    """Run command lines on meshes with skins, morph targets and animations."""
    sys.path.insert(0, str(HERE.parents[1]))
    import texbake
    from tests.character import character
    from tests.fbx_writer import moving_scene, written

    mesh, rig = character()
    texbake.write_mesh(mesh, "character.glb", rig=rig)
    Path("character.fbx").write_bytes(written(moving_scene(), 7400, "binary"))
    for words in command_lines(CHARACTERS):
        run_command(*words)


def run_command(*words):
    from texbake_cli.main import texbake

    try:
        texbake([*words, "--quiet"], prog_name="texbake")
    except SystemExit as stop:
        if stop.code:
            raise RuntimeError(f"texbake {' '.join(words)}: exit code {stop.code}") from None


def run_demo():
    """Run the demo with fewer triangles and texels than by default."""
    run_command("demo", "-o", "demo", "--triangles", "100000", "--size", "512")


def run_sample(name, *arguments):
    """Run a Python script of samples/ as its reader would; return its exit code."""
    sys.argv = [name, *arguments]
    sys.path.insert(0, str(SAMPLES))
    try:
        runpy.run_path(str(SAMPLES / name), run_name="__main__")
    except SystemExit as stop:
        return stop.code


def run_asset_folder():
    """Run the sample: its broken mesh fails by itself, and the exit code says that one did."""
    status = run_sample("asset_folder.py")
    with Path("asset_folder_sample", "assets.csv").open() as file:
        results = {row["asset"]: row["result"] for row in csv.DictReader(file)}
    fault = results.pop("broken.obj")
    assert results == {"orange.ply": "good", "ball.obj": "good"}, results
    assert status == 1 and fault.startswith("failed: ") and "not finite" in fault, fault


def run_mappings():
    """Draw the sample's picture with small cells."""
    sys.path.insert(0, str(SAMPLES))
    import mappings

    mappings.CELL = 60
    mappings.main(Path("mappings.png"))


def run_gallery():
    """Draw the sources and pictures of the gallery at a small size."""
    sys.path[:0] = [str(SAMPLES), str(HERE.parents[1])]
    import gallery
    import gallery_sources

    import texbake
    from tests.samples.test_gallery import small

    gallery.SCENES = Path("scenes").resolve()
    shutil.copytree(SAMPLES / "scenes", gallery.SCENES)
    gallery_sources.main(gallery.SCENES)
    for shot in gallery.shots():
        scene, variants = gallery.opened(shot, width=96, height=60)
        for i, (_, options) in enumerate(variants):
            color = texbake.render_scene(small(scene), options).color[:, :, :3]
            texbake.write_image(color, f"{shot.name}_{i}.png", color=True, bits=16)


def run_pipeline():
    """Build samples/pipeline.toml, with small pictures in its pages, which are for people."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "samples"
        shutil.copytree(SAMPLES, copy, ignore=shutil.ignore_patterns("gallery*"))
        text = (copy / "pipeline.toml").read_text(encoding="utf-8")
        text = text.replace('do = "page"\n', 'do = "page"\nsize = 64\n')
        text = text.replace("size = 512", "size = 256").replace("640", "160").replace("480", "120")
        (copy / "pipeline.toml").write_text(text, encoding="utf-8")
        run_command("build", str(copy / "pipeline.toml"), "-o", "built")


SCRIPTS = ("python_api", "asset_folder")
GROUPS: dict[str, Callable[[], object]] = {
    "demo": run_demo, "python_api": partial(run_sample, "python_api.py", "vase"),
    "asset_folder": run_asset_folder,
    "mappings": run_mappings, "gallery": run_gallery,
    "pipeline": run_pipeline, "commands": run_commands, "characters": run_characters,
}  # fmt: skip


def checksums(folder):
    """Checksum of every file below a folder; empty where only the name counts."""
    sums = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = path.relative_to(folder).as_posix()
        if any(part.startswith(".") for part in name.split("/")):
            continue  # a store of results, whose names are keys
        sums[name] = "" if path.suffix in FOR_PEOPLE else checksum(path)
    return sums


def checksum(path):
    """Checksum of a file's bytes; of a trace, of its arrays without the header."""
    digest = hashlib.sha256()
    if path.suffix == ".npz":
        with zipfile.ZipFile(path) as trace:
            for name in sorted(set(trace.namelist()) - {"header.npy"}):
                digest.update(name.encode() + trace.read(name))
    else:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def record(group):
    """Run a group in a separate process and return the checksums of its files."""
    strict = ["-W", "error"] if group in SCRIPTS else []  # what a script is warned of, too
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, *strict, __file__, group, folder], capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f"{group}: {done.stdout}{done.stderr}")
        return checksums(Path(folder))


def lowered_environment():
    """Variables with which NumPy, OpenBLAS and the core run as on the oldest x86-64 processor."""
    import numpy as np

    numbers = np._core._multiarray_umath if hasattr(np, "_core") else np.core._multiarray_umath
    present = [name for name in numbers.__cpu_dispatch__ if numbers.__cpu_features__[name]]
    return {
        "NPY_DISABLE_CPU_FEATURES": ",".join(present),
        "OPENBLAS_CORETYPE": "Nehalem",
        "TEXBAKE_CORE": "x86-64-v2",
    }


def main(arguments):
    """Run one group in a folder, or record all of them."""
    if arguments == ["lowered"]:
        print(*(f"{name}={value}" for name, value in lowered_environment().items()))
        return
    if arguments:
        group, folder = arguments
        Path(folder).mkdir(parents=True, exist_ok=True)
        os.chdir(folder)
        GROUPS[group]()
        return
    goldens = {}
    print(f"of {importlib.util.find_spec('texbake').origin}")
    for group in GROUPS:
        started = time.perf_counter()
        goldens[group] = record(group)
        print(f"{group}: {len(goldens[group])} files, {time.perf_counter() - started:.1f} s")
    GOLDENS.write_text(json.dumps(goldens, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
