"""The scene that a preview draws, with the camera and lights that no file or option sets.

A mesh is lit by the studio, and so is a scene without lights. Pictures in this light are exposed. A
table beside the picture reports which sides and camera were chosen, and warnings say if nothing can
be seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texbake.core import core
from texbake.errors import OptionError, counted
from texbake.files import PathLike
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import read_mesh
from texbake.mesh.files.source import parsed_once
from texbake.mesh.hard_edges import with_sharp_edges
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.topology import surface_side
from texbake.progress import Progress
from texbake.records import dataclass
from texbake.rendering.camera import Camera, fill_picture
from texbake.rendering.material_simplification import is_hidden
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Environment
from texbake.rendering.scene.scene import Scene, camera_of, outline
from texbake.rendering.studio import STUDIO, STUDIO_ROOM, studio_scene
from texbake.texture.encoding import quantize_srgb

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
    progress: Progress = None,
) -> tuple[Scene, RenderOptions]:
    """Read a scene and its options; `maps` replace materials, left out without `own_materials`."""
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
        from texbake.rendering.scene.read import read_scene

        scene = read_scene(path, progress=progress)
        if suffix in _MODELS and changes.get("back_faces") is not None:
            scene = _with_sides_as_asked(scene)
    else:
        chosen = replace(RenderOptions(), **changes)
        with parsed_once():
            mesh = read_mesh(path, progress=progress)
            materials = None if as_mesh else shown_materials(path, mesh)
        # A normal map and a displacement belong to the normals of their bake, which are smooth.
        is_baked = not files.keys() <= {"albedo"} or _has_normal_maps(materials)
        if mesh.normals is None and not is_baked:
            mesh = with_sharp_edges(mesh)
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


def shown_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Return the materials of a mesh file, or the colors of its vertices; None without either."""
    if mesh.colors is None and Path(path).suffix.lower() in _WITHOUT_MATERIALS:
        return None
    # Imported here, so that meshes without materials do not load it.
    from texbake.texture.model_materials import model_materials

    found = model_materials(path, mesh)
    if found is None or not (found.has_vertex_colors or any(m.channels for m in found.materials)):
        return None
    return found


def _has_normal_maps(materials: Materials | None) -> bool:
    return materials is not None and any(materials.sources("normal"))


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
    """Light a scene that nothing lights by the studio, or by its room if a material is a metal."""
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


# Light below this has the 8-bit code 0.
BLACK = 0.5 / 255.0 / 12.92


@dataclass(frozen=True, eq=False)
class DefaultView:
    """How a scene is shown."""

    path: PathLike  # the file
    scene: Scene
    options: RenderOptions
    camera: Camera | None = None  # None for the scene's own
    n_strays: int = 0  # triangles that the camera leaves out because they lie far from all others
    side: str = ""  # as from `surface_side`; "" if it was not needed

    def table(self, frame: Frame) -> list[tuple[str, str]]:
        """Return rows about the choices that change this picture."""
        rows = []
        if frame.exposure is not None and frame.exposure < 1.0:
            rows.append(("exposure", f"{frame.exposure:.2f}, so that white does not clip"))
        share = self._share_of_backs(frame)
        if round(share, 3) > 0.0:  # else the figure would be 0.0
            cause = "inside out" if self.side == "back" else "open"
            rows.append(
                ("back faces", f"{100.0 * share:.1f} % of the visible surface; the mesh is {cause}")
            )
        return rows

    def _share_of_backs(self, frame: Frame) -> float:
        if self.side not in ("both", "back") or self.options.mapping_order != "screen":
            return 0.0
        return _share_of_backs(self.scene, frame, self._camera)

    @property
    def _camera(self) -> Camera:
        return self.camera or camera_of(self.scene, self.options)

    def warnings(self, frame: Frame) -> Iterator[str]:
        """Yield a line if the picture leaves something out, or if nothing can be seen in it."""
        if self.n_strays:
            what = counted(self.n_strays, "triangle lies", "triangles lie")
            yield (
                f"{self.path}: {what} far from all others and may be outside the picture; "
                "set a larger distance with --view AZ,EL,DIST"
            )
        if self.options.buffer is None:
            cause = _one_color(self.scene, self.options, frame, self._camera)
            if cause:
                yield f"{self.path}: the picture has one color: {cause}"


