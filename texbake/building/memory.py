"""How much memory a step will take at most, estimated before it starts from the sizes of its files.

The figures were measured as the highest resident memory of worker processes (docs/build.md lists
them) and rounded up: a step that is overestimated waits a little longer, one that is underestimated
may exhaust the machine.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

from texbake.baking.memory import MB, PROCESS, TEXEL, bake_memory
from texbake.verbs.step import READ_FACE, InputSize, Settings, Sizes

# Bytes of a worker that has loaded everything, with what it keeps between steps.
IDLE_WORKER = PROCESS
# ... and of the small triangles that displacement divides a mesh into.
_DISPLACED_FACE = 150
# Bytes per sample of a picture.
PIXEL_SAMPLE = 120
# Bytes of floats per byte of a compressed image: decoded; with mip levels; decoded and converted.
_DECODED = 40
_CONVERTED = 80
# What a page holds of a high-poly mesh and of maps at once.
_PAGE = 400 * MB

# Bytes of a file per triangle, a little less than files have, for files without a header.
_BYTES_PER_FACE = {".obj": 60, ".ply": 24, ".stl": 50, ".off": 40, ".glb": 24, ".gltf": 24}
_PLY_FACES = re.compile(rb"element face (\d+)")


def size_of(path: Path) -> InputSize:
    """Return the size of a file; its triangles by its header, else estimated by its length.

    A missing file has size 0: the step that reads it reports that.
    """
    try:
        n_bytes = path.stat().st_size
        if path.suffix.lower() == ".ply":
            with path.open("rb") as file:
                counted = _PLY_FACES.search(file.read(4096))
            if counted:
                return InputSize(n_bytes, int(counted[1]))
    except OSError:
        return InputSize(0, 0)
    return size_by_length(path.name, n_bytes)


def size_by_length(name: str, n_bytes: int) -> InputSize:
    """Return the size of a file of which only name and length are known."""
    suffix = os.path.splitext(name)[1].lower()  # noqa: PTH122  # a URL is no path
    per_face = _BYTES_PER_FACE.get(suffix)
    return InputSize(n_bytes, 0 if per_face is None else n_bytes // per_face)


def _faces(sizes: Sizes, *roles: str) -> int:
    return sum(size.n_faces for role in roles for size in sizes.get(role, ()))


def _bytes(sizes: Sizes, *roles: str) -> int:
    return sum(size.n_bytes for role in roles for size in sizes.get(role, ()))


def _texels(settings: Settings) -> int:
    side = settings["size"]
    return int(side[0] * side[1] if isinstance(side, list) else side * side)


def check_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for checking a mesh or a pair."""
    faces = _faces(sizes, "mesh", "low")
    return int(IDLE_WORKER + 2 * READ_FACE * faces + TEXEL * _texels(settings))


def maps_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for baking maps without a memory limit."""
    n_low = _faces(sizes, "low", "cage")
    return bake_memory(_faces(sizes, "high"), n_low, _texels(settings), settings["maps"])


def texture_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for baking a procedure."""
    return int(IDLE_WORKER + READ_FACE * _faces(sizes, "mesh") + TEXEL * _texels(settings))


def preview_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a picture of a mesh with its maps."""
    samples = settings["width"] * settings["height"] * settings["supersampling"] ** 2
    divided = _DISPLACED_FACE * settings["max_triangles"] if sizes.get("displacement") else 0
    images = _DECODED * _bytes(sizes, "normal_map", "displacement", "albedo")
    mesh = READ_FACE * _faces(sizes, "mesh")
    return int(IDLE_WORKER + 64 * MB + PIXEL_SAMPLE * samples + mesh + images + divided)


def page_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for the page of an asset."""
    images = _CONVERTED * _bytes(sizes, "normal_map", "displacement", "albedo", "misses")
    return int(IDLE_WORKER + _PAGE + images + 2 * READ_FACE * _faces(sizes, "high", "low"))


def export_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for exporting an asset; all roles but `mesh` and `levels` are images."""
    images = [role for role in sizes if role not in ("mesh", "levels")]
    faces = _faces(sizes, "mesh", "levels")
    return IDLE_WORKER + 64 * MB + _CONVERTED * _bytes(sizes, *images) + 2 * READ_FACE * faces


def machine_memory() -> int:
    """Bytes of memory of this machine, or of the control group of its container if that is less."""
    return min([_physical_memory(), *_group_limits()])


def _physical_memory() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # the system does not say
        return 8 << 30


def _group_limits(
    groups: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> list[int]:
    """Return the limits of the control groups of this process, of both versions, and of theirs.

    Within a container the path of its group may lead nowhere; `root` is that group then.
    """
    limits = []
    with suppress(OSError):
        for line in groups.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                top, file = root, "memory.max"
            elif "memory" in controllers.split(","):
                top, file = root / "memory", "memory.limit_in_bytes"
            else:
                continue
            group = top / path.strip("/")
            for folder in (group, *group.parents):
                with suppress(OSError, ValueError):  # "max", for none
                    limits.append(int((folder / file).read_text()))
                if folder == top:
                    break
    return limits
