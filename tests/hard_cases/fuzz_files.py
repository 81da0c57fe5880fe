"""Mutations of valid files through every reader, in a process of its own with bounded memory.

    python tests/hard_cases/fuzz_files.py [FORMAT ...] [--bytes 1000000] [--minutes 0] [--seed 0]
        [--skip FORMAT]

Each mutant must be read, or refused with a TexbakeError of one line, within `SECONDS`. The mutant
at hand is kept in the folder given, so that a file that ends the process can be examined. Prints a
line of JSON for each format, with its result.
"""

from __future__ import annotations

import argparse
import faulthandler
import io
import json
import resource
import signal
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

SECONDS = 5  # for one file of a few kilobytes, on a machine that does other things as well
MEMORY = 3 << 30  # bytes of address space beyond those of the process with all readers loaded
MAX_FAULTS = 5

Maker = Callable[[Path], None]
Reader = Callable[[Path], Any]


class HangError(BaseException):
    """A file took longer than `SECONDS`; no reader that catches any `Exception` may hide it."""


def _mesh_seed(path: Path) -> None:
    from texbake import corner_tangents, write_mesh
    from texbake.mesh.shapes import uv_sphere

    ball = uv_sphere(4, 6)
    ball = ball.replace(normals=ball.positions, normal_faces=ball.faces)
    write_mesh(ball.replace(tangents=corner_tangents(ball)), path)


def _ascii_ply_seed(path: Path) -> None:
    from texbake.mesh.shapes import uv_sphere

    ball = uv_sphere(4, 6)
    header = ["ply", "format ascii 1.0", f"element vertex {ball.n_vertices}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {ball.n_faces}", "property list uchar int vertex_indices"]
    rows = [" ".join(map(str, row)) for row in ball.positions.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in ball.faces.tolist()]
    path.write_text("\n".join([*header, "end_header", *rows, ""]))


def _ascii_stl_seed(path: Path) -> None:
    from texbake.mesh.shapes import cube

    lines = ["solid cube"]
    for corners in cube().positions[cube().faces].tolist():
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid cube", ""]))


def _gltf_seed(path: Path) -> None:
    """JSON with its buffer inside, from the chunks of a GLB file."""
    import base64
    import struct

    from texbake import write_mesh
    from texbake.mesh.shapes import uv_sphere

    whole = path.with_suffix(".glb")
    write_mesh(uv_sphere(3, 4), whole)
    content = whole.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    document = json.loads(content[20 : 20 + length])
    body = base64.b64encode(content[28 + length :]).decode()
    document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{body}"
    path.write_text(json.dumps(document))


def _fbx_seed(version: int, form: str) -> Maker:
    def make(path: Path) -> None:
        from fbx_writer import rich_scene, written

        path.write_bytes(written(rich_scene(version), version, form))

    return make


def _image_seed(channels: int, bits: int) -> Maker:
    def make(path: Path) -> None:
        from texbake import write_image

        values = np.random.default_rng(1).random((48, 40, channels)).astype(np.float32)
        write_image(values, path, bits=bits, metadata={"texbake:space": "tangent"})

    return make


def _hits_seed(path: Path) -> None:
    from texbake import BakeOptions, bake
    from texbake.baking.hits_file import write_hits
    from texbake.mesh.shapes import uv_sphere

    ball = uv_sphere(4, 6)
    write_hits(bake(ball, ball, BakeOptions(size=8, keep_hits=True)), path)


def _text_seed(text: str) -> Maker:
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
PROFILE = "# radius height\n" + "\n".join(
    f"{1.5 + np.sin(i / 9.0):.6f}, {i / 50.0:.5e}" for i in range(150)
)
PATCHES = "\n".join(
    f"{i / 3.0:.20f} {j / 3.0:.20f} {(i - 1) * (j - 2) / 9.0:.20f}"
    for i in range(4)
    for j in range(4)
)


def _read_mesh(path: Path) -> Any:
    from texbake import read_mesh

    return read_mesh(path)


def _read_image(path: Path) -> Any:
    from texbake import read_image

    return read_image(path, color=True)


def _read_scene(path: Path) -> Any:
    from texbake import read_scene

    return read_scene(path)