def default_view(path: PathLike, scene: Scene, options: RenderOptions) -> DefaultView:
    """Choose sides, back faces of open or inverted meshes too, and camera where options do not."""
    if Path(path).suffix.lower() == ".toml":
        return DefaultView(path, scene, options)
    meshes = [outline(item) for item in scene.objects]
    side = ""
    if options.back_faces is None:
        asking = [
            mesh
            for mesh, item in zip(meshes, scene.objects, strict=True)
            if item.material.double_sided is None
        ]
        side = surface_side(join_meshes(asking)) if asking else "front"
        options = replace(options, back_faces="cull" if side == "front" else "show")
    if scene.view is not None or options.distance is not None:
        return DefaultView(path, scene, options, side=side)
    seen = [
        mesh
        for mesh, item in zip(meshes, scene.objects, strict=True)
        if item.visible and not is_hidden(item.material)
    ]
    camera, n_strays = fill_picture(seen or meshes, options)
    return DefaultView(path, scene, options, camera, n_strays, side)


def _share_of_backs(scene: Scene, frame: Frame, camera: Camera) -> float:
    """Share of back faces among the pixels that show a surface."""
    ids = frame.face_ids[frame.face_ids >= 0]
    if any(item.material.displacement is not None for item in scene.objects) or not len(ids):
        return 0.0
    n_backs, first = 0, 0
    for mesh in map(outline, scene.objects):
        own = ids[(ids >= first) & (ids < first + mesh.n_faces)] - np.int32(first)
        n_backs += int(np.count_nonzero(_facing(mesh, own, camera) < 0.0))
        first += mesh.n_faces
    return n_backs / len(ids)


def _facing(mesh: Mesh, faces: IntArray, camera: Camera) -> FloatArray:
    """(n,) above 0 for faces seen from the front, 0 edge-on, by `core/framing.c`."""
    facing = np.empty(len(faces))
    core.measure_facing(mesh.positions, mesh.faces, faces, camera.eye, facing)
    return facing


def _one_color(scene: Scene, options: RenderOptions, frame: Frame, camera: Camera) -> str:
    """Return why nothing can be seen in a picture; "" if something can."""
    if not frame.coverage.any():
        return _why_nothing(scene, options, camera)
    if _is_black(frame):
        return "everything is black: the materials are black, or no light reaches them"
    codes = quantize_srgb(frame.color[0, 0, :3], 8)
    if (frame.coverage == 1.0).all() and (quantize_srgb(frame.color[..., :3], 8) == codes).all():
        return "one surface fills the picture; move the camera with --view AZ,EL,DIST"
    return ""


def _is_black(frame: Frame) -> bool:
    """Whether all surfaces of a picture have the 8-bit code 0."""
    some = frame.color[::16, ::16][frame.coverage[::16, ::16] == 1.0][:, :3]
    if some.size and some.max() >= BLACK:  # true for most pictures
        return False
    whole = frame.coverage == 1.0
    light = frame.color[whole if whole.any() else frame.coverage > 0.0][:, :3]
    return bool(light.max() < BLACK)


def _why_nothing(scene: Scene, options: RenderOptions, camera: Camera) -> str:
    """Return why no surface is in a picture."""
    shown = [item for item in scene.objects if item.visible and not is_hidden(item.material)]
    if not shown:
        return "all objects are hidden or fully transparent"
    facing = [
        _facing(mesh, np.arange(mesh.n_faces, dtype=np.int32), camera)
        for mesh in (outline(item) for item in shown)
    ]
    if not any(side.any() for side in facing):
        return "every triangle is seen edge-on or has no area; choose another --view"
    culls = [
        item.material.double_sided is False
        or (item.material.double_sided is None and options.back_faces != "show")
        for item in shown
    ]
    if all(cull and not (side > 0.0).any() for cull, side in zip(culls, facing, strict=True)):
        return "every triangle is seen from behind; draw them with --back-faces show"
    return "nothing is in front of the camera or large enough to see; choose another --view"
