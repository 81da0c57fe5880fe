"""Lights and cameras of glTF scenes.

A light's intensity is in candela (lux, where it is directional), and a surface reflects the share
1 / pi of what arrives to each side; here the intensity is what a white surface reflects, so that it
is divided by pi. The `range` of a light is not kept: it is an aid for renderers that leave out
lights far away.

Based on: Khronos Group, KHR_lights_punctual, 2020; glTF 2.0 Specification, section 3.10.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from texbake.mesh.files.gltf_document import Document
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.lights import Light, Vector
from texbake.rendering.scene.scene import View

# A cone of half a turn, which glTF allows, is as good as one a little narrower.
_WIDEST = 179.9


def light_of(document: Document, node: dict[str, Any], matrix: FloatArray) -> Light | None:
    """Light of a node, which shines along its -z; None where it has none."""
    extension = document.mapping(document.mapping(node, "extensions"), "KHR_lights_punctual")
    if "light" not in extension:
        return None
    owner = document.mapping(
        document.mapping(document.content, "extensions"), "KHR_lights_punctual"
    )
    index, lights = extension["light"], document.objects(owner, "lights")
    if not isinstance(index, int) or not 0 <= index < len(lights):
        document.fail(f"it has no light {index!r}")
    light = lights[index]
    kind = light.get("type")
    if kind not in ("directional", "point", "spot"):
        document.fail(f"the light type {kind!r} is not known")
    color = document.numbers(light, "color", 3)
    red, green, blue = (1.0, 1.0, 1.0) if color is None else np.maximum(color, 0.0).tolist()
    return Light(
        name=str(light.get("name") or node.get("name") or f"light {index}"),
        kind=kind,
        color=(red, green, blue),
        intensity=_number(document, light, "intensity", 1.0) / math.pi,
        position=_vector(matrix[:3, 3]),
        direction=_vector(-_unit(document, matrix[:3, 2])),
        up=_vector(_unit(document, matrix[:3, 1])),
        **(_cone(document, light) if kind == "spot" else {}),
    )


def _cone(document: Document, light: dict[str, Any]) -> dict[str, Any]:
    spot = document.mapping(light, "spot")
    outer = _number(document, spot, "outerConeAngle", math.pi / 4)
    inner = _number(document, spot, "innerConeAngle", 0.0)
    if not 0.0 <= inner < outer <= math.pi / 2 + 1e-6:
        document.fail(f"a cone from {inner:g} to {outer:g} radians is none")
    return {
        "angle": min(math.degrees(2.0 * outer), _WIDEST),
        "blend": 1.0 - inner / outer,
    }


def view_of(document: Document, node: dict[str, Any], matrix: FloatArray) -> View | str | None:
    """View of a node's camera; why it is none, in words; or None where the node has no camera."""
    if "camera" not in node:
        return None
    camera = document.item("cameras", node["camera"])
    name = camera.get("name") or node.get("name") or node["camera"]
    if camera.get("type") != "perspective":
        return f"the camera {name!r} is {camera.get('type')}; only perspective ones are shown"
    lens = document.mapping(camera, "perspective")
    fov = math.degrees(_number(document, lens, "yfov", 0.0))
    near = _number(document, lens, "znear", 0.0)
    if not (0.0 < fov < 180.0 and near > 0.0):
        document.fail(f"the camera {name!r} has no field of view, or no near plane")
    position = matrix[:3, 3]
    return View(
        position=_vector(position),
        # As far away as it takes to tell the two apart, wherever the camera stands.
        target=_vector(position - _unit(document, matrix[:3, 2]) * (1.0 + np.abs(position).max())),
        up=_vector(_unit(document, matrix[:3, 1])),
        fov=fov,
        near=near,
    )


def _number(document: Document, owner: dict[str, Any], key: str, default: float) -> float:
    value = owner.get(key, default)
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 <= value < math.inf:
        document.fail(f"{key!r} is {value!r}, not a number of 0 or more")
    return float(value)


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _unit(document: Document, direction: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(direction))
    if not 0.0 < length < math.inf:
        document.fail("a node with a light or a camera is scaled to nothing")
    return np.asarray(direction / length)
