"""Which further sets of texture coordinates a glTF primitive has, and what they are called.

The format numbers its sets. A file of texbake has their names in the `extras` of its meshes, by the
names of the attributes: `"extras": {"TEXCOORD_1": "lightmap"}`.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from texbake.mesh.files.gltf_document import Document
from texbake.mesh.uv_sets import require_few_sets

_PREFIX = "TEXCOORD_"
_FURTHER = re.compile(f"{_PREFIX}[0-9]{{1,9}}")


def further_sets(document: Document, primitive: dict[str, Any]) -> list[int]:
    """Numbers of the sets of texture coordinates of a primitive after the first."""
    numbers = sorted(
        int(key[len(_PREFIX) :])
        for key in document.mapping(primitive, "attributes")
        if key.startswith(_PREFIX) and _FURTHER.fullmatch(key) and int(key[len(_PREFIX) :]) > 0
    )
    require_few_sets(len(numbers), str(document.path))
    return numbers


def uv_set_names(
    document: Document, mesh: dict[str, Any], numbers: Collection[int]
) -> dict[int, str]:
    """Names of sets of texture coordinates: those in the `extras` of the mesh, else attributes."""
    extras = mesh.get("extras")
    given = extras if isinstance(extras, dict) else {}
    names: dict[int, str] = {}
    for number in numbers:
        name = given.get(f"TEXCOORD_{number}")
        names[number] = f"TEXCOORD_{number}"
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            continue
        if name not in names.values():
            names[number] = name
    return names
