"""An asset as the folder that another program reads."""

from __future__ import annotations

from typing import Any

from texbake.building.memory import (
    IDLE_WORKER,
    MB,
    READ_FACE,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.jobs.export.options import ExportOptions

# Maps that a program's material has a place for, by the key of their file.
_MAPS = (
    "normal", "displacement", "base_color", "ao", "roughness", "metalness", "emissive", "opacity",
    "bent_normal",
)  # fmt: skip
# Floats that a byte of a compressed image may become, read and converted.
_INFLATED = 80


def _run(job: Job) -> dict[str, Any]:
    from texbake.jobs.export.export import export_asset
    from texbake.mesh.files import read_mesh

    name = job.settings["name"] or job.asset.rpartition("/")[2]
    options = EXPORT.made({**job.settings, "name": name}, threads=job.threads)
    maps = {role.replace("_", "-"): file for role in _MAPS if (file := job.input(role))}
    mesh, *levels = [read_mesh(path) for path in (job.file("mesh"), *job.inputs.get("levels", ()))]
    result = export_asset(mesh, maps, job.outputs["folder"], options, levels=levels)
    return {
        "bytes": sum(path.stat().st_size for path in result.files),
        "notes": list(result.notes),
    }


def _memory(settings: Settings, sizes: Sizes) -> int:
    # Maps are converted one after another, but those of a packed texture.
    images = [_INFLATED * size.n_bytes for role in _MAPS for size in sizes.get(role, ())]
    faces = faces_of(sizes, "mesh") + faces_of(sizes, "levels")
    return IDLE_WORKER + 64 * MB + sum(images) + 2 * READ_FACE * faces


EXPORT = StepKind(
    name="export",
    does="writes an asset as another program reads it",
    options=ExportOptions,
    inputs=(
        InputRole(name="mesh"),
        InputRole(name="levels", required=False, many=True),
        *(InputRole(name=name, required=False) for name in _MAPS),
    ),
    outputs=lambda settings: {"folder": "export"},
    run=_run,
    revision=2,
    memory=_memory,
    names_asset=True,
)
