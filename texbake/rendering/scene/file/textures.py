"""The slots of a material in a scene file: constants, images, procedures.

roughness = 0.4
base_color = "#c87533"
base_color = "bricks.png"
base_color = {image = "bricks.png", filter = "ewa", scale = 3}
base_color = {procedure = "marble", seed = 4, colors = ["#111", "#eee"]}
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Discriminator, PlainValidator, Tag, WithJsonSchema

from texbake.rendering.scene.file.tables import Table, converted, made, table
from texbake.rendering.scene.file.values import (
    COLOR,
    Channel,
    Factor,
    File,
    Files,
    Switch,
    choice,
    format_value,
    is_number,
    key_error,
    linear,
    nearest,
    numbers,
    one_or_two,
    validation_error,
)
from texbake.rendering.scene.textures import (
    SPACES,
    WRAPS,
    ImageTexture,
    ProcedureTexture,
    VolumeTexture,
)
from texbake.schema import JsonSchema
from texbake.texture.procedures.options import (
    PROCEDURE_DEFAULTS,
    PROCEDURE_NAMES,
    checked_parameters,
    parameter_schemas,
)

ImageTable = table(
    ImageTexture,
    {
        "image": File,
        "wrap": one_or_two(WRAPS),
        "border": numbers(None, or_one=True),
        "scale": numbers(2, or_one=True),
        "channel": Channel,
        "factor": Factor,
        "color": Switch,
    },
    short="image",
)


def _procedure_texture(found: Table) -> ProcedureTexture:
    given, parameters = found.given(), found.model_extra or {}
    known = PROCEDURE_DEFAULTS[given["procedure"]]
    for key in parameters:
        if key not in known:
            keys = [*known, *ProcedureTable.keys()]
            raise key_error(key, f"unknown key of {given['procedure']}; {nearest(key, keys)}")
    full = checked_parameters(given["procedure"], parameters)
    return ProcedureTexture(**given, parameters={key: full[key] for key in parameters})


ProcedureTable = table(
    ProcedureTexture,
    {
        "procedure": choice(PROCEDURE_NAMES),
        "scale": numbers(3, or_one=True),
        "factor": Factor,
    },
    without=("parameters",),
    takes_more=True,
)
ProcedureTable.further_keys = parameter_schemas()
VolumeTable = table(
    VolumeTexture,
    {
        "volume": Files,
        "space": choice(SPACES[:2]),
        "scale": numbers(3, or_one=True),
        "factor": Factor,
    },
    without=("procedure", "parameters", "filtered", "uv_set"),
)
Volume = made(VolumeTable, VolumeTexture)
ImageOnly = made(ImageTable, ImageTexture)
Procedure = converted(ProcedureTable, _procedure_texture)


def _kind_of(value: Any) -> str:
    """Tag for the form of a slot's value."""
    if isinstance(value, ImageTexture | ProcedureTexture):
        return "<made>"
    if isinstance(value, dict):
        if "volume" in value:
            return "<volume>"
        return "<procedure>" if "procedure" in value and "image" not in value else "<image>"
    is_name = isinstance(value, str) and not value.startswith("#") and "." in value
    return "<image>" if is_name else "<constant>"


def _slot(check: Callable[[Any], Any], schema: JsonSchema) -> Any:
    """Type of a slot; `check` validates its constants and `schema` describes them."""
    return Annotated[
        Annotated[Any, PlainValidator(check), WithJsonSchema(schema), Tag("<constant>")]
        | Annotated[ImageOnly, Tag("<image>")]
        | Annotated[Procedure, Tag("<procedure>")]
        | Annotated[Volume, Tag("<volume>")],
        Discriminator(_kind_of),
    ]


def _number_in(low: float, high: float) -> Callable[[Any], float]:
    wanted = f"one from {low:g} to {high:g}" if high < 1e300 else f"one of {low:g} or more"

    def check(value: Any) -> float:
        if not is_number(value):
            raise validation_error(
                f"{format_value(value)} is not a number; give {wanted}, an image or a procedure"
            )
        if not low <= value <= high:
            raise validation_error(
                f"{format_value(value)} is out of range; give {wanted}, an image or a procedure"
            )
        return float(value)

    return check


def _color(value: Any) -> tuple[float, ...]:
    if isinstance(value, str) and value.startswith("#"):
        return linear(value)
    if is_number(value) and value >= 0:
        return (float(value),) * 3
    if isinstance(value, list) and len(value) == 3 and all(is_number(v) and v >= 0 for v in value):
        return tuple(map(float, value))
    raise validation_error(
        f"{format_value(value)} is not a color; give a number, [r, g, b] (linear), "
        "'#rrggbb' (sRGB), an image or a procedure"
    )


def _nothing(value: Any) -> Any:
    raise validation_error(f"{format_value(value)} is not a texture; give an image or a procedure")


_AMOUNT: JsonSchema = {"type": "number", "minimum": 0}
ColorSlot = _slot(_color, {"anyOf": [_AMOUNT, *COLOR["anyOf"]]})
# A share of something.
UnitSlot = _slot(_number_in(0.0, 1.0), {**_AMOUNT, "maximum": 1})
AmountSlot = _slot(_number_in(0.0, float("inf")), _AMOUNT)
# An image or a procedure.
Texture = _slot(_nothing, {"not": {}})
