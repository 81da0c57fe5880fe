"""Materials of a scene file: slots, and effects such as normal maps and reflections.

A slot holds a constant, an image or a procedure:

roughness = 0.4
base_color = "#c87533"
base_color = "bricks.png"
base_color = {image = "bricks.png", filter = "ewa", scale = 3}
base_color = {procedure = "marble", seed = 4, colors = ["#111", "#eee"]}
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import Discriminator, PlainValidator, Tag, ValidationInfo, WithJsonSchema

from texbake.errors import FileError, OptionError
from texbake.mapping.classical.projector import read_matrix, whole_matrix
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.file.tables import (
    Table,
    built_by,
    converted_by,
    described,
    list_of,
    read_as,
    table,
)
from texbake.rendering.scene.file.values import (
    COLOR,
    FILE,
    Channel,
    Factor,
    File,
    Files,
    Number,
    Switch,
    Vector,
    choice,
    existing_file,
    is_number,
    key_error,
    linear,
    nearest,
    numbers,
    one_or_two,
    validation_error,
    value_error,
    value_type,
)
from texbake.rendering.scene.material import Material, Transmission
from texbake.rendering.scene.projected import ProjectedTexture, projector_matrix
from texbake.rendering.scene.textures import (
    SPACES,
    WRAPS,
    Constant,
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
    values, parameters = found.set_values(), found.model_extra or {}
    known = PROCEDURE_DEFAULTS[values["procedure"]]
    for key in parameters:
        if key not in known:
            keys = [*known, *ProcedureTable.keys()]
            raise key_error(key, f"unknown key of {values['procedure']}; {nearest(key, keys)}")
    full = checked_parameters(values["procedure"], parameters)
    return ProcedureTexture(**values, parameters={key: full[key] for key in parameters})


ProcedureTable = table(
    ProcedureTexture,
    {"procedure": choice(PROCEDURE_NAMES), "scale": numbers(3, or_one=True), "factor": Factor},
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
Volume = built_by(VolumeTable, VolumeTexture)
ImageOnly = built_by(ImageTable, ImageTexture)
Procedure = converted_by(ProcedureTable, _procedure_texture)


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
        if is_number(value) and low <= value <= high:
            return float(value)
        what = "out of range" if is_number(value) else "not a number"
        raise value_error(value, f"is {what}; give {wanted}, an image or a procedure")

    return check


def _color(value: Any) -> tuple[float, ...]:
    if isinstance(value, str) and value.startswith("#"):
        return linear(value)
    if is_number(value) and value >= 0:
        return (float(value),) * 3
    if isinstance(value, list) and len(value) == 3 and all(is_number(v) and v >= 0 for v in value):
        return tuple(map(float, value))
    raise value_error(
        value,
        "is not a color; give a number, [r, g, b] (linear), "
        "'#rrggbb' (sRGB), an image or a procedure",
    )


def _nothing(value: Any) -> Any:
    raise value_error(value, "is not a texture; give an image or a procedure")


_AMOUNT: JsonSchema = {"type": "number", "minimum": 0}
ColorSlot = _slot(_color, {"anyOf": [_AMOUNT, *COLOR["anyOf"]]})
# A share of something.
UnitSlot = _slot(_number_in(0.0, 1.0), {**_AMOUNT, "maximum": 1})
AmountSlot = _slot(_number_in(0.0, float("inf")), _AMOUNT)
# An image or a procedure.
Texture = _slot(_nothing, {"not": {}})


# Fields of these types are read alike in all classes, unless a table says otherwise.
read_as((ImageTexture,), ImageOnly)
read_as((ImageTexture, ProcedureTexture), Texture)
read_as((*get_args(Constant), ImageTexture, ProcedureTexture), ColorSlot)


_NUMBER: JsonSchema = {"type": "number"}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 4, "maxItems": 4}


def _matrix(*n_rows: int) -> Any:
    """Type of a (4, 4) matrix: numbers row by row, rows, or a file; a projector's may be 3 x 4."""
    counts = [4 * n for n in sorted(n_rows)]
    wanted = " or ".join(map(str, counts))

    def read(value: Any, info: ValidationInfo) -> FloatArray:
        if isinstance(value, str):
            try:
                return np.array(read_matrix(existing_file(value, info), projector=3 in n_rows))
            except FileError as error:
                raise validation_error(str(error)) from error
        flat = [
            number
            for row in (value if isinstance(value, list) else [])
            for number in (row if isinstance(row, list) else [row])
        ]
        if len(flat) not in counts or not all(map(is_number, flat)):
            raise value_error(value, f"is neither {wanted} numbers, row by row, nor a file of them")
        return np.array(whole_matrix(np.array(flat, np.float64).reshape(-1, 4).tolist()))

    schemas: list[JsonSchema] = [
        {"type": "array", "items": _NUMBER, "minItems": 4 * n, "maxItems": 4 * n} for n in n_rows
    ]
    rows = {"type": "array", "items": _ROW, "minItems": min(n_rows), "maxItems": max(n_rows)}
    return value_type(read, {"anyOf": [*schemas, rows, FILE]})


Matrix = _matrix(4)
ProjectorMatrix = _matrix(4, 3)


def _projected(
    texture: ImageTexture, matrix: FloatArray | None = None, **values: Any
) -> ProjectedTexture:
    options = {
        name: values.pop(name) for name in ("strength", "facing", "occlusion") if name in values
    }
    if matrix is not None:
        if values:
            raise OptionError(f"{min(values)}: it conflicts with the matrix; give only one")
        return ProjectedTexture(texture=texture, matrix=matrix, **options)
    for name in "position", "target":
        if name not in values:
            raise OptionError(f"{name}: it is missing; give position and target, or a matrix")
    of_aspect = partial(projector_matrix, **values)
    return ProjectedTexture(
        texture=texture, matrix=of_aspect() if "aspect" in values else of_aspect, **options
    )


ProjectedTable = table(
    ProjectedTexture,
    without=("matrix",),
    more={
        "matrix": described(
            ProjectorMatrix,
            "4 x 4 numbers that take a point of the world to (s, t, r, q) of the picture, or 3 x 4 "
            "to (s, t, q), or their file.",
        ),
        "position": described(Vector, "Position of the projector, without a matrix."),
        "target": described(Vector, "Point that the projector looks at."),
        "up": described(Vector, "Direction that is up in the picture."),
        "fov": described(Number, "Vertical field of view in degrees."),
        "aspect": described(Number, "Width of the picture divided by its height."),
    },
)

TransmissionTable = table(
    Transmission, {"strength": UnitSlot, "thickness": AmountSlot}, short="strength"
)

MaterialTable = table(
    Material,
    {
        "transmission": built_by(TransmissionTable, Transmission),
        "exponent": AmountSlot,
        "gloss": UnitSlot,
        "roughness": UnitSlot,
        "metalness": UnitSlot,
        "occlusion": UnitSlot,
        "opacity": UnitSlot,
        "projected": list_of(built_by(ProjectedTable, _projected)),
    },
    without=("name",),
)
MaterialOf = built_by(MaterialTable, Material)