def _read_matrix(path: Path) -> Any:
    from texbake.mapping.classical.projector import read_matrix

    return read_matrix(path)


def _read_profile(path: Path) -> Any:
    from texbake.mesh.parametric.sources import read_profile

    return read_profile(path)


def _read_patches(path: Path) -> Any:
    from texbake.mesh.parametric.sources import read_patches

    return read_patches(path)


def _read_hits(path: Path) -> Any:
    from texbake import BakeOptions
    from texbake.baking.hits_file import read_hits
    from texbake.baking.remap import remap_hits

    # Accepted values must not make kernels fail either.
    return remap_hits(read_hits(path), BakeOptions(maps=("normal", "displacement")))


def _read_pipeline(path: Path) -> Any:
    from texbake.building.file import read_pipeline

    return read_pipeline(path)


FORMATS: dict[str, tuple[str, Maker, Reader]] = {
    "obj": (".obj", _mesh_seed, _read_mesh),
    "ply binary": (".ply", _mesh_seed, _read_mesh),
    "ply ascii": (".ply", _ascii_ply_seed, _read_mesh),
    "stl binary": (".stl", _mesh_seed, _read_mesh),
    "stl ascii": (".stl", _ascii_stl_seed, _read_mesh),
    "off": (".off", _mesh_seed, _read_mesh),
    "glb": (".glb", _mesh_seed, _read_mesh),
    "gltf": (".gltf", _gltf_seed, _read_mesh),
    "fbx binary": (".fbx", _fbx_seed(7400, "binary"), _read_mesh),
    "fbx binary 64": (".fbx", _fbx_seed(7700, "binary"), _read_mesh),
    "fbx binary 6": (".fbx", _fbx_seed(6100, "binary"), _read_mesh),
    "fbx ascii": (".fbx", _fbx_seed(7400, "ascii"), _read_mesh),
    "fbx ascii 6": (".fbx", _fbx_seed(6100, "ascii"), _read_mesh),
    "glb scene": (".glb", _mesh_seed, _read_scene),
    "gltf scene": (".gltf", _gltf_seed, _read_scene),
    "png 8": (".png", _image_seed(3, 8), _read_image),
    "png 16": (".png", _image_seed(1, 16), _read_image),
    "exr": (".exr", _image_seed(3, 16), _read_image),
    "tiff": (".tif", _image_seed(3, 16), _read_image),
    "tga": (".tga", _image_seed(3, 8), _read_image),
    "hdr": (".hdr", _image_seed(3, 32), _read_image),
    "jpeg": (".jpg", _image_seed(3, 8), _read_image),
    "scene": (".toml", _text_seed(SCENE), _read_scene),
    "matrix": (".txt", _text_seed(MATRIX), _read_matrix),
    "profile": (".txt", _text_seed(PROFILE), _read_profile),
    "patches": (".txt", _text_seed(PATCHES), _read_patches),
    "hits": (".npz", _hits_seed, _read_hits),
    "pipeline": (".toml", _text_seed(PIPELINE), _read_pipeline),
}
# They come last: of many thousand damaged crate files (.usdc, and most .usd and .usdz) one ends the
# process inside usd-core, whose own readers these are.
if find_spec("pxr") is not None:
    FORMATS |= {
        "usda": (".usda", _mesh_seed, _read_mesh),
        "usdc": (".usdc", _mesh_seed, _read_mesh),
        "usd": (".usd", _mesh_seed, _read_mesh),
        "usdz": (".usdz", _mesh_seed, _read_mesh),
    }

# Numbers and words put into text, which readers take for counts, indices and keys.
WORDS = (
    b"-1", b"0", b"1e999", b"nan", b"-inf", b"4294967295", b"9999999999999", b"1e-400", b"\x00",
    b"\xff\xfe", b"'", b"[", b"{}", b"null", b"true", b"\n", b" ", b"//", b"\\\n", b"#", b'"',
)  # fmt: skip


