"""Estimates of the memory that a bake takes.

The figures were measured as the peak resident memory of processes, and rounded up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from texbake.errors import OptionError, quoted

MB = 1 << 20
# A process with all libraries loaded, and the memory that it does not return.
PROCESS = 320 * MB
# Per triangle of a mesh in memory with its normals, and per triangle in the ray tree while it is
# built; 8 remain afterwards. A small tree holds the corners of its triangles as well, and for these
# maps, every tree does.
HELD_FACE = 100
TREE_FACE = 18
CORNERS_FACE = 75
_SMALL_TREE = 1 << 21  # triangles; `raycast/morton_tree.py` counts them in leaves
_SECONDARY = {"ao", "bent-normal", "thickness"}
# Per texel of a map, padding included.
TEXEL = 100
# Per triangle of a chunk that is read from the file: its corners, and the tree over them; and how
# many triangles such a chunk has. Smaller or larger ones only take longer.
STREAMED_FACE = 220
STREAMED_CHUNKS = (1 << 17, 1 << 21)
# More chunks only take longer: their trees are already small compared with the mesh.
MOST_CHUNKS = 8

_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?", re.IGNORECASE)
_PREFIXES = ("", "k", "m", "g", "t")


def parse_bytes(
    text: str | int,
    *,
    option: str = "max_memory",
    what: str = "an amount of memory",
    example: str = "8G",
    thousand: int = 1024,
) -> int:
    """Parse a number of bytes; `thousand` is what k means without an i.

    >>> parse_bytes("1.5G"), parse_bytes("512 MiB"), parse_bytes(4096)
    (1610612736, 536870912, 4096)
    """
    found = _SIZE.fullmatch(str(text).strip())
    amount = 0
    if found is not None:
        step = 1024 if found[3] else thousand
        power = _PREFIXES.index(found[2].lower())
        amount = int(float(found[1]) * math.prod([step] * power))
    if amount < 1:
        raise OptionError(f"{option}: {quoted(text)} is not {what}; give one such as {example}")
    return amount


def bake_memory(n_high_faces: int, n_low_faces: int, n_texels: int, maps: Sequence[str]) -> int:
    """Bytes of a bake with one ray tree, by texels per map and names of maps."""
    n_corners = n_high_faces if _SECONDARY.intersection(maps) else min(n_high_faces, _SMALL_TREE)
    faces = (HELD_FACE + TREE_FACE) * n_high_faces + HELD_FACE * n_low_faces
    faces += CORNERS_FACE * n_corners
    return PROCESS + faces + TEXEL * n_texels * max(len(maps), 1)


def memory_left(limit: str | int | None, needed: int) -> float:
    """Bytes that a limit leaves beside those needed, below 0 if exceeded; infinite without one."""
    return math.inf if limit is None else parse_bytes(limit) - needed
