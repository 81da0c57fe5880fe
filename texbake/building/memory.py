"""Sizes of files, from which steps estimate how much memory they will take, and of the machine."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

from texbake.verbs.step import InputSize

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
    """Return the limits of the control groups of this process and of the groups around them.

    Both versions of control groups are read. Within a container the path of its group may lead
    nowhere; `root` is that group then.
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
