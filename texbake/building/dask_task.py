"""What runs on a worker of a Dask cluster: questions about it, and tasks within its memory."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import Any

from texbake import __version__
from texbake.building.store import Store
from texbake.building.task import FAILED, LOST, TaskOutcome, run_task
from texbake.errors import TexbakeError

# Share of its memory that the steps on a worker may take; Dask pauses a worker at 0.8.
_MEMORY_SHARE = 0.75


def version_here() -> str:
    """Return the version of texbake on a worker."""
    return __version__


def processors_here() -> int:
    """Return the number of processors of a worker's machine."""
    return os.cpu_count() or 1


def sees(place: str, mark: str) -> bool:
    """Whether a worker finds the mark of a build in its store."""
    try:
        return Store(place).has(mark)
    except TexbakeError:
        return False


def run_here(values: dict[str, Any], max_memory: int | None, mark: str) -> dict[str, Any]:
    """Run a task on a worker; the outcome is `lost` if the worker is not fit for the build.

    The task may take `max_memory` bytes.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    if values["version"] != __version__ or not sees(values["store"], mark):
        return asdict(TaskOutcome(status=LOST, error=f"{worker.address} is not fit for it"))
    limit = worker.memory_manager.memory_limit
    own = int(_MEMORY_SHARE * limit / worker.state.nthreads) if limit else None
    limits = [most for most in (own, max_memory) if most is not None]
    outcome = run_task({**values, "most_memory": min(limits, default=None)})
    if outcome["status"] == FAILED:
        outcome["error"] += f" (on {worker.address})"
    return outcome
