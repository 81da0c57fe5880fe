"""What a result depends on, as one key: the SHA-256 of all of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from texbake import __version__
from texbake.building.step import Settings, StepKind

Ingredients = dict[str, Any]


def canonical(value: Any) -> bytes:
    """JSON with one way to write each value: keys sorted, no blanks, UTF-8."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode("utf-8", "surrogateescape")


def checksum(value: Any) -> str:
    """SHA-256 of the canonical JSON of a value."""
    return hashlib.sha256(canonical(value)).hexdigest()


def ingredients_of(
    kind: StepKind, settings: Settings, inputs: Mapping[str, list[dict[str, Any]]], asset: str
) -> Ingredients:
    """Everything that the result of a step depends on.

    Parameters
    ----------
    kind, settings
    inputs
        By role, `called` and `sha256` of each file, and `with`, digests of the files that it
        names. Names count, because meshes and reports have
        them.
    asset
        Counts for kinds that use it.
    """
    return {
        "texbake": __version__,
        "step": kind.name,
        "revision": kind.revision,
        "settings": settings,
        "inputs": {role: files for role, files in sorted(inputs.items()) if files},
        **({"asset": asset} if kind.names_asset else {}),
    }


def differences(before: Ingredients | None, now: Ingredients) -> list[str]:
    """What has changed since a step last ran, a phrase each.

    >>> differences({"texbake": "1", "settings": {"size": 1}}, {"texbake": "1", "settings":
    ...     {"size": 2}})
    ['size: 1 before, 2 now']
    """
    if before is None:
        return ["it has not run before"]
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
