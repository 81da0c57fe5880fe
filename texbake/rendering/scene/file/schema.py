"""The whole of a scene file, and what each of its tables becomes.

`TABLES` names the tables, for the documentation to be held against.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainValidator, create_model

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
    list_of,
    made,
    table,
)
from texbake.rendering.scene.file.textures import ImageTable, ProcedureTable
from texbake.rendering.scene.file.values import Text, color_of, is_number
from texbake.rendering.scene.scene import View
from texbake.texture.encoding import encode_srgb

# Of `RenderOptions`, what is the camera's, of bare meshes alone, or asked of one picture.
NOT_IN_RENDER = ("view", "fov", "base_color", "max_error", "time_budget")


def _angles(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in (2, 3) or not all(map(is_number, value)):
        raise fault(f"{shown(value)} is not [azimuth, elevation] nor with a distance as third")
    if len(value) == 3 and not value[2] > 0:
        raise fault(f"{shown(value)} has a distance that is not above 0")
    return tuple(map(float, value))


def _view(view: tuple[float, ...] | None = None, **given: Any) -> View:
    return View(angles=view, **given)  # type: ignore[arg-type]


def _background(value: Any) -> tuple[float, ...] | None:
    """SRGB-coded color, as `RenderOptions` has it; None for no background."""
    if value == "transparent":
        return None
    return tuple(min(channel, 1.0) for channel in encode_srgb(color_of(value)).tolist())


def _checked_render(**given: Any) -> dict[str, Any]:
    RenderOptions(**given)
    return given


CameraTable = table(
    View, name="Camera", without=("angles",), more={"view": Annotated[Any, PlainValidator(_angles)]}
)
RenderTable = table(
    RenderOptions,
    {"background": Annotated[Any, PlainValidator(_background)]},
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
    name=(Text, None),
    camera=(made(CameraTable, _view), None),
    render=(made(RenderTable, _checked_render), None),
    ambient=(AmbientOf, None),
    environment=(EnvironmentOf, None),
    fog=(FogOf, None),
    ambient_occlusion=(OcclusionOf, None),
    lights=(Lights, ()),
    materials=(dict[str, MaterialOf], Field(default_factory=dict)),
    objects=(list_of(ObjectTable, _some), ...),
)

# Each table, by the heading that documents it.
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
    "normal_map": NormalMapTable,
    "bump_map": BumpMapTable,
    "displacement": DisplacementTable,
    "parallax": ParallaxTable,
    "reflection": ReflectionTable,
    "refraction": RefractionTable,
    "projected": ProjectedTable,
}
