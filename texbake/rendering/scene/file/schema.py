"""The tables of a scene file, and the scene that they become.

`TABLES` lists the tables by their headings in the documentation.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, ValidationInfo, create_model

from texbake.errors import FileFormatError, OptionError, first_few
from texbake.files import PathLike
from texbake.limits import toml_content
from texbake.progress import Progress
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.file.materials import (
    ImageTable,
    MaterialOf,
    MaterialTable,
    ProcedureTable,
    ProjectedTable,
    TransmissionTable,
    VolumeTable,
)
from texbake.rendering.scene.file.objects import MappingTable, ObjectMaker, ObjectTable
from texbake.rendering.scene.file.tables import (
    Table,
    built_by,
    described,
    file_schema,
    list_of,
    switchable_by,
    table,
    table_of,
)
from texbake.rendering.scene.file.values import (
    COLOR,
    FILE,
    Place,
    Text,
    Vector,
    at,
    color_of,
    existing_file,
    first_error,
    is_number,
    validation_error,
    value_error,
    value_type,
)
from texbake.rendering.scene.lights import (
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Lighting,
    Shadow,
)
from texbake.rendering.scene.material import (
    BumpMap,
    Displacement,
    NormalMap,
    Parallax,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.scene import CameraView, Scene, check_view
from texbake.rendering.studio import STUDIO_ROOM
from texbake.schema import JsonSchema, option_of
from texbake.texture.encoding import encode_srgb

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


def _light(kind: str, target: tuple[float, ...] | None = None, **values: Any) -> Light:
    for key in [*values, *(["target"] if target is not None else [])]:
        if kind not in _READ_BY.get(key, (kind,)):
            raise OptionError(f"{key}: a {kind} light does not use it; leave it out")
    if kind != "directional" and "position" not in values:
        raise OptionError(f"position: it is missing; a {kind} light needs one")
    if target is not None:
        if "direction" in values:
            raise OptionError("direction: it conflicts with the target; give only one")
        start = values.get("position", (0.0, 0.0, 0.0))
        values["direction"] = tuple(b - a for a, b in zip(start, target, strict=True))
    return Light(kind=kind, **values)


LightTable = table(
    Light,
    {"shadow": switchable_by(ShadowTable, Shadow)},
    required=("kind",),
    more={
        "target": described(
            Vector, "Point that the light shines at, in place of its direction; world space."
        )
    },
)


def _faces(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, list) or len(value) != 6:
        raise value_error(value, "is not a list of six files: +x, -x, +y, -y, +z, -z")
    return tuple(existing_file(name, info) for name in value)


def _room_or_file(value: Any, info: ValidationInfo) -> Any:
    return value if value == STUDIO_ROOM else existing_file(value, info)


_SIX_FILES = {"type": "array", "items": FILE, "minItems": 6, "maxItems": 6}
EnvironmentTable = table(
    Environment, {"image": value_type(_room_or_file, FILE), "faces": value_type(_faces, _SIX_FILES)}
)
AmbientTable = table(Ambient)
FogTable = table(Fog)
OcclusionTable = table(AmbientOcclusion)


def _name_lights(lights: list[Light]) -> tuple[Light, ...]:
    """Give lights without a name a distinct one."""
    return tuple(
        replace(light, name=f"{light.kind} {i + 1}") if light.name == Light.name else light
        for i, light in enumerate(lights)
    )


Lights = list_of(built_by(LightTable, _light), _name_lights)
EnvironmentOf = built_by(EnvironmentTable, Environment)
AmbientOf = built_by(AmbientTable, Ambient)
FogOf = built_by(FogTable, Fog)
OcclusionOf = built_by(OcclusionTable, AmbientOcclusion)


# Render options that are not keys of [render]: for the camera, for bare meshes or per picture.
NOT_IN_RENDER = ("view", "fov", "base_color", "max_error", "time_budget")


def _angles(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) not in (2, 3) or not all(map(is_number, value)):
        raise value_error(
            value, "is neither [azimuth, elevation] nor [azimuth, elevation, distance]"
        )
    if len(value) == 3 and not value[2] > 0:
        raise value_error(value, "has a distance that is not above 0")
    return tuple(map(float, value))


def _view(view: tuple[float, ...] | None = None, **values: Any) -> CameraView:
    return CameraView(angles=view, **values)  # type: ignore[arg-type]


def _background(value: Any) -> tuple[float, ...] | None:
    """SRGB-coded color as in `RenderOptions`; None for no background."""
    if value == "transparent":
        return None
    return tuple(min(channel, 1.0) for channel in encode_srgb(color_of(value)).tolist())


def _check_render(**values: Any) -> dict[str, Any]:
    RenderOptions(**values)
    return values


_ANGLES = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}
CameraTable = table(
    CameraView,
    name="Camera",
    without=("angles",),
    more={"view": described(value_type(_angles, _ANGLES), option_of(RenderOptions, "view").help)},
)
_BACKGROUND = {"anyOf": [{"const": "transparent"}, *COLOR["anyOf"]]}
RenderTable = table(
    RenderOptions,
    {
        "background": described(
            value_type(_background, _BACKGROUND),
            "Color behind the objects, or transparent. Default: dark gray.",
        )
    },
    name="Render",
    without=NOT_IN_RENDER,
)


def _some(objects: list[Table]) -> list[Table]:
    if not objects:
        raise validation_error("it is empty; a scene needs at least one object")
    return objects


SceneTable: type[Table] = create_model(
    "SceneFile",
    __base__=Table,
    __doc__="A scene: its objects, materials, lights and camera, and how it is drawn.",
    name=(described(Text, "Name of the scene."), None),
    camera=(described(built_by(CameraTable, _view), "Where the scene is seen from."), None),
    render=(described(built_by(RenderTable, _check_render), "How the picture is drawn."), None),
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
    """JSON Schema of scene files, draft 2020-12, for completion and validation in editors."""
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
    "normal_map": table_of(NormalMap),
    "bump_map": table_of(BumpMap),
    "displacement": table_of(Displacement),
    "parallax": table_of(Parallax),
    "reflection": table_of(Reflection),
    "refraction": table_of(Refraction),
    "transmission": TransmissionTable,
    "projected": ProjectedTable,
}


def parse_scene(path: PathLike, text: bytes, *, progress: Progress = None) -> Scene:
    """Parse the content of a scene file."""
    place = Place(Path(path).parent)
    try:
        content = toml_content(path, text.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not a scene file; it is not text in UTF-8") from error
    try:
        found: Any = SceneTable.model_validate(content, context=place)
    except ValidationError as error:
        raise FileFormatError(f"{path}: {first_error(error)}") from error
    materials = {name: replace(material, name=name) for name, material in found.materials.items()}
    maker = ObjectMaker(path, materials, progress)
    objects = tuple(item for i, each in enumerate(found.objects) for item in maker.build(i, each))
    scene = Scene(
        objects=objects,
        lighting=Lighting(
            lights=found.lights,
            ambient=found.ambient or Ambient(),
            environment=found.environment,
            occlusion=found.ambient_occlusion,
            fog=found.fog,
        ),
        view=found.camera,
        name=found.name or Path(path).name,
        render=found.render or {},
        notes=first_few(maker.notes),
        files=tuple(dict.fromkeys([*place.files, *maker.files])),
    )
    with at(path, "camera"):
        check_view(scene)
    return scene
