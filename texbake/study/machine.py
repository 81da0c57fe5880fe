"""The machine that a study or the bench runs on."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

_CPUS, _MEMORY = Path("/proc/cpuinfo"), Path("/proc/meminfo")


def machine_figures() -> dict[str, Any]:
    """Return system, processor, number of processors, memory and Python, as far as known."""
    figures: dict[str, Any] = {
        "system": platform.system(),
        "processor": platform.machine(),
        "processors": os.cpu_count() or 1,
        "python": platform.python_version(),
    }
    model = _field(_CPUS, "model name")
    if model:
        figures["model"] = model
    memory = _field(_MEMORY, "MemTotal")
    if memory:
        figures["memory_bytes"] = int(memory.split()[0]) * 1024
    return figures


def _field(path: Path, name: str) -> str:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    found = (line.partition(":") for line in lines)
    return next((value.strip() for key, _, value in found if key.strip() == name), "")
