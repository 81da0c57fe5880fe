"""The state of each step: what its result depends on, whether it is stored, and if not, why.

Also how much memory it will take, estimated from the sizes of its files.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any

from texbake import __version__
from texbake.building.digests import Digests, checksum
from texbake.building.graph import FileSource, Id, Node, Source
from texbake.building.locations import is_url
from texbake.building.store import (
    DamagedError,
    Ingredients,
    Manifest,
    Store,
    output_digest,
    stored_files,
)
from texbake.building.task import Task, TaskInput
from texbake.errors import FileError
from texbake.files import replacing
from texbake.records import dataclass
from texbake.verbs.step import InputSize, Settings, StepKind

# States in which a step has ended ...
CURRENT, BUILT, FAILED, BLOCKED = "current", "built", "failed", "blocked"
# ... and those before.
WAITING, QUEUED, RUNNING = "waiting", "queued", "running"
ENDED = frozenset({CURRENT, BUILT, FAILED, BLOCKED})


@dataclass(eq=False)
class StepState:
    """One step of one asset during a build."""

    node: Node
    state: str = WAITING
    key: str = ""  # known once all steps before it have results
    # inputs and ingredients, known once the key is
    inputs: dict[str, tuple[TaskInput, ...]] = field(default_factory=dict)
    ingredients: Ingredients = field(default_factory=dict)
    manifest: Manifest | None = None  # of its result
    reasons: list[str] = field(default_factory=list)  # why it runs
    notes: list[str] = field(default_factory=list)  # what happened on the way
    error: str = ""
    trace: str = ""
    seconds: float = 0.0  # that it took in this build
    attempts: int = 0


class Resolver:
    """Finds what steps depend on, and changes since the keys of the last build in `path`."""

    def __init__(
        self, states: Mapping[Id, StepState], store: Store, digests: Digests, path: Path
    ) -> None:
        self.store, self.digests = store, digests
        self._states, self._path = states, path
        self._keys: dict[str, dict[str, str]] = {}
        with suppress(OSError, ValueError, AttributeError, TypeError, RecursionError):
            for asset, steps in json.loads(path.read_bytes()).items():
                self._keys[asset] = {step: str(key) for step, key in steps.items()}

    def save(self) -> None:
        """Write what the next build needs to know: the keys of steps with results, and digests."""
        for (asset, step), state in self._states.items():
            if state.manifest is not None:
                self._keys.setdefault(asset, {})[step] = state.key
        with replacing(self._path) as temporary:
            temporary.write_text(json.dumps(self._keys), encoding="utf-8")
        keys = {key for steps in self._keys.values() for key in steps.values()}
        self.store.forget_others(keys, self.digests)
        self.digests.save()

    def look(self, state: StepState, *, repair: bool = True) -> bool:
        """Return whether the result of a step is stored; if not, `state.reasons` says why."""
        node = state.node
        state.inputs = {
            role: tuple(map(self._input, sources)) for role, sources in node.inputs.items()
        }
        inputs = {
            role: [_describe_input(item) for item in items] for role, items in state.inputs.items()
        }
        state.ingredients = ingredients_of(node.table.kind, node.table.settings, inputs, node.id[0])
        state.key = checksum(state.ingredients)
        try:
            manifest = self.store.find(state.key)
            if manifest is not None:
                self.store.check(manifest, self.digests, node.outputs)
        except DamagedError as damage:
            state.reasons = [str(damage)]
            state.notes.append(f"its stored result was damaged and was made again: {damage}")
            if repair:
                self.store.remove(state.key)
            return False
        state.manifest = manifest
        if manifest is None:
            state.reasons = self._reasons(state)
        return manifest is not None

    def is_as_before(self, state: StepState) -> bool:
        """Return whether the last build had the same result for a step."""
        return self._key_before(state) == state.key

    def _key_before(self, state: StepState) -> str | None:
        asset, step = state.node.id
        return self._keys.get(asset, {}).get(step)

    def _reasons(self, state: StepState) -> list[str]:
        before = self._key_before(state)
        if before is None:
            return ["it has not run before"]
        if before == state.key:
            return ["its stored result is gone"]
        with suppress(DamagedError, FileError):
            manifest = self.store.find(before)
            if manifest is not None:
                return differences(manifest["ingredients"], state.ingredients)
        return ["what it depends on has changed"]

    def _input(self, source: Source) -> TaskInput:
        if isinstance(source, FileSource):
            return TaskInput(
                called=Path(source.path).name,  # also of a URL
                sha256=self.digests.digest(source.path),
                path=source.path,
                sidecars=tuple(self.digests.sidecars(source.path)),
            )
        maker = self._states[source.node]
        assert maker.manifest is not None
        return TaskInput(
            called=maker.node.outputs[source.output],
            sha256=output_digest(maker.manifest, source.output),
            key=maker.key,
            files=tuple(stored_files(maker.manifest)[source.output]),
        )

    def task(self, state: StepState, threads: int, most_memory: int | None) -> Task:
        """Return the task by which a worker makes the result of a step."""
        node = state.node
        sizes = {role: tuple(map(self._size, items)) for role, items in state.inputs.items()}
        kind = node.table.kind
        return Task(
            asset=node.id[0],
            step=node.id[1],
            kind=kind.name,
            settings=node.table.settings,
            inputs=state.inputs,
            outputs=node.outputs,
            key=state.key,
            ingredients=state.ingredients,
            store=self.store.place,
            threads=threads,
            memory_bytes=kind.memory(node.table.settings, sizes),
            most_memory=most_memory,
        )

    def _size(self, item: TaskInput) -> InputSize:
        if item.path is not None:
            return InputSize(0, 0) if is_url(item.path) else size_of(Path(item.path))
        if self.store.is_local and len(item.files) == 1:
            return size_of(Path(self.store.place) / item.files[0].name)
        return size_by_length(item.files[0].name, sum(file.size for file in item.files))


def _describe_input(item: TaskInput) -> dict[str, Any]:
    """Return what the key of a step contains for an input, with its sidecars."""
    described: dict[str, Any] = {"called": item.called, "sha256": item.sha256}
    if item.sidecars:
        described["with"] = [digest for _, digest in item.sidecars]
    return described


def ingredients_of(
    kind: StepKind, settings: Settings, inputs: Mapping[str, list[dict[str, Any]]], asset: str
) -> Ingredients:
    """Return everything that the result of a step depends on."""
    return {
        "texbake": __version__,
        "step": kind.name,
        "revision": kind.revision,
        "settings": settings,
        "inputs": {role: files for role, files in sorted(inputs.items()) if files},
        **({"asset": asset} if kind.names_asset else {}),
    }


def differences(before: Ingredients, now: Ingredients) -> list[str]:
    """Return what has changed since a step last ran, one phrase each.

    >>> differences({"texbake": "1", "settings": {"size": 1}}, {"texbake": "1", "settings":
    ...     {"size": 2}})
    ['size: 1 before, 2 now']
    """
    changes = []
    for name, called in ("texbake", "the version"), ("revision", "the step itself"):
        if before.get(name) != now.get(name):
            changes.append(f"{called}: {before.get(name)} before, {now.get(name)} now")
    if before.get("step") != now.get("step"):
        changes.append(f"do: {before.get('step')} before, {now.get('step')} now")
    old, new = before.get("settings", {}), now.get("settings", {})
    changes += [
        f"{name}: {json.dumps(old.get(name))} before, {json.dumps(new.get(name))} now"
        for name in sorted({*old, *new})
        if old.get(name) != new.get(name)
    ]
    old, new = before.get("inputs", {}), now.get("inputs", {})
    for role in sorted({*old, *new}):
        if old.get(role) != new.get(role):
            called = ", ".join(file["called"] for file in new.get(role, ()))
            changes.append(f"{role} changed: {called}" if called else f"{role}: no longer given")
    return changes


# Bytes of a file per triangle, a little less than files have, for files without a header.
_BYTES_PER_FACE = {".obj": 60, ".ply": 24, ".stl": 50, ".off": 40, ".glb": 24, ".gltf": 24}
_PLY_FACES = re.compile(rb"element face (\d+)")


def size_of(path: Path) -> InputSize:
    """Size of a file, 0 if missing; its triangles by its header, else estimated by its length."""
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
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # the system does not say
        memory = 8 << 30
    return min([memory, *_group_limits()])


def _group_limits(
    groups: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> list[int]:
    """Limits of the control groups, of both versions, of this process and around them."""
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
