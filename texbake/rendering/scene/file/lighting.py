"""Lights, environment, fog and ambient light of a scene file."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from pydantic import PlainValidator, ValidationInfo, WithJsonSchema

from texbake.errors import OptionError
from texbake.rendering.scene.file.faults import fault, shown
from texbake.rendering.scene.file.tables import described, list_of, made, switched, table
from texbake.rendering.scene.file.textures import ImageOnly
from texbake.rendering.scene.file.values import FILE, Vector, choice, existing_file
from texbake.rendering.scene.lights import (
    FOG_MODES,
    GATES,
    KINDS,
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Shadow,
)
from texbake.rendering.studio import STUDIO_ROOM

# Keys that only some kinds of light use.
_READ_BY = {
    "position": ("point", "spot"),
    "direction": ("directional", "spot"),
    "target": ("directional", "spot"),
    "up": ("spot",),
    "angle": ("spot",),
    "blend": ("spot",),
    "decay": ("point", "spot"),
    "profile": ("spot",),
    "gate": ("spot",),
    "aspect": ("spot",),
}


ShadowTable = table(Shadow, switchable=True)


def _light(kind: str, target: tuple[float, ...] | None = None, **given: Any) -> Light:
    for key in [*given, *(["target"] if target is not None else [])]:
        if kind not in _READ_BY.get(key, (kind,)):
            raise OptionError(f"{key}: a {kind} light does not use it; leave it out")
    if kind != "directional" and "position" not in given:
        raise OptionError(f"position: it is missing; a {kind} light needs one")
    if target is not None:
        if "direction" in given:
            raise OptionError("direction: it conflicts with the target; give only one")
        start = given.get("position", (0.0, 0.0, 0.0))
        given["direction"] = tuple(b - a for a, b in zip(start, target, strict=True))
    return Light(kind=kind, **given)


LightTable = table(
    Light,
    {
        "kind": choice(KINDS),
        "shadow": switched(ShadowTable, Shadow),
        "profile": ImageOnly,
        "gate": choice(GATES),
    },
    required=("kind",),
    more={
        "target": described(
            Vector, "Point that the light shines at, in place of its direction; world space."
        )
    },
)


def _faces(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, list) or len(value) != 6:
        raise fault(f"{shown(value)} is not a list of six files: +x, -x, +y, -y, +z, -z")
    return tuple(existing_file(name, info) for name in value)


def _room_or_file(value: Any, info: ValidationInfo) -> Any:
    return value if value == STUDIO_ROOM else existing_file(value, info)


_SIX_FILES = {"type": "array", "items": FILE, "minItems": 6, "maxItems": 6}
EnvironmentTable = table(
    Environment,
    {
        "image": Annotated[Any, PlainValidator(_room_or_file), WithJsonSchema(FILE)],
        "faces": Annotated[Any, PlainValidator(_faces), WithJsonSchema(_SIX_FILES)],
    },
)
AmbientTable = table(Ambient)
FogTable = table(Fog, {"mode": choice(FOG_MODES)})
OcclusionTable = table(AmbientOcclusion)


def _named(lights: list[Light]) -> tuple[Light, ...]:
    """Give lights without a name a distinct one."""
    return tuple(
        replace(light, name=f"{light.kind} {i + 1}") if light.name == Light.name else light
        for i, light in enumerate(lights)
    )


Lights = list_of(made(LightTable, _light), _named)
EnvironmentOf = made(EnvironmentTable, Environment)
AmbientOf = made(AmbientTable, Ambient)
FogOf = made(FogTable, Fog)
OcclusionOf = made(OcclusionTable, AmbientOcclusion)
