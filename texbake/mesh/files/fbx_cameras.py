"""Cameras and lights of FBX files as those of glTF.

A camera of FBX looks along +X of its model and a light shines along -Y, where both of glTF take -Z.
So each gets a node below its model, which undoes the scale of the model as well. An intensity of
100 % is 1 candela, or 1 lux of a directional light: FBX has no unit for it. In files of Blender it
is 1 watt in all directions, or 1 watt per square meter, which become what Blender writes to glTF.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020, for FbxCamera and FbxLight; B. Raiskila,
"ufbx", 2020, for the width of orthographic views.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.files.fbx_scene import FbxObject, FbxScene
from texbake.mesh.mesh import FloatArray
from texbake.mesh.rig import inverse, matrix_field

CAMERA, LIGHT = "Camera", "Light"
_LUMENS_PER_WATT = 683.0
_GREATEST = 1e18  # of numbers that are taken for sound
_MILLIMETERS = 25.4  # of an inch
_WIDTH_OF_ZOOM = 30.0  # units of the file that an orthographic view shows; Blender writes meters
_BOTH, _HORIZONTAL, _VERTICAL = range(3)  # angles that set the field of view; else the lens does
_FIT_VERTICAL, _FIT_HORIZONTAL, _FILL, _OVERSCAN = range(1, 5)  # the side of the film that stays
_LIGHT_TYPES = ("point", "directional", "spot")
# Directions ahead and up in the model.
_AHEAD = {CAMERA: ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), LIGHT: ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0))}
# Names of the cameras of viewports, which files of version 6 have as well.
_OF_VIEWPORT = "Producer "


def views_of(scene: FbxScene, model: FbxObject) -> Iterator[tuple[str, FbxObject]]:
    """Yield the camera or the light of a model, with its kind and what has its properties."""
    items = [*scene.members_of(model.key, "NodeAttribute"), model]
    for item in items:
        if item.kind in _AHEAD and not model.name.startswith(_OF_VIEWPORT):
            yield item.kind, item
            return


def view_node(kind: str, above: FloatArray) -> dict[str, Any] | None:
    """Fields of a node below a model with a (4, 4) matrix to the scene; None for a flat one."""
    to_model = inverse(above)
    if to_model is None:
        return None
    ahead, up = (pm.matvec(above[:3, :3], np.array(axis)) for axis in _AHEAD[kind])
    z = -ahead / pm.norm(ahead)
    x = np.cross(up, z)
    x /= pm.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    matrix[:3, 3] = above[:3, 3]
    return matrix_field(pm.matmul(to_model, matrix))


def read_camera(scene: FbxScene, item: FbxObject) -> dict[str, Any]:
    """Read a camera as glTF has it."""
    meters = float(pm.norm(scene.axes[:3, 0]))
    near, far = (
        _positive(item, name, default) * meters
        for name, default in (("NearPlane", 10.0), ("FarPlane", 4000.0))
    )
    view: dict[str, float] = {"znear": near, **({"zfar": far} if far > near else {})}
    width = _positive(item, "AspectWidth", _positive(item, "AspectW", 320.0))
    height = _positive(item, "AspectHeight", _positive(item, "AspectH", 200.0))
    aspect = width / height * _positive(item, "PixelAspectRatio", 1.0)
    fit = _whole(item, "GateFit", 0)
    if _whole(item, "CameraProjectionType", 0) == 1:
        size = 0.5 * _positive(item, "OrthoZoom", 1.0)
        if not scene.creator.startswith("Blender"):
            size *= _WIDTH_OF_ZOOM * meters
        is_width = _keeps_width(fit, aspect, 1.0) is not False
        sides = (size, size / aspect) if is_width else (size * aspect, size)
        name, view = "orthographic", {**dict(zip(("xmag", "ymag"), sides, strict=True)), **view}
    else:
        x, y = _slopes(item)
        keeps_width = _keeps_width(fit, aspect, x / y)
        if keeps_width is not None:
            x, y = (x, x / aspect) if keeps_width else (y * aspect, y)
        angle = 2.0 * float(pm.arctan2(y, 1.0))
        name, view = "perspective", {"aspectRatio": x / y, "yfov": angle, **view}
    return {"type": name, name: view, **({"name": item.name} if item.name else {})}


def _keeps_width(fit: int, aspect: float, of_film: float) -> bool | None:
    """Whether the width of the film stays in a picture; None where the whole film does."""
    if fit in (_FILL, _OVERSCAN):
        return (aspect > of_film) == (fit == _FILL)
    return fit == _FIT_HORIZONTAL if fit in (_FIT_VERTICAL, _FIT_HORIZONTAL) else None


def _slopes(item: FbxObject) -> tuple[float, float]:
    """Tangents of half the horizontal and half the vertical field of view of the film."""
    width, height = _positive(item, "FilmWidth", 0.816), _positive(item, "FilmHeight", 0.612)
    width *= _positive(item, "FilmSqueezeRatio", 1.0)
    mode = _whole(item, "ApertureMode", _VERTICAL)
    if mode == _BOTH:
        return _slope(item, "FieldOfViewX", 40.0), _slope(item, "FieldOfViewY", 40.0)
    if mode in (_HORIZONTAL, _VERTICAL):
        slope = _slope(item, "FieldOfView", 25.115)
        return (slope, slope * height / width) if mode == _HORIZONTAL else (
            slope * width / height, slope
        )  # fmt: skip
    lens = 2.0 * _positive(item, "FocalLength", 34.893) / _MILLIMETERS
    return width / lens, height / lens


def _slope(item: FbxObject, name: str, default: float) -> float:
    angle = math.radians(0.5 * min(_positive(item, name, default), 179.0))
    return float(pm.sin(angle)) / float(pm.cos(angle))


def is_shifted(item: FbxObject) -> bool:
    """Whether the film of a camera lies beside its axis, which glTF has no field for."""
    return any(_number(item, f"FilmOffset{axis}", 0.0) != 0.0 for axis in "XY")


def read_light(scene: FbxScene, item: FbxObject) -> dict[str, Any] | None:
    """Read a light as glTF has it; None for areas and volumes."""
    kind = _whole(item, "LightType", 0)
    if kind not in range(len(_LIGHT_TYPES)):
        return None
    brightness = max(_number(item, "Intensity", 100.0), 0.0) / 100.0
    if scene.creator.startswith("Blender"):
        is_sun = _LIGHT_TYPES[kind] == "directional"
        brightness *= _LUMENS_PER_WATT / (1.0 if is_sun else 4.0 * math.pi)
    exposure = min(max(_number(item, "Exposure", 0.0), -64.0), 64.0)
    light: dict[str, Any] = {
        "type": _LIGHT_TYPES[kind],
        "color": [min(max(_number(item, "Color", 1.0, i), 0.0), 1.0) for i in range(3)],
        "intensity": brightness * float(pm.power(2.0, exposure)),
    }
    if light["type"] == "spot":
        outer = min(_positive(item, "OuterAngle", _positive(item, "Cone angle", 45.0)), 180.0)
        inner = max(_number(item, "InnerAngle", _number(item, "HotSpot", 0.0)), 0.0)
        light["spot"] = {
            "innerConeAngle": math.radians(0.5 * min(inner, 0.999 * outer)),
            "outerConeAngle": math.radians(0.5 * outer),
        }
    return {**light, **({"name": item.name} if item.name else {})}


def _number(item: FbxObject, name: str, default: float, place: int = 0) -> float:
    values = item.properties.get(name, ())
    value = values[place] if len(values) > place else default
    is_sound = isinstance(value, int | float) and abs(value) < _GREATEST
    return float(value) if is_sound else default


def _positive(item: FbxObject, name: str, default: float) -> float:
    value = _number(item, name, default)
    return value if value > 1.0 / _GREATEST else default


def _whole(item: FbxObject, name: str, default: int) -> int:
    return int(_number(item, name, default))
