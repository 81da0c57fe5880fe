"""The tables of a scene file, and the objects that they become.

`TABLES` lists the tables by their headings in the documentation.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema, create_model

from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.file.faults import fault, shown
from texbake.rendering.scene.file.lighting import (
    AmbientOf,
    AmbientTable,
    EnvironmentOf,
    EnvironmentTable,
    FogOf,
    FogTable,
    Lights,
    LightTable,
    OcclusionOf,
    OcclusionTable,
    ShadowTable,
)
from texbake.rendering.scene.file.materials import (
    BumpMapTable,
    DisplacementTable,
    MaterialOf,
    MaterialTable,
    NormalMapTable,
    ParallaxTable,
    ProjectedTable,
    ReflectionTable,
    RefractionTable,
)
from texbake.rendering.scene.file.objects import MappingTable, ObjectTable
from texbake.rendering.scene.file.tables import (
    Table,
    described,
    file_schema,
    list_of,
    made,
    table,
)
from texbake.rendering.scene.file.textures import ImageTable, ProcedureTable, VolumeTable
from texbake.rendering.scene.file.values import COLOR, Text, color_of, is_number
from texbake.rendering.scene.scene import CameraView
from texbake.schema import JsonSchema, option
from texbake.texture.encoding import encode_srgb

# Render options that are not keys of [render]: for the camera, for bare meshes or per picture.
NOT_IN_RENDER = ("view", "fov", "base_color", "max_error", "time_budget")


def _angles(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in (2, 3) or not all(map(is_number, value)):
        raise fault(f"{shown(value)} is not [azimuth, elevation] nor with a distance as third")
    if len(value) == 3 and not value[2] > 0:
        raise fault(f"{shown(value)} has a distance that is not above 0")
    return tuple(map(float, value))


def _view(view: tuple[float, ...] | None = None, **given: Any) -> CameraView:
    return CameraView(angles=view, **given)  # type: ignore[arg-type]


def _background(value: Any) -> tuple[float, ...] | None:
    """SRGB-coded color as in `RenderOptions`; None for no background."""
    if value == "transparent":
        return None
    return tuple(min(channel, 1.0) for channel in encode_srgb(color_of(value)).tolist())


def _checked_render(**given: Any) -> dict[str, Any]:
    RenderOptions(**given)
    return given


_ANGLES = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}
CameraTable = table(
    CameraView,
    name="Camera",
    without=("angles",),
    more={
        "view": described(
            Annotated[Any, PlainValidator(_angles), WithJsonSchema(_ANGLES)],
            option(RenderOptions, "view").help,
        )
    },
)
_BACKGROUND = {"anyOf": [{"const": "transparent"}, *COLOR["anyOf"]]}
RenderTable = table(
    RenderOptions,
    {
        "background": described(
            Annotated[Any, PlainValidator(_background), WithJsonSchema(_BACKGROUND)],
            "Color behind the objects, or transparent. Default: dark gray.",
        )
    },
    name="Render",
    without=NOT_IN_RENDER,
)


def _some(objects: list[Table]) -> list[Table]:
    if not objects:
        raise fault("it is empty; a scene needs at least one object")
    return objects


SceneTable: type[Table] = create_model(
    "SceneFile",
    __base__=Table,
    __doc__="A scene: its objects, materials, lights and camera, and how it is drawn.",
    name=(described(Text, "Name of the scene."), None),
    camera=(described(made(CameraTable, _view), "Where the scene is seen from."), None),
    render=(described(made(RenderTable, _checked_render), "How the picture is drawn."), None),
    ambient=(described(AmbientOf, "Light that comes from everywhere alike."), None),
    environment=(described(EnvironmentOf, "A panorama or cube map around the scene."), None),
    fog=(described(FogOf, "Fog between the objects and the camera."), None),
    ambient_occlusion=(
        described(OcclusionOf, "Darkening where surfaces lie close to one another."),
        None,
    ),
    lights=(described(Lights, "The lights of the scene."), ()),
    materials=(
        described(dict[str, MaterialOf], "Materials that objects can name."),
        Field(default_factory=dict),
    ),
    objects=(described(list_of(ObjectTable, _some), "The objects of the scene."), ...),
)


def scene_schema() -> JsonSchema:
    """JSON Schema of scene files, draft 2020-12, for completion and validation in editors.

    Returns
    -------
    dict
        JSON values, for `json.dumps`.
    """
    return file_schema(SceneTable, "texbake scene")


# Tables by their headings in the documentation.
TABLES: dict[str, type[Table]] = {
    "the file": SceneTable,
    "[camera]": CameraTable,
    "[render]": RenderTable,
    "[ambient]": AmbientTable,
    "[environment]": EnvironmentTable,
    "[fog]": FogTable,
    "[ambient_occlusion]": OcclusionTable,
    "[[lights]]": LightTable,
    "shadow": ShadowTable,
    "[[objects]]": ObjectTable,
    "mapping": MappingTable,
    "[materials.NAME]": MaterialTable,
    "an image": ImageTable,
    "a procedure": ProcedureTable,
    "a volume": VolumeTable,
    "normal_map": NormalMapTable,
    "bump_map": BumpMapTable,
    "displacement": DisplacementTable,
    "parallax": ParallaxTable,
    "reflection": ReflectionTable,
    "refraction": RefractionTable,
    "projected": ProjectedTable,
}
