"""Comparing pictures of a model and another version of it, and of a scene without its effects.

Two versions of a model are drawn with their own materials in the light of a room with soft lamps,
which glossy and metallic surfaces reflect, from the same cameras. The views are spread evenly over
a sphere.

An effect that changes no pixel of a picture is useless there, whatever it costs. Each effect of the
plan that can be taken out of the scene is taken out of all objects and lights at once, and the
picture is compared with the one that has it, in the 8-bit codes that an image file would hold.

Based on: González, "Measurement of areas on a sphere using Fibonacci and latitude-longitude
lattices", Mathematical Geosciences 42, 2010, for the views.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.files import PathLike, written_file
from texbake.mesh.files import read_mesh
from texbake.mesh.hard_edges import with_sharp_edges
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, draw, prepare, share_environment
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.resolve import Frame, expose, find_exposure
from texbake.rendering.scene.gltf import read_gltf_scene
from texbake.rendering.scene.lights import Environment, Lighting
from texbake.rendering.scene.scene import Scene, camera_of, outline
from texbake.rendering.studio import STUDIO_ROOM
from texbake.texture.encoding import quantize_srgb
from texbake.texture.model_materials import read_materials

N_VIEWS = 6
_PICTURE_PX, LARGE_PX = 256, 512  # sides of the pictures of a search, and of what confirms it
_GOLDEN_ANGLE = 180.0 * (3.0 - math.sqrt(5.0))
_GLTF = (".glb", ".gltf")
_ROOM_PX = 64  # of a face of its cube map; its lamps are wide
# A result may leave the sphere around a model by this share of its radius before it is framed, too.
_OUTSIDE = 0.01
Picture = npt.NDArray[np.uint8]
_Drawn = tuple[Picture, npt.NDArray[np.bool_]]  # the picture of a view, and the pixels of the model
_View = tuple[float, float]  # azimuth and elevation in degrees


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelComparison:
    """How a model differs in pictures from another version of it."""

    # PSNR of each view, of the sRGB codes of those pixels that either model touches; infinite for
    # equal pictures
    psnr_db: tuple[float, ...]
    mean_db: float  # PSNR of all those pixels of all views together
    views: tuple[tuple[float, float], ...]  # in degrees
    before: tuple[Picture, ...]  # (H, W, 3) uint8: the pictures of each view, coded in sRGB
    after: tuple[Picture, ...]
    names: tuple[str, str]  # of the files
    n_faces: tuple[int, ...]  # triangles of each
    notes: tuple[str, ...] = ()  # what of the files the pictures do not show

    @property
    def worst_db(self) -> float:
        """PSNR of the view with the lowest."""
        return min(self.psnr_db)

    @property
    def worst_view(self) -> int:
        """Number of the view with the lowest PSNR, from 0."""
        return self.psnr_db.index(self.worst_db)


@dataclass(frozen=True, eq=False)
class ModelToDraw:
    """A model in the light of the room, and what drawing it has computed for further pictures."""

    scene: Scene
    prepared: Prepared
    _drawn: dict[tuple[_View, ...], tuple[float, list[_Drawn]]] = field(default_factory=dict)

    def in_size(self, size: int) -> ModelToDraw:
        """Return the model for square pictures of another size."""
        options = replace(self.prepared.options, width=size, height=size)
        return ModelToDraw(self.scene, replace(self.prepared, options=options))

    def exposed(
        self, cameras: Mapping[_View, Camera], *, keeps: bool
    ) -> tuple[float, list[_Drawn]]:
        """Return the exposure of all views, and their pictures; `keeps` both for the next call."""
        views = tuple(cameras)
        if keeps and views in self._drawn:
            return self._drawn[views]
        frames = [self._frame(cameras[view], view) for view in views]
        exposure = find_exposure(frames)
        found = exposure, [self._seen(frame, exposure) for frame in frames]
        if keeps:
            self._drawn[views] = found
        return found

    def picture(self, camera: Camera, view: _View, exposure: float) -> _Drawn:
        """Draw a view."""
        return self._seen(self._frame(camera, view), exposure)

    def _frame(self, camera: Camera, view: _View) -> Frame:
        seen = replace(self.prepared.options, view=(*view, None))
        return draw(replace(self.prepared, options=seen), camera).without_samples()

    def _seen(self, frame: Frame, exposure: float) -> _Drawn:
        if exposure < 1.0:
            (frame,) = expose([frame], self.prepared.options, exposure=exposure)
        return _codes(frame), frame.coverage > 0


def model_to_draw(
    path: PathLike,
    *,
    options: RenderOptions | None = None,
    at_rest: bool = False,
    threads: int | None = None,
) -> ModelToDraw:
    """Read a model that is compared with several others, by the options of `compare_models`."""
    scene = model_scene(path, at_rest=at_rest)
    return ModelToDraw(scene, prepare(scene, _render_options(options), threads=threads))


def _render_options(options: RenderOptions | None) -> RenderOptions:
    options = options or RenderOptions(width=_PICTURE_PX, height=_PICTURE_PX)
    # Every sample is shaded, so that detail finer than a pixel counts in full.
    return replace(options, edges="supersample")


def compare_models(
    before: PathLike | ModelToDraw,
    after: PathLike,
    *,
    n_views: int = N_VIEWS,
    options: RenderOptions | None = None,
    at_rest: bool = False,
    least_db: float = 0.0,
    threads: int | None = None,
    progress: Progress = None,
) -> ModelComparison:
    """Draw two versions of a model from all around, and measure how much the pictures differ.

    Skins are not applied; a warning says so unless the models shall be `at_rest`. Views are left
    out once the PSNR of all is sure to be below `least_db`: even if each of them had no error and
    twice as many pixels as those before. Where a model is too bright for the room, both are exposed
    as in previews: whites would hide all differences.
    """
    if n_views < 1:
        raise OptionError(f"n_views: {n_views} is below 1; give at least one view")
    chosen = _render_options(options)
    stages = Stages(progress)
    with stages.stage("read models"):
        both = [
            model
            if isinstance(model, ModelToDraw)
            else model_to_draw(model, options=options, at_rest=at_rest, threads=threads)
            for model in (before, after)
        ]
    scenes = [model.scene for model in both]
    shapes = [[outline(item) for item in scene.objects] for scene in scenes]
    center, radius = Camera.sphere_around(*shapes[0])
    apart = max(float(pm.norm(mesh.used_positions - center, axis=1).max()) for mesh in shapes[1])
    is_within = apart <= (1.0 + _OUTSIDE) * radius
    if not is_within:
        center, radius = Camera.sphere_around(*shapes[0], *shapes[1])
    views = sphere_views(n_views)
    cameras = {
        view: Camera.framing_sphere(center, radius, replace(chosen, view=(*view, None)))
        for view in views
    }
    pictures: tuple[list[Picture], list[Picture]] = ([], [])
    errors: list[tuple[float, int]] = []
    with stages.stage("compare pictures", total=n_views, unit="views") as advance:
        exposure, shown = both[0].exposed(cameras, keeps=is_within)
        share_environment(both[0].prepared, both[1].prepared)
        for view, original in zip(views, shown, strict=True):
            drawn = [original, both[1].picture(cameras[view], view, exposure)]
            for found, (picture, _) in zip(pictures, drawn, strict=True):
                found.append(picture)
            (one, covered), (other, also) = drawn
            covered = covered | also
            differences = one[covered].astype(np.int64) - other[covered]
            errors.append((float((differences**2).sum()), differences.size))
            advance(1)
            total, count = (sum(column) for column in zip(*errors, strict=True))
            n_left = n_views - len(errors)
            if psnr_db(total, count + 2 * count * n_left // len(errors)) < least_db:
                break
    return ModelComparison(
        psnr_db=tuple(psnr_db(total, count) for total, count in errors),
        mean_db=psnr_db(total, count),
        views=views[: len(errors)],
        before=tuple(pictures[0]),
        after=tuple(pictures[1]),
        names=(scenes[0].name, scenes[1].name),
        n_faces=tuple(sum(item.mesh.n_faces for item in scene.objects) for scene in scenes),
        notes=tuple(f"{scene.name}: {note}" for scene in scenes for note in scene.notes),
    )


def decibels(error: float) -> str:
    """Return a PSNR in words.

    >>> decibels(34.56), decibels(math.inf)
    ('34.6 dB', 'equal')
    """
    return "equal" if math.isinf(error) else f"{error:.1f} dB"


def sphere_views(n: int) -> tuple[tuple[float, float], ...]:
    """Azimuths and elevations in degrees of n views, spread evenly over the sphere.

    >>> sphere_views(1)
    ((0.0, 0.0),)
    """
    return tuple(
        (i * _GOLDEN_ANGLE % 360.0, math.degrees(pm.arcsin(1.0 - (2 * i + 1) / n)))
        for i in range(n)
    )


def model_scene(path: PathLike, *, at_rest: bool = False) -> Scene:
    """Read a model file as a scene in the light of a room, without its own lights and cameras.

    A mesh without normals gets hard ones at its sharp edges, as when it is lightened.
    """
    file = written_file(path)
    if file.suffix.lower() in _GLTF:
        scene = read_gltf_scene(file, at_rest=at_rest)
    else:
        from texbake.rendering.scene.read import scene_from_materials

        mesh = read_mesh(file)
        if mesh.normals is None:
            mesh = with_sharp_edges(mesh)
        materials = read_materials(file, mesh)
        scene = replace(scene_from_materials(mesh, materials), files=(Path(path),))
    room = Environment(image=STUDIO_ROOM, background=False, lighting=True, size=_ROOM_PX)
    return replace(scene, lighting=Lighting(environment=room), view=None, name=Path(path).name)


def _codes(frame: Frame) -> Picture:
    return np.asarray(quantize_srgb(frame.color[..., :3], 8), np.uint8)


def psnr_db(total: float, count: int) -> float:
    """PSNR in dB of 8-bit codes by the sum of their squared differences; infinite for equal."""
    return math.inf if total == 0.0 else 10.0 * pm.log10(255.0**2 * count / total)


@dataclass(frozen=True, eq=False)
class Contribution:
    """What an effect changes in a picture, and what it costs."""

    name: str  # name of the effect in the plan
    pixels: int  # pixels whose 8-bit color differs without it
    share: float  # their share of all pixels, from 0 to 1
    largest: int  # largest difference of a channel, from 0 to 255
    # milliseconds, n_bytes: time of all threads and memory of its pass in the picture that has it
    milliseconds: float
    n_bytes: int
    difference: Picture  # (H, W, 3): absolute difference of the codes

    def to_json(self) -> dict[str, Any]:
        """Return the numbers as plain values."""
        return {
            "name": self.name,
            "pixels": self.pixels,
            "share": self.share,
            "largest": self.largest,
            "milliseconds": self.milliseconds,
            "bytes": self.n_bytes,
        }


def contributions_of(
    scene: Scene,
    options: RenderOptions,
    frame: Frame,
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> tuple[Contribution, ...]:
    """Draw a scene without each of its effects in turn, and compare the pictures, by the plan."""
    options = replace(options, max_error=None, time_budget=None)
    plain = replace(options, exposure="none")
    camera = camera or camera_of(scene, options)
    whole = frame
    if frame.sampling is not None:
        whole = render_scene(scene, options, camera=camera, threads=threads, progress=progress)
    shown = _codes_with_opacity(whole)
    found = []
    for item in frame.plan.passes:
        without = item.effect.scene_without(scene)
        if without is None:
            continue
        other = render_scene(without, plain, camera=camera, threads=threads, progress=progress)
        if whole.exposure is not None:
            (other,) = expose([other], options, exposure=whole.exposure, threads=threads)
        # Opacity counts as a change, too.
        codes = _codes_with_opacity(other)
        difference = np.where(shown > codes, shown - codes, codes - shown)
        changed = difference.any(axis=2)
        cost = frame.costs.by_name.get(item.name)
        found.append(
            Contribution(
                name=item.name,
                pixels=int(changed.sum()),
                share=float(changed.mean()),
                largest=int(difference.max(initial=0)),
                milliseconds=0.0 if cost is None else 1e3 * cost.seconds,
                n_bytes=0 if cost is None else cost.n_bytes,
                difference=difference[..., :3],
            )
        )
    return tuple(found)


def _codes_with_opacity(frame: Frame) -> Picture:
    opacity = np.rint(255.0 * np.clip(frame.color[..., 3:], 0.0, 1.0)).astype(np.uint8)
    return np.concatenate([_codes(frame), opacity], axis=2)
