"""Metadata of maps: one JSON object in the image description of the file.

A line of text is all that PNG, TIFF, EXR, JPEG and TGA files can all store. The metadata of a map
is a flat JSON object there, the same in every format, so that numbers are preserved exactly.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

Value = float | int | str

# "opengl" (+Y) or "directx" (-Y): the green channel of a tangent-space normal map.
CONVENTION = "texbake:convention"
# "tangent", "object" or "world": the space of a map's vectors.
SPACE = "texbake:space"
# A stored value h is the displacement (h - mid) * scale, in model units.
DISPLACEMENT_MID = "texbake:displacement_mid"
DISPLACEMENT_SCALE = "texbake:displacement_scale"
# A stored value h is the mean curvature (h - mid) * scale, in 1 / model units.
CURVATURE_MID = "texbake:curvature_mid"
CURVATURE_SCALE = "texbake:curvature_scale"
# A stored value h is the thickness h * scale, in model units.
THICKNESS_SCALE = "texbake:thickness_scale"
# A stored value h is the coordinate min + h (max - min); three numbers separated by spaces.
POSITION_MIN = "texbake:position_min"
POSITION_MAX = "texbake:position_max"
# Followed by a value in the map, a number or a color such as #e0a030: the name of its object.
ID = "texbake:id:"


def to_description(metadata: Mapping[str, Value]) -> str:
    """Return metadata as one line of ASCII with sorted keys; "" if it is empty.

    >>> to_description({"texbake:space": "tangent", "texbake:displacement_mid": 0.5})
    '{"texbake:displacement_mid":0.5,"texbake:space":"tangent"}'
    """
    if not metadata:
        return ""
    return json.dumps(dict(metadata), sort_keys=True, separators=(",", ":"))


def from_description(description: str) -> dict[str, Value]:
    """Return the metadata in a description; empty if `to_description` did not write it.

    >>> from_description("a photograph of gravel")
    {}
    """
    try:
        # TGA breaks its comment into lines of 80 characters; JSON strings have no raw line break.
        facts = json.loads(description.replace("\n", ""))
    except (ValueError, RecursionError):
        return {}
    if not isinstance(facts, dict):
        return {}
    return {key: value for key, value in facts.items() if isinstance(value, float | int | str)}