def mutant(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the content with a few changes of one kind or of several."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        kind = int(rng.integers(8))
        at = int(rng.integers(len(data) + 1))
        until = min(len(data), at + int(rng.integers(1, 64)))
        if kind == 0 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1 and at < len(data):
            data[at] = int(rng.integers(256))
        elif kind == 2:
            del data[at:until]
        elif kind == 3:
            data[at:at] = data[at:until]
        elif kind == 4:
            data[at : at + 4] = int(rng.choice([0, 1, 2**31 - 1, 2**32 - 1])).to_bytes(4, "little")
        elif kind == 5:
            data[at:at] = WORDS[int(rng.integers(len(WORDS)))]
        elif kind == 6 and rng.random() < 0.3:
            del data[at:]
        elif kind == 7:
            data[at:until] = data[at:until][::-1]
    return bytes(data)


def zip_mutant(content: bytes, rng: np.random.Generator) -> bytes:
    """Return a zip archive with changes in one of its files, and checksums that fit them."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(changed, "w") as new:
        entries = old.infolist()
        at = int(rng.integers(len(entries)))
        for i, entry in enumerate(entries):
            data = old.read(entry)
            new.writestr(entry, mutant(data, rng) if i == at else data)
    return changed.getvalue()


def _fault(read: Reader, path: Path) -> str | None:
    """Read one file; return what went wrong, or None."""
    from texbake import TexbakeError

    start = time.monotonic()
    signal.alarm(SECONDS)
    try:
        read(path)
    except TexbakeError as error:
        if "\n" in str(error):
            return f"several lines: {error!r}"
    except BaseException as error:  # any other exception is a fault
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = f"{frame.tb_frame.f_code.co_filename}:{frame.tb_lineno}" if frame else "?"
        return f"{type(error).__name__}: {str(error)[:200]} at {where}"
    finally:
        signal.alarm(0)
    # A library that catches everything may have swallowed the alarm.
    taken = time.monotonic() - start
    return f"took {taken:.1f} s" if taken > SECONDS else None


def _hang(*_: object) -> None:
    raise HangError


def fuzz(name: str, *, n_bytes: int, minutes: float, seed: int, folder: Path) -> dict[str, Any]:
    """Read mutants of a format until so many bytes and minutes are spent."""
    suffix, make, read = FORMATS[name]
    path = folder / f"seed{suffix}"
    make(path)
    content = path.read_bytes()
    read(path)  # loads all that is needed, and shows that the seed is valid
    _bound_memory()
    signal.signal(signal.SIGALRM, _hang)
    rng = np.random.default_rng([seed, *name.encode()])
    candidate = folder / f"mutant{suffix}"
    end = time.monotonic() + 60.0 * minutes
    faults: list[str] = []
    n_read, n_files = 0, 0
    while (n_read < n_bytes or time.monotonic() < end) and len(faults) < MAX_FAULTS:
        # Checksums keep most damage from the readers of the files in an archive.
        inside = content.startswith(b"PK") and rng.random() < 0.5
        data = zip_mutant(content, rng) if inside else mutant(content, rng)
        candidate.write_bytes(data)
        n_read += len(data)
        n_files += 1
        fault = _fault(read, candidate)
        if fault is not None:
            faults.append(fault)
            (folder / f"fault{len(faults)}{suffix}").write_bytes(data)
    return {"format": name, "files": n_files, "bytes": n_read, "faults": faults}


def _bound_memory() -> None:
    """Bound the address space by what is there now, the readers loaded, and `MEMORY` more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))


def main() -> int:
    """Parse the command line and print what was found; return 1 if that is any fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("format", nargs="*", help=", ".join(FORMATS))
    parser.add_argument("--bytes", type=int, default=1_000_000)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--skip", action="append", default=[], help="a format to leave out")
    options = parser.parse_args()
    faulthandler.enable()
    warnings.simplefilter("error")
    home = options.folder or Path(tempfile.mkdtemp())
    n_faults = 0
    for name in options.format or FORMATS:
        if name in options.skip:
            continue
        folder = home / name.replace(" ", "_")
        folder.mkdir(exist_ok=True)
        found = fuzz(
            name,
            n_bytes=options.bytes,
            minutes=options.minutes,
            seed=options.seed,
            folder=folder,
        )
        n_faults += len(found["faults"])
        print(json.dumps(found), flush=True)
    return 1 if n_faults else 0


if __name__ == "__main__":
    sys.exit(main())
