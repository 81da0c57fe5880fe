"""The numeric library where NumPy is the only other package."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np

import texbake

ROOT = Path(__file__).parents[1]

# Writes files to the folder `out`.
TOUR = """
import numpy as np
import texbake
from texbake.baking.maps import MAP_NAMES
from texbake.mesh.shapes import plane
from texbake.mesh.tangents import corner_tangents

def hill(x, y):
    return 0.1 * np.maximum(0.0, 0.2 - (x - 0.5) ** 2 - (y - 0.5) ** 2)

high = plane(24, 24, hill)
high = high.replace(colors=np.ones((high.n_vertices, 3), np.float32), uvs=None, uv_faces=None)
low = texbake.unwrap(texbake.simplify(high, 60))
for suffix in "obj", "ply", "stl", "glb":
    texbake.write_mesh(low, out / f"low.{suffix}")
    read = texbake.read_mesh(out / f"low.{suffix}")
    assert read.n_faces == low.n_faces
    texbake.write_mesh(read, out / f"again.{suffix}")
texbake.write_mesh(texbake.remesh(high, texbake.RemeshOptions(resolution=48)), out / "remeshed.ply")
texbake.write_mesh(texbake.repair(high)[0], out / "repaired.ply")
assert corner_tangents(low).shape == (low.n_faces, 3, 4)
uvs = texbake.parametrize(low.positions, low.faces)[2]
texbake.write_image(np.linspace(0, 1, uvs.size).reshape(1, -1, 2), out / "uvs.png", bits=16)
texbake.write_image(texbake.draw_layout(low, 64), out / "layout.png", color=True, bits=8)
of_files = MAP_NAMES.index("base-color"), MAP_NAMES.index("ao")  # maps of images that files name
maps = tuple(name for i, name in enumerate(MAP_NAMES) if not of_files[0] <= i < of_files[1])
for samples in 1, "adaptive":
    options = texbake.BakeOptions(size=32, maps=maps, samples=samples)
    texbake.bake(high, low, options).write(out / str(samples))
done = texbake.finish(
    high.positions, high.faces, n_faces=60, size=32, output=out / "done.glb",
    sample=lambda points, normals: (normals + 1) / 2,
)
points = texbake.atlas_points(low, 32)
filled = texbake.fill(points.positions, points.mask)
texbake.write_image(np.clip(filled, 0, 1), out / "filled.png", color=False, bits=16)
from texbake.compat import xatlas
xatlas.export(str(out / "compat.obj"), high.positions, high.faces)
assert len(xatlas.parametrize(high.positions, high.faces)) == 3
assert texbake.check(low, high).findings is not None
assert texbake.mesh_info(low).n_faces == low.n_faces
"""

# What needs a library, and what pip installs for it.
NEEDS = {
    'texbake.read_image(out / "uvs.png", color=False)': "openimageio",
    'texbake.write_image(np.zeros((2, 2, 3)), out / "a.exr")': "openimageio",
    "texbake.to_trimesh(low)": "trimesh",
    'texbake.unwrap(low, texbake.UnwrapOptions(charts="xatlas"))': "xatlas",
    "texbake.show(low)": "pillow", "low._repr_html_()": "pillow",
    'texbake.read_scene(out / "a.toml")': "pydantic", 'texbake.build(out / "a.toml")': "filelock",
}  # fmt: skip


def tour_alone(folder, code):
    """Output of code in a process that finds texbake, NumPy and Python's own modules alone."""
    packages = folder / "packages"
    packages.mkdir(parents=True)
    (folder / "out").mkdir()
    beside = Path(np.__file__).parents[1]
    for package in Path(texbake.__file__).parent, beside / "numpy", beside / "numpy.libs":
        if package.exists():
            (packages / package.name).symlink_to(package, target_is_directory=True)
    opening = (
        "import pathlib, sys\n"
        f"sys.path.append({str(packages)!r})\n"
        f"out = pathlib.Path({str(folder / 'out')!r})\n"
    )
    environment = {name: os.environ[name] for name in os.environ if not name.startswith("PYTHON")}
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", opening + code],
        capture_output=True, text=True, timeout=300, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def files_of(folder):
    paths = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".json"]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def test_numpy_alone_gives_the_same_files(tmp_path):
    tour_alone(tmp_path / "alone", TOUR)
    (tmp_path / "whole").mkdir()
    exec(TOUR, {"out": tmp_path / "whole"})
    alone, whole = files_of(tmp_path / "alone" / "out"), files_of(tmp_path / "whole")
    assert alone.keys() == whole.keys()
    assert len(alone) > 30
    assert [name for name in alone if alone[name] != whole[name]] == []


def test_each_missing_library_is_named_with_what_installs_it(tmp_path):
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    names = [re.match(r"[\w-]+", line)[0] for line in dependencies["dependencies"]]
    lines = [
        "import importlib.util, numpy as np, texbake", "from texbake.mesh.shapes import cube",
        f"found = [n for n in {names} if importlib.util.find_spec(n.replace('-', '_'))]",
        "assert found == ['numpy'], found", "low = cube()", "for name in 'a.toml', 'uvs.png':",
        "    (out / name).write_bytes(b'\\x89PNG\\r\\n\\x1a\\n')",
    ]  # fmt: skip
    for need in NEEDS:
        lines += [
            "try:", f"    print('works:', {need})",
            "except texbake.errors.DependencyError as error:", "    print(error)",
        ]  # fmt: skip
    said = tour_alone(tmp_path, "\n".join(lines)).splitlines()
    assert [line.rpartition("pip install ")[2].strip('"') for line in said] == [*NEEDS.values()]
