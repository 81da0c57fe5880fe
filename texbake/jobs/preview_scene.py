"""What a preview draws: a scene from any file, with a light and with the materials that it has.

A mesh is lit by the studio, and so is a scene without lights. Pictures in this light are exposed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.mesh.files import read_mesh
from texbake.mesh.files.source import parsed_once
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.lights import Environment
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene
from texbake.rendering.studio import STUDIO, STUDIO_ROOM, studio_scene

if TYPE_CHECKING:
    from texbake.mesh.materials import Materials

_MODELS = (".glb", ".gltf")
_WITHOUT_MATERIALS = (".ply", ".stl", ".off")
# Texels along one side of the room that metals reflect if a file has no environment.
_ROOM_SIZE = 128


def open_preview(
    path: PathLike,
    options: Mapping[str, Any] | None = None,
    *,
    maps: Mapping[str, PathLike] | None = None,
    space: str | None = None,
    own_materials: bool = True,
    progress: ProgressSink | None = None,
) -> tuple[Scene, RenderOptions]:
    """Read a scene to draw, and the options to draw it with.

    `maps` (`normal_map`, `displacement`, `albedo`) replace the materials of a mesh file. Without
    `own_materials` these are left out even if there is no map. `space` is that of the normal map.
    """
    files: dict[str, Any] = {**(maps or {})}
    suffix = Path(path).suffix.lower()
    if suffix == ".toml" and files:
        name = next(iter(files))
        raise OptionError(f"{name}: a scene has its own materials; name the map in {path}")
    if space is not None and "normal_map" not in files:
        raise OptionError("space: it needs a normal map; give `normal_map` as well")
    changes = dict(options or {})
    as_mesh = bool(files) or not own_materials
    if suffix == ".toml" or (suffix in _MODELS and not as_mesh):
        scene = read_scene(path, progress=progress)
        if suffix in _MODELS and changes.get("back_faces") is not None:
            scene = _with_sides_as_asked(scene)
    else:
        chosen = replace(RenderOptions(), **changes)
        with parsed_once():
            mesh = read_mesh(path, progress=progress)
            materials = None if as_mesh else _materials(path, mesh)
        if materials is None:
            scene = studio_scene(mesh, **files, space=space, options=chosen)
            return scene, _exposing(chosen)
        # Imported here, so that files without materials do not load it.
        from texbake.rendering.scene.read import scene_from_materials

        scene = _with_sides_as_asked(scene_from_materials(mesh, materials))
        scene = replace(scene, name=mesh.name, files=(Path(path),))
    if "view" in changes:  # overrides the camera of the file
        scene = replace(scene, view=None)
    lit, options_of_scene = with_lighting(scene), scene.options(**changes)
    return lit, options_of_scene if lit is scene else _exposing(options_of_scene)


def _materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Return the materials of a mesh file, or the colors of its vertices; None without either."""
    if mesh.colors is None and Path(path).suffix.lower() in _WITHOUT_MATERIALS:
        return None
    # Imported here, so that meshes without materials do not load it.
    from texbake.texture.model_materials import model_materials

    found = model_materials(path, mesh)
    if found is None or not (found.has_vertex_colors or any(m.channels for m in found.materials)):
        return None
    return found


def _exposing(options: RenderOptions) -> RenderOptions:
    """Return options that expose the picture, unless `exposure` is set."""
    return replace(options, exposure=options.exposure or "auto")


def _with_sides_as_asked(scene: Scene) -> Scene:
    """Return a scene in which the options, not the materials, choose the sides to draw."""
    objects = tuple(
        replace(item, material=replace(item.material, double_sided=None)) for item in scene.objects
    )
    return replace(scene, objects=objects)


def with_lighting(scene: Scene) -> Scene:
    """Return the scene, lit by the studio if nothing lights its surfaces.

    Emissive and unlit materials light nothing else; light maps count as lighting. If a material is
    a metal, the room of the studio lights the scene instead, so that the metal has something to
    reflect.
    """
    lighting = scene.lighting
    materials = [item.material for item in scene.objects]
    is_lit = (
        lighting.lights
        or any(lighting.ambient.color)
        or any(lighting.ambient.ground or ())
        or lighting.environment is not None
        or any(item.light_map is not None for item in materials)
    )
    if is_lit or all(item.shading == "unlit" for item in materials):
        return scene
    if any(item.metalness != 0.0 for item in materials):
        room = Environment(image=STUDIO_ROOM, size=_ROOM_SIZE, background=False, lighting=True)
        return replace(scene, lighting=replace(lighting, environment=room))
    return replace(scene, lighting=replace(lighting, lights=STUDIO.lights, ambient=STUDIO.ambient))
