"""Comparing a low-poly mesh and its maps with the high-poly mesh, in numbers and pictures.

Both meshes are rendered with the same camera, and the angle between their shading normals in world
space is measured at each pixel. The angles include differences in shape; compare them with those of
the bare low-poly mesh. Pixels that see only one of the meshes, or clearly different parts of them
(near silhouettes), are left out of the angles and counted separately.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import BoolArray, FloatArray, Mesh
from texbake.mesh.normals import with_flat_normals
from texbake.mesh.topology import surface_side
from texbake.parallel import resolve_threads, run_bands
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.closeness import Closeness, ViewErrors, measure_closeness, view_errors
from texbake.rendering.draw import Prepared, draw, prepare, share_images, without_light
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, color_angles, sheets, side_by_side
from texbake.rendering.resolve import Frame, expose
from texbake.rendering.scene.scene import Scene
from texbake.rendering.studio import lit_by_studio, studio_scene
from texbake.texture.encoding import encode_srgb
from texbake.texture.image import FloatImage

# Number of default views: all around, alternating from above and below, starting at the azimuth of
# the options' view.
_N_VIEWS = 6
_ELEVATION = 25.0
# A pixel sees the same part of both meshes if their depths differ by at most this share of the
# diagonal. It is several times the deviation of a low-poly mesh with a few hundred triangles.
_SAME_PART = 0.02
_MAP_NAMES = {"normal_map": "normal map", "albedo": "color map", "displacement": "displacement map"}
# A displaced mesh is subdivided once for all views, into at most about twice the number of pixels.
_MOST_PIECES = 2_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Result of comparing a low-poly mesh, with and without its maps, to a high-poly mesh."""

    # The low-poly mesh with its maps as a GLB file shows them, without displacement. With a
    # displacement map alone it is displaced, and without any map it is `bare`.
    mapped: Closeness
    bare: Closeness  # without its maps
    # views, in degrees, in which angles and silhouettes were measured
    views: tuple[tuple[float, float], ...]
    # pictures from the view in the options, with one exposure; errors are measured before it
    high_frame: Frame
    bare_frame: Frame
    mapped_frame: Frame
    # (H, W) float32: angle in degrees between the normals of `high_frame` and `mapped_frame`; NaN
    # where they do not show the same part
    angles_deg: FloatImage
    names: tuple[str, ...]  # captions of the pictures of the high-poly and the low-poly mesh
    # maps that `mapped` shows: `normal map`, `color map` or `displacement map`
    maps: tuple[str, ...] = ()
    # with all of its maps; None unless there is a displacement map beside another one
    displaced: Closeness | None = None
    displaced_frame: Frame | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the figures, with and without maps, as plain values."""
        displaced = {} if self.displaced is None else {"displaced": asdict(self.displaced)}
        return {
            "mapped": asdict(self.mapped),
            "maps": list(self.maps),
            **displaced,
            "bare": asdict(self.bare),
            "views_deg": [list(view) for view in self.views],
        }

    def uses(self) -> list[tuple[str, Closeness]]:
        """Return each use of the maps with its figures, starting with that of a GLB file."""
        found = []
        if self.maps:
            found.append((f"with its {' and '.join(self.maps)}", self.mapped))
        if self.displaced is not None:
            found.append(("displaced as well", self.displaced))
        return found

    def table(self) -> list[tuple[str, str]]:
        """Return a row of figures for each use of the maps, and for none."""
        return [(label, str(close)) for label, close in (*self.uses(), ("without maps", self.bare))]

    def difference(self) -> FloatImage:
        """(H, W, 3) float32: the angles as linear colors; gray where they are NaN."""
        return color_angles(self.angles_deg)

    def side_by_side(self) -> FloatImage:
        """(H', W', 3) linear: the pictures with captions, and the error of low with maps."""
        return side_by_side(*self._panels())

    def sheets(self) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
        """Return sRGB codes of `side_by_side`: (H', W'', 3) without the difference, and of all."""
        return sheets(*self._panels())

    def _panels(self) -> tuple[list[Panel], BoolArray]:
        shown: list[tuple[Frame, str, Closeness | None]] = [
            (self.high_frame, self.names[0], None),
            (self.bare_frame, self.names[1], self.bare),
        ]
        if self.maps:
            caption = f"... with its {' and '.join(self.maps)}"
            shown.append((self.mapped_frame, caption, self.mapped))
        if self.displaced_frame is not None:
            shown.append((self.displaced_frame, "... and displaced as well", self.displaced))
        panels = []
        for frame, caption, close in shown:
            note = "" if close is None else f"normals off by {close.mean_deg:.2f}° in the mean"
            panels.append(Panel(frame.color, caption, note))
        panels.append(Panel(self.difference(), "Difference of normals", "", legend=True))
        seen = np.logical_or.reduce([frame.coverage > 0 for frame, _, _ in shown])
        return panels, seen


def compare(
    high: MeshLike,
    low: MeshLike,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    high_materials: Materials | None = None,
    low_materials: Materials | None = None,
    options: RenderOptions | None = None,
    views: Sequence[tuple[float, float]] | None = None,
    quick: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Comparison:
    """Compare a low-poly mesh, with and without its maps, to a high-poly mesh by rendering both.

    Parameters
    ----------
    high, low
        The meshes, in the same coordinate system.
    normal_map, displacement, albedo
        Maps of the low-poly mesh; see `texbake.rendering.render.render`.
    high_materials
        Materials of the high-poly mesh, whose normal maps bend its normals; None if it has none.
        Their colors count if the low-poly mesh has an `albedo` or materials. Without these, both
        meshes have the base color of the options.
    low_materials
        Materials of the low-poly mesh, in place of its maps if there are none; only their normal
        maps if the high-poly mesh has no materials.
    options
        Size and view of the pictures. Angles are measured at the centers of as many pixels. Unless
        `back_faces` is given, back faces are shown if the low-poly mesh is open or inside out.
    views
        Views (azimuth, elevation) in degrees for angles and silhouettes; None for six all around.
    quick
        Draw only the pictures: angles and silhouettes are measured in the view of the options,
        with the normals of all samples of a pixel averaged, and SSIM is not measured.
    threads
        Number of threads; None uses every processor.
    progress
        Receives the stages.

    Raises
    ------
    OptionError
        `views` is empty.
    UvError, FileError
        As for `render`.
    """
    high, low = as_mesh(high), as_mesh(low)
    options = options or RenderOptions()
    if options.back_faces is None:
        side = surface_side(low, threads=threads)
        options = replace(options, back_faces="cull" if side == "front" else "show")
    views = _views_around(options) if views is None else tuple(views)
    if not views:
        raise OptionError("views: the list is empty; give at least one azimuth and elevation")
    stages = Stages(progress)
    given = {"normal_map": normal_map, "albedo": albedo, "displacement": displacement}
    maps = {name: source for name, source in given.items() if source is not None}
    # Shade every sample, so that detail finer than a pixel contributes fully.
    most = min(options.max_triangles, _MOST_PIECES)
    options = replace(options, edges="supersample", filter="bilinear", max_triangles=most)
    with stages.stage("prepare"):
        plain, scenes, names = _scenes(high, low, maps, (high_materials, low_materials), options)
        # Pictures of two sizes share everything that does not depend on the size.
        models = [prepare(scene, options, threads=threads) for scene in scenes]
        sphere = Camera.sphere_around(high, low)
    with stages.stage("pictures"):
        frames, pictured = _draw_models(models, (high, low), sphere, options, at_once=False)
    errors = [pictured]
    if not quick:
        with stages.stage("angles", total=len(views), unit="views") as advance:
            errors, models = [], list(map(without_light, models))
            for view in views:
                # One sample per pixel: its center.
                of_view = replace(options, view=(*view, options.distance), supersampling=1)
                errors.append(_draw_models(models, (high, low), sphere, of_view)[1])
                advance(1)
    with stages.stage("similarity"):
        seen = [(encode_srgb(frame.color[..., :3]), frame.coverage > 0) for frame in frames]
        highs = [seen[0]] * (len(seen) - 1)
        if plain is not None:
            model = prepare(plain, options, threads=threads)
            frame = draw(model, Camera.framing_sphere(*sphere, options))
            highs[0] = encode_srgb(frame.color[..., :3]), frame.coverage > 0
        bare, *others = (
            measure_closeness(found, seen_high, seen_low, ssim=not quick, threads=threads)
            for found, seen_high, seen_low in zip(
                zip(*errors, strict=True), highs, seen[1:], strict=True
            )
        )
    mapped = min(1, len(others))
    if options.exposure != "none":  # for display; errors are measured before
        frames = expose(frames, options, threads=threads)
    return Comparison(
        mapped=others[0] if others else bare,
        bare=bare,
        views=((options.view[0], options.view[1]),) if quick else views,
        high_frame=frames[0],
        bare_frame=frames[1],
        mapped_frame=frames[1 + mapped],
        angles_deg=pictured[mapped].angles,
        names=tuple(f"{mesh.name}: {mesh.n_faces:,} triangles" for mesh in (high, low)),
        maps=names,
        displaced=others[1] if len(others) > 1 else None,
        displaced_frame=frames[3] if len(others) > 1 else None,
    )


def compare_shapes(
    high: Mesh, lows: Sequence[Mesh], options: RenderOptions, *, threads: int | None = None
) -> list[tuple[float, float]]:
    """Mean angle of flat normals in degrees, and share of pixels that differ, over six views."""
    flat = (with_flat_normals(low, threads=threads) for low in lows)
    meshes, errors_of_lows = (high, *flat), []
    options = replace(options, edges="supersample", supersampling=1, back_faces="show")
    scenes = [studio_scene(mesh, options=options) for mesh in meshes]
    models = [without_light(prepare(scene, options, threads=threads)) for scene in scenes]
    sphere = Camera.sphere_around(*meshes)
    views = [replace(options, view=(*view, options.distance)) for view in _views_around(options)]
    errors_of_views = [_draw_models(models, meshes, sphere, view)[1] for view in views]
    for errors in zip(*errors_of_views, strict=True):
        angles = np.concatenate([error.angles[np.isfinite(error.angles)] for error in errors])
        mean = float(angles.mean(dtype=np.float64)) if len(angles) else 0.0
        errors_of_lows.append(
            (mean, 1.0 - len(angles) / max(sum(error.n_either for error in errors), 1))
        )
    return errors_of_lows


def _draw_models(
    models: Sequence[Prepared],
    meshes: tuple[Mesh, ...],
    sphere: tuple[FloatArray, float],
    options: RenderOptions,
    *,
    at_once: bool = True,
) -> tuple[list[Frame], list[ViewErrors]]:
    """Draw the high-poly mesh and uses of low-poly ones, and measure the errors of the uses."""
    camera = Camera.framing_sphere(*sphere, options)
    threads = resolve_threads(models[0].threads)
    for_each = max(1, 2 * threads // len(models)) if at_once else threads
    frames: dict[int, Frame] = {}

    def work(first: int, stop: int) -> None:
        for i in range(first, stop):
            if not at_once and i > 1:
                share_images(models[i - 1], models[i])
            model = replace(models[i], options=options, threads=for_each)
            frames[i] = draw(model, camera, keep=("normals",))

    run_bands(work, len(models), band=1, threads=threads if at_once else 1)
    bounds = np.concatenate([mesh.bounds for mesh in meshes])
    tolerance = _SAME_PART * float(pm.norm(bounds.max(axis=0) - bounds.min(axis=0)))
    high, *lows = (frames[i] for i in range(len(models)))
    return [high, *lows], [view_errors(high, low, tolerance, threads=threads) for low in lows]


def _scenes(
    high: Mesh,
    low: Mesh,
    maps: dict[str, Any],
    materials: tuple[Materials | None, Materials | None],
    options: RenderOptions,
) -> tuple[Scene | None, list[Scene], tuple[str, ...]]:
    """Scenes of the high-poly mesh and each use of the low-poly one, and the maps of that use.

    The first is None, or the high-poly mesh in the one color of the bare low-poly mesh.
    """
    of_high, own = materials[0], None if maps else materials[1]
    has_color = _has_color(of_high) and ("albedo" in maps or own is not None)
    if own is not None and not has_color:
        own = own.only(("normal",)) if any(own.sources("normal")) else None
    uses = _uses(maps)
    names = tuple(_MAP_NAMES[name] for name in uses[min(1, len(uses) - 1)])
    gray = studio_scene(high, options=options)
    plain = _with_normal_maps(gray, of_high)
    scenes = [_with_materials(gray, of_high) if has_color else plain]
    # A displaced mesh is subdivided to the texels of its map, once for all views.
    scenes += [studio_scene(low, options=options, edge_px=None, **use) for use in uses]
    if own is not None:
        names = ("materials",) if has_color else ("normal map",)
        show = _with_materials if has_color else _with_normal_maps
        scenes.append(show(scenes[-1], own))
    *scenes, plain = lit_by_studio([*scenes, plain])
    return plain if has_color else None, scenes, names


def _uses(maps: dict[str, Any]) -> list[dict[str, Any]]:
    """Maps of each picture of the low-poly mesh: none, those of a GLB file, and all of them."""
    flat = {name: source for name, source in maps.items() if name != "displacement"}
    return list({tuple(use): use for use in ({}, flat, maps)}.values())


def _has_color(materials: Materials | None) -> bool:
    """Whether materials set more than normal maps."""
    if materials is None:
        return False
    return materials.has_vertex_colors or any(
        set(material.channels) - {"normal"} for material in materials.materials
    )


def _with_materials(scene: Scene, materials: Materials | None) -> Scene:
    """Return the scene of one mesh with its own materials, seen from the sides of the options."""
    from texbake.rendering.scene.read import scene_from_materials

    objects = scene_from_materials(scene.objects[0].mesh, materials).objects
    sided = (replace(item, material=replace(item.material, double_sided=None)) for item in objects)
    return replace(scene, objects=tuple(sided))


def _with_normal_maps(scene: Scene, materials: Materials | None) -> Scene:
    """Return the scene of one mesh with the normal maps of its materials."""
    if materials is None or not any(materials.sources("normal")):
        return scene
    from texbake.rendering.scene.read import scene_from_materials

    (plain,) = scene.objects
    parts = scene_from_materials(plain.mesh, materials.only(("normal",))).objects
    objects = tuple(
        replace(part, material=replace(plain.material, normal_map=part.material.normal_map))
        for part in parts
    )
    return replace(scene, objects=objects)


def _views_around(options: RenderOptions) -> tuple[tuple[float, float], ...]:
    return tuple(
        (options.view[0] + k * 360.0 / _N_VIEWS, _ELEVATION if k % 2 == 0 else -_ELEVATION)
        for k in range(_N_VIEWS)
    )
