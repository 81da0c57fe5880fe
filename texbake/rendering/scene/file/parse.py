"""Parsing the text of a scene file to a `Scene`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from texbake.errors import FileFormatError, first_few
from texbake.files import PathLike
from texbake.limits import toml_content
from texbake.progress import ProgressSink
from texbake.rendering.scene.file.faults import at, first_fault
from texbake.rendering.scene.file.objects import ObjectMaker
from texbake.rendering.scene.file.schema import SceneTable
from texbake.rendering.scene.file.values import Place
from texbake.rendering.scene.lights import Ambient, Lighting
from texbake.rendering.scene.scene import Scene, check_view


def parse_scene(path: PathLike, text: bytes, *, progress: ProgressSink | None = None) -> Scene:
    """Parse the content of a scene file."""
    place = Place(Path(path).parent)
    try:
        content = toml_content(path, text.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not a scene file; it is not text in UTF-8") from error
    try:
        found: Any = SceneTable.model_validate(content, context=place)
    except ValidationError as error:
        raise FileFormatError(f"{path}: {first_fault(error)}") from error
    materials = {name: replace(material, name=name) for name, material in found.materials.items()}
    maker = ObjectMaker(path, materials, progress)
    objects = tuple(item for i, each in enumerate(found.objects) for item in maker.made(i, each))
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
