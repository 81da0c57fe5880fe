"""What the file of a map says of itself: one JSON object in its image description.

PNG, TIFF, EXR, JPEG and TGA files each have some place for a line of text, and only that in common.
A map's facts go there as a flat JSON object, the same in every format, so that numbers come back
exactly as they were.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

Value = float | int | str

# "opengl" or "directx": which way the green channel of a tangent-space normal map points.
CONVENTION = "texbake:convention"
# "tangent", "object" or "world": the space of a map's vectors.
SPACE = "texbake:space"
# A displacement d of a stored value h is (h - mid) * scale, in model units.
DISPLACEMENT_MID = "texbake:displacement_mid"
DISPLACEMENT_SCALE = "texbake:displacement_scale"
# A mean curvature of a stored value h is (h - mid) * scale, in one by model units.
CURVATURE_MID = "texbake:curvature_mid"
CURVATURE_SCALE = "texbake:curvature_scale"
# A thickness of a stored value h is h * scale, in model units.
THICKNESS_SCALE = "texbake:thickness_scale"
# A coordinate of a stored value h is min + h (max - min); three numbers with spaces between them.
POSITION_MIN = "texbake:position_min"
POSITION_MAX = "texbake:position_max"
# Followed by what stands in the file, a number or a color such as #e0a030: the name of a thing.
ID = "texbake:id:"


def to_description(metadata: Mapping[str, Value]) -> str:
    """Return the facts as one line of ASCII, the same for the same facts; "" for none.

    >>> to_description({"texbake:space": "tangent", "texbake:displacement_mid": 0.5})
    '{"texbake:displacement_mid":0.5,"texbake:space":"tangent"}'
    """
    if not metadata:
        return ""
    return json.dumps(dict(metadata), sort_keys=True, separators=(",", ":"))


def from_description(description: str) -> dict[str, Value]:
    """Return the facts in a description; none where it is not one that `to_description` made.

    >>> from_description("a photograph of gravel")
    {}
    """
    try:
        # TGA breaks its comment into lines of 80 characters; JSON strings hold no bare line break.
        facts = json.loads(description.replace("\n", ""))
    except (ValueError, RecursionError):
        return {}
    if not isinstance(facts, dict):
        return {}
    return {key: value for key, value in facts.items() if isinstance(value, float | int | str)}
