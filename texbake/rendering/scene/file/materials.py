"""Materials of a scene file: slots, and effects such as normal maps and reflections."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import PlainValidator, ValidationInfo, WithJsonSchema

from texbake.errors import FileError, OptionError
from texbake.mapping.classical.projector import read_matrix, whole_matrix
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.file.tables import described, list_of, made, table
from texbake.rendering.scene.file.textures import (
    AmountSlot,
    ColorSlot,
    ImageOnly,
    Texture,
    UnitSlot,
)
from texbake.rendering.scene.file.values import (
    FILE,
    Number,
    Vector,
    existing_file,
    format_value,
    is_number,
    validation_error,
)
from texbake.rendering.scene.material import (
    BumpMap,
    Displacement,
    Material,
    NormalMap,
    Parallax,
    ProjectedTexture,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.textures import ImageTexture
from texbake.rendering.scene.transforms import projector_matrix

NormalMapTable = table(
    NormalMap,
    {"texture": ImageOnly},
    short="texture",
)
BumpMapTable = table(
    BumpMap,
    {"texture": Texture},
    short="texture",
)
DisplacementTable = table(Displacement, {"texture": Texture}, short="texture")
ParallaxTable = table(Parallax, {"texture": ImageOnly}, short="texture")
ReflectionTable = table(Reflection, {"strength": ColorSlot}, short="strength")
RefractionTable = table(Refraction, {"strength": ColorSlot}, short="strength")


def _matrix(value: Any, info: ValidationInfo) -> FloatArray:
    """(4, 4): matrix from sixteen numbers row by row, from four rows, or from a file."""
    return _read(value, info, projector=False)


def _projector_matrix(value: Any, info: ValidationInfo) -> FloatArray:
    """(4, 4): as `_matrix`, or from the twelve numbers of the rows s, t and q."""
    return _read(value, info, projector=True)


def _read(value: Any, info: ValidationInfo, *, projector: bool) -> FloatArray:
    if isinstance(value, str):
        try:
            return np.array(read_matrix(existing_file(value, info), projector=projector))
        except FileError as error:
            raise validation_error(str(error)) from error
    flat = [
        number
        for row in (value if isinstance(value, list) else [])
        for number in (row if isinstance(row, list) else [row])
    ]
    if len(flat) not in ((12, 16) if projector else (16,)) or not all(map(is_number, flat)):
        numbers = "12 or 16" if projector else "16"
        raise validation_error(
            f"{format_value(value)} is neither {numbers} numbers, row by row, nor a file of them"
        )
    rows = np.array(flat, np.float64).reshape(-1, 4)
    return np.array(whole_matrix(rows.tolist()))


_NUMBER = {"type": "number"}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 4, "maxItems": 4}


def _schema(n_rows: tuple[int, ...]) -> WithJsonSchema:
    flat = [
        {"type": "array", "items": _NUMBER, "minItems": 4 * n, "maxItems": 4 * n} for n in n_rows
    ]
    rows = {"type": "array", "items": _ROW, "minItems": min(n_rows), "maxItems": max(n_rows)}
    return WithJsonSchema({"anyOf": [*flat, rows, FILE]})


Matrix = Annotated[Any, PlainValidator(_matrix), _schema((4,))]
ProjectorMatrix = Annotated[Any, PlainValidator(_projector_matrix), _schema((4, 3))]


def _projected(
    texture: ImageTexture, matrix: FloatArray | None = None, **given: Any
) -> ProjectedTexture:
    options = {
        name: given.pop(name) for name in ("strength", "facing", "occlusion") if name in given
    }
    if matrix is not None:
        if given:
            raise OptionError(f"{min(given)}: it conflicts with the matrix; give only one")
        return ProjectedTexture(texture=texture, matrix=matrix, **options)
    for name in "position", "target":
        if name not in given:
            raise OptionError(f"{name}: it is missing; give position and target, or a matrix")
    of_aspect = partial(projector_matrix, **given)
    return ProjectedTexture(
        texture=texture, matrix=of_aspect() if "aspect" in given else of_aspect, **options
    )


ProjectedTable = table(
    ProjectedTexture,
    {"texture": ImageOnly},
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

MaterialTable = table(
    Material,
    {
        "base_color": ColorSlot,
        "specular": ColorSlot,
        "exponent": AmountSlot,
        "gloss": UnitSlot,
        "roughness": UnitSlot,
        "metalness": UnitSlot,
        "emission": ColorSlot,
        "occlusion": UnitSlot,
        "opacity": UnitSlot,
        "light_map": ColorSlot,
        "normal_map": made(NormalMapTable, NormalMap),
        "bump_map": made(BumpMapTable, BumpMap),
        "displacement": made(DisplacementTable, Displacement),
        "parallax": made(ParallaxTable, Parallax),
        "reflection": made(ReflectionTable, Reflection),
        "refraction": made(RefractionTable, Refraction),
        "projected": list_of(made(ProjectedTable, _projected)),
    },
    without=("name",),
)
MaterialOf = made(MaterialTable, Material)
