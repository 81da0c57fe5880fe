"""How much memory the system has for this process, and an error where it needs more.

Linux promises more memory than there is. A process that takes too much is killed when it uses what
it was promised, without a word. One with a limit on its data gets an error from `malloc` instead,
and can say what did not fit.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

# Share of the memory that one process may take: the rest is for libraries, tables of the system,
# and the process that has started this one.
_SHARE = 0.95
_NEAR = 0.5  # share of a limit


def machine_memory() -> int:
    """Return the bytes of memory that this process and those that it starts may use together.

    That of the machine, or less where the system limits it: in a control group, as containers have
    one, or by `ulimit`. 8 GB if the system does not report it.
    """
    most = min([_physical_memory(), *_group_limits(), *_process_limits("RLIMIT_AS")])
    # A greater limit on data is that of `limit_own_memory`.
    return min(
        [most, *(data for data in _process_limits("RLIMIT_DATA") if data < _most_data(most))]
    )


def limit_own_memory() -> None:
    """Make this process, and those that it starts, run out of memory before the system kills them.

    What they take beyond that is a `MemoryError`. Only on Linux, and only where `ulimit -d` sets no
    limit. For programs; it is not for a library to change the limits of a process.
    """
    if sys.platform != "linux":
        return
    import resource

    if _process_limits("RLIMIT_AS") or _process_limits("RLIMIT_DATA"):
        # OpenBLAS, which NumPy loads, takes 30 MB for each thread, prints five lines and interrupts
        # the process if it does not get them.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if soft == resource.RLIM_INFINITY:
        with suppress(OSError, ValueError):  # above the hard limit
            resource.setrlimit(resource.RLIMIT_DATA, (_most_data(machine_memory()), hard))


def came_near_limit(status: Path = Path("/proc/self/status")) -> bool:
    """Whether this process has ever had half of the memory that a limit lets it have.

    One that has not cannot have run out of it. True where the system does not say.
    """
    limits = [*_process_limits("RLIMIT_AS"), *_process_limits("RLIMIT_DATA")]
    with suppress(OSError, ValueError, IndexError, MemoryError):
        peak = int(status.read_text().split("VmPeak:")[1].split()[0]) << 10
        return any(peak > _NEAR * limit for limit in limits)
    return True


def _most_data(memory: int) -> int:
    return int(_SHARE * memory) + _swap()


def _physical_memory() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 8 << 30


def _swap(meminfo: Path = Path("/proc/meminfo")) -> int:
    with suppress(OSError, ValueError, IndexError):
        return int(meminfo.read_text().split("SwapTotal:")[1].split()[0]) << 10
    return 0


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


def _process_limits(kind: str) -> list[int]:
    """Return a limit of `ulimit`, which holds for each process by itself; none without one."""
    try:
        import resource
    except ImportError:  # Windows
        return []
    limit = resource.getrlimit(getattr(resource, kind))[0]
    return [] if limit == resource.RLIM_INFINITY else [limit]
