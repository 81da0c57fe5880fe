"""The tasks, by name: to add one, write it in a module of its subject and list it here."""

from __future__ import annotations

from texbake.study.bench.task import BenchTask
from texbake.study.bench.tasks.baking import AO_TASK, DISPLACEMENT_TASK, NORMALS_TASK
from texbake.study.bench.tasks.meshes import SIMPLIFY_TASK, UNWRAP_TASK
from texbake.study.bench.tasks.pictures import PREVIEW_TASK

__all__ = ["TASKS"]

TASKS: dict[str, BenchTask] = {
    task.name: task
    for task in (
        NORMALS_TASK, DISPLACEMENT_TASK, AO_TASK, UNWRAP_TASK, SIMPLIFY_TASK, PREVIEW_TASK,
    )
}  # fmt: skip
