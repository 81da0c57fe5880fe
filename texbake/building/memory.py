"""How much memory a step is going to take, told from the sizes of its files before it starts.

Figures were measured as the highest resident memory of worker processes (docs/build.md has them),
and rounded up: a step that is thought to need more than it does waits a little longer, one that is
thought to need less may bring the machine down.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from texbake.baking.memory import MB as MB, PROCESS, TEXEL as TEXEL
from texbake.building.step import InputSize, Sizes

# A worker that has loaded everything, with what it does not give back after its steps.
IDLE_WORKER = PROCESS
# A triangle of a mesh that is read.
READ_FACE = 130
# A triangle that is simplified, or laid flat.
SIMPLIFIED_FACE = 300
FLATTENED_FACE = 6_000
# A pixel of a picture, a sample.
PIXEL_SAMPLE = 120


# Bytes of a file a triangle, where no header tells: a little less than files have.
_BYTES_A_FACE = {".obj": 60, ".ply": 24, ".stl": 50, ".off": 40, ".glb": 24, ".gltf": 24}
_PLY_FACES = re.compile(rb"element face (\d+)")


def size_of(path: Path) -> InputSize:
    """Size of a file; its triangles by its header where it has one, else by its length.

    A file that is not there has none: the step that reads it will say so.
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
    """Size of a file of which only name and length are known."""
    suffix = os.path.splitext(name)[1].lower()  # noqa: PTH122  # a URL is no path
    return InputSize(n_bytes, n_bytes // _BYTES_A_FACE[suffix] if suffix in _BYTES_A_FACE else 0)


def faces_of(sizes: Sizes, role: str) -> int:
    """Triangles of all meshes of a role."""
    return sum(size.n_faces for size in sizes.get(role, ()))


def machine_memory() -> int:
    """Memory of this machine in bytes; 8 GB where the system does not tell."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 8 << 30
