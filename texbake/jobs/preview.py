"""What `texbake preview` shows: a mesh, a glTF file or a scene, once, around, or in several ways.

A mesh is shown under the light of the studio; so is a scene in which nothing gives light. Options
that name several ways to draw (filters, interpolations, buffers) give one picture of them all side
by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from texbake.errors import OptionError
from texbake.files import PathLike, make_folder
from texbake.mesh.files import read_mesh
from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import prepare
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, side_by_side
from texbake.rendering.render import draw_picture
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Environment
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.studio_room import STUDIO_ROOM
from texbake.rendering.scene.view import camera_of, turntable_cameras
from texbake.rendering.studio import STUDIO, studio_scene
from texbake.texture.image import FloatImage

# Texels a side of the room that metals mirror where a file brings no environment.
_ROOM_SIZE = 128


def open_preview(
    path: PathLike,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    options: Mapping[str, Any] | None = None,
    progress: ProgressSink | None = None,
) -> tuple[Scene, RenderOptions]:
    """Read what is to be shown, and how.

    Parameters
    ----------
    path
        A mesh, a glTF file or a `.toml` scene. A glTF file is shown with its own materials, unless
        maps are given; then it is a mesh like any other.
    normal_map, displacement, albedo
        Of a mesh, as in `texbake.rendering.render.render`.
    options
        Fields of `RenderOptions` that stand above those of the scene's file.
    progress
        Told of the reading.

    Raises
    ------
    OptionError
        Maps are given for a scene, which has its own.
    TexbakeError
        As `read_mesh` and `read_scene` do.
    """
    maps: dict[str, Any] = {
        "normal_map": normal_map,
        "displacement": displacement,
        "albedo": albedo,
    }
    given = [name for name, source in maps.items() if source is not None]
    suffix = Path(path).suffix.lower()
    if suffix == ".toml" and given:
        raise OptionError(f"{given[0]}: a scene has its own materials; name the map in {path}")
    changes = dict(options or {})
    if suffix == ".toml" or (suffix in (".glb", ".gltf") and not given):
        scene = with_light(read_scene(path, progress=progress))
        if "view" in changes:  # stands above the camera of the file
            scene = replace(scene, view=None)
        return scene, scene.options(**changes)
    chosen = replace(RenderOptions(), **changes)
    mesh = read_mesh(path, progress=progress)
    return studio_scene(mesh, **maps, options=chosen), chosen


def with_light(scene: Scene) -> Scene:
    """Return the scene, under the light of the studio if nothing lights its surfaces.

    What gives off light itself, or is unlit, lights nothing else. Light maps hold the light of a
    scene.

    Where a material is a metal, it is the room of the studio instead, which metals mirror.
    """
    lighting = scene.lighting
    materials = [item.material for item in scene.objects]
    shines = (
        lighting.lights
        or any(lighting.ambient.color)
        or any(lighting.ambient.ground or ())
        or lighting.environment is not None
        or any(item.light_map is not None for item in materials)
    )
    if shines or all(item.shading == "unlit" for item in materials):
        return scene
    if any(item.metalness != 0.0 for item in materials):
        room = Environment(image=STUDIO_ROOM, size=_ROOM_SIZE, background=False, lighting=True)
        return replace(scene, lighting=replace(lighting, environment=room))
    return replace(scene, lighting=replace(lighting, lights=STUDIO.lights, ambient=STUDIO.ambient))


def turntable_files(folder: PathLike, n_views: int) -> list[Path]:
    """Names of the pictures of a turn, in their order.

    >>> [file.name for file in turntable_files("frames", 2)]
    ['000.png', '001.png']
    """
    digits = max(3, len(str(n_views - 1)))
    return [Path(folder) / f"{index:0{digits}d}.png" for index in range(n_views)]


def write_turntable(
    scene: Scene,
    options: RenderOptions,
    n_views: int,
    folder: PathLike,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw one turn about the scene's middle into a folder, as `000.png`, `001.png` ...

    The folder is made if missing; each file in it appears whole or not at all.

    Returns
    -------
    Frame
        The last one.

    Raises
    ------
    FileError
        The folder cannot be written.
    TexbakeError
        As `texbake.rendering.render.render_scene` does.
    """
    path = make_folder(folder)
    prepared = prepare(scene, options, threads=threads)
    cameras = turntable_cameras(scene, options, n_views)
    stages = Stages(progress)
    with stages.stage("turn", total=n_views, unit="pictures") as advance:
        for file, camera in zip(turntable_files(path, n_views), cameras, strict=True):
            frame = draw_picture(prepared, camera)
            frame.write(file, threads=threads)
            advance(1)
    return frame


def side_by_side_options(
    options: RenderOptions,
    *,
    filters: Sequence[str] = (),
    interpolations: Sequence[str] = (),
    buffers: Sequence[str] = (),
) -> list[tuple[str, RenderOptions]]:
    """Every combination of what was named, each with a caption.

    Raises
    ------
    OptionError
        A name is not known.
    """
    ways = {"filter": filters, "interpolation": interpolations, "buffer": buffers}
    several = {name: tuple(choices) for name, choices in ways.items() if choices}
    combined = []
    for choice in product(*several.values()):
        changes: dict[str, Any] = dict(zip(several, choice, strict=True))
        combined.append((", ".join(choice), replace(options, **changes)))
    return combined


def render_side_by_side(
    scene: Scene,
    ways: Sequence[tuple[str, RenderOptions]],
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> tuple[FloatImage, list[Frame]]:
    """Draw a scene in several ways, and lay the pictures in a row.

    Returns
    -------
    color : (H, W, 3) float32
        Linear light, with a caption below each picture.
    frames : list of Frame
        The pictures themselves.
    """
    frames = []
    for _, options in ways:
        prepared = prepare(scene, options, threads=threads)
        frames.append(
            draw_picture(prepared, camera or camera_of(scene, options), progress=progress)
        )
    panels = [
        Panel(frame.color, caption, "") for frame, (caption, _) in zip(frames, ways, strict=True)
    ]
    shown = np.ones(frames[0].coverage.shape, bool)
    return side_by_side(panels, shown), frames
