"""The state of each step: what its result depends on, whether it is stored, and if not, why.

Also how much memory it will take, estimated from the sizes of its files.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from texbake import __version__
from texbake.building.digests import Digests, checksum
from texbake.building.graph import FileSource, Id, Node, Source
from texbake.building.locations import is_url
from texbake.building.progress import WAITING
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
from texbake.verbs.step import InputSize, Settings, StepKind


@dataclass(eq=False)
class StepState:
    """One step of one asset during a build."""

    node: Node
    state: str = WAITING  # see `progress`
    key: str = ""  # known once all steps before it have results
    ingredients: Ingredients = field(default_factory=dict)
    manifest: Manifest | None = None  # of its result
    reasons: list[str] = field(default_factory=list)  # why it runs
    notes: list[str] = field(default_factory=list)  # what happened on the way
    error: str = ""
    trace: str = ""
    seconds: float = 0.0  # that it took in this build
    attempts: int = 0


class PreviousKeys:
    """Keys that steps had in the last build, from which changes are found."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._keys: dict[str, dict[str, str]] = {}
        with suppress(OSError, ValueError, AttributeError, TypeError, RecursionError):
            for asset, steps in json.loads(path.read_bytes()).items():
                self._keys[asset] = {step: str(key) for step, key in steps.items()}

    def __getitem__(self, step: Id) -> str | None:
        return self._keys.get(step[0], {}).get(step[1])

    def all(self) -> set[str]:
        """Return the keys of all steps of all assets."""
        return {key for steps in self._keys.values() for key in steps.values()}

    def save(self, states: Mapping[Id, StepState]) -> None:
        """Take over the keys of steps with results, and write all keys."""
        for (asset, step), state in states.items():
            if state.manifest is not None:
                self._keys.setdefault(asset, {})[step] = state.key
        with replacing(self._path) as temporary:
            temporary.write_text(json.dumps(self._keys), encoding="utf-8")


class Resolver:
    """Finds what steps depend on, from files and from the results of other steps."""

    def __init__(
        self, states: Mapping[Id, StepState], store: Store, digests: Digests, last: PreviousKeys
    ) -> None:
        self._states, self._store, self.digests, self._last = states, store, digests, last

    def look(self, state: StepState, *, repair: bool = True) -> bool:
        """Return whether the result of a step is stored; if not, `state.reasons` says why."""
        node = state.node
        inputs = {
            role: [self._described(source) for source in sources]
            for role, sources in node.inputs.items()
        }
        state.ingredients = ingredients_of(node.table.kind, node.table.settings, inputs, node.id[0])
        state.key = checksum(state.ingredients)
        try:
            manifest = self._store.find(state.key)
            if manifest is not None:
                self._store.check(manifest, self.digests, node.outputs)
        except DamagedError as damage:
            state.reasons = [str(damage)]
            state.notes.append(f"its stored result was damaged and was made again: {damage}")
            if repair:
                self._store.remove(state.key)
            return False
        state.manifest = manifest
        if manifest is None:
            state.reasons = self._reasons(state)
        return manifest is not None

    def is_as_before(self, state: StepState) -> bool:
        """Return whether the last build had the same result for a step."""
        return self._last[state.node.id] == state.key

    def _reasons(self, state: StepState) -> list[str]:
        before = self._last[state.node.id]
        if before is None:
            return ["it has not run before"]
        if before == state.key:
            return ["its stored result is gone"]
        with suppress(DamagedError, FileError):
            manifest = self._store.find(before)
            if manifest is not None:
                return differences(manifest["ingredients"], state.ingredients)
        return ["what it depends on has changed"]

    def _described(self, source: Source) -> dict[str, Any]:
        if isinstance(source, FileSource):
            described: dict[str, Any] = {
                "called": Path(source.path).name,  # also of a URL
                "sha256": self.digests.digest(source.path),
            }
            # Files that it names are read with it and count as well.
            names = self.digests.sidecars(source.path)
            if names:
                described["with"] = [digest for _, digest in names]
            return described
        maker = self._states[source.node]
        assert maker.manifest is not None
        called = maker.node.outputs[source.output]
        return {"called": called, "sha256": output_digest(maker.manifest, source.output)}

    def task(self, state: StepState, threads: int, most_memory: int | None) -> Task:
        """Return the task by which a worker makes the result of a step."""
        node = state.node
        inputs = {role: tuple(map(self._input, sources)) for role, sources in node.inputs.items()}
        sizes = {role: tuple(map(self._size, sources)) for role, sources in node.inputs.items()}
        kind = node.table.kind
        return Task(
            asset=node.id[0],
            step=node.id[1],
            kind=kind.name,
            settings=node.table.settings,
            inputs=inputs,
            outputs=node.outputs,
            key=state.key,
            ingredients=state.ingredients,
            store=self._store.place,
            threads=threads,
            memory_bytes=kind.memory(node.table.settings, sizes),
            most_memory=most_memory,
        )

    def _input(self, source: Source) -> TaskInput:
        described = self._described(source)
        if isinstance(source, FileSource):
            return TaskInput(
                called=described["called"],
                path=source.path,
                sha256=described["sha256"],
                sidecars=tuple(self.digests.sidecars(source.path)),
            )
        maker = self._states[source.node]
        assert maker.manifest is not None
        files = tuple(stored_files(maker.manifest)[source.output])
        return TaskInput(called=described["called"], key=maker.key, files=files)

    def _size(self, source: Source) -> InputSize:
        if isinstance(source, FileSource):
            return InputSize(0, 0) if is_url(source.path) else size_of(Path(source.path))
        manifest = self._states[source.node].manifest
        assert manifest is not None
        files = stored_files(manifest)[source.output]
        if self._store.is_local and len(files) == 1:
            return size_of(Path(self._store.place) / files[0].name)
        return size_by_length(files[0].name, sum(file.size for file in files))


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
