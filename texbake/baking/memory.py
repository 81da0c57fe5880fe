"""How much memory a bake is estimated to take, and how large the chunks of a dense mesh may be.

Figures were measured as the highest resident memory of processes, and rounded up.
"""

from __future__ import annotations

import re

from texbake.errors import OptionError

MB = 1 << 20
# A process that has loaded everything, with what it does not give back.
PROCESS = 320 * MB
# A triangle of a mesh that is read and held with its normals, and of one in a ray tree.
HELD_FACE = 100
TREE_FACE = 160
# A texel of a map that is baked, with its padding.
TEXEL = 100
# Smaller chunks only take longer: their trees are small beside the mesh itself.
MOST_CHUNKS = 8

_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)i?b?", re.IGNORECASE)
_UNITS = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


def parse_bytes(text: str | int) -> int:
    """Bytes of an amount of memory.

    >>> parse_bytes("1.5G"), parse_bytes("512 MiB"), parse_bytes(4096)
    (1610612736, 536870912, 4096)

    Raises
    ------
    OptionError
        It is none, or 0.
    """
    found = _SIZE.fullmatch(str(text).strip())
    amount = 0 if found is None else int(float(found[1]) * _UNITS[found[2].lower()])
    if amount < 1:
        raise OptionError(f"max-memory: {text!r} is no amount of memory; give one such as 8G")
    return amount


def bake_memory(n_high_faces: int, n_low_faces: int, n_texels: int, n_maps: int) -> int:
    """Bytes that a bake takes if the dense mesh is in one ray tree.

    Parameters
    ----------
    n_low_faces
        Of the light mesh and a cage.
    n_texels, n_maps
        Texels of each map, and how many maps.
    """
    faces = (HELD_FACE + TREE_FACE) * n_high_faces + HELD_FACE * n_low_faces
    return PROCESS + faces + TEXEL * n_texels * max(n_maps, 1)


def chunk_faces(most: int, whole: int, n_high_faces: int) -> int | None:
    """Faces of the dense mesh in one ray tree at a time; None for all of them.

    Parameters
    ----------
    most, whole
        Bytes that may be taken, and that one tree over everything takes in all. What cannot be
        kept to with `MOST_CHUNKS` chunks is exceeded.
    """
    if whole <= most:
        return None
    room = (most - whole) // TREE_FACE + n_high_faces
    return max(room, -(-n_high_faces // MOST_CHUNKS))
