"""Comparing a low-poly mesh and its maps with the high-poly mesh, in numbers and pictures.

Both meshes are rendered with the same camera, and the angle between their shading normals in world
space is measured at each pixel. The angles include differences in shape; compare them with those of
the bare low-poly mesh. Pixels that see only one of the meshes, or clearly different parts of them
(near silhouettes), are left out of the angles and counted separately.

Based on: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
structural similarity", IEEE TIP 13(4), 2004, for SSIM.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.maps import MapSource
from texbake.rendering.options import RenderOptions
from texbake.rendering.panels import Panel, colored_angles, side_by_side
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.from_materials import scene_from_materials
from texbake.rendering.scene.scene import Scene
from texbake.rendering.studio import studio_scene
from texbake.texture.encoding import encode_srgb
from texbake.texture.image import FloatImage

# Number of default views: all around, alternating from above and below, starting at the azimuth of
# the options' view.
_N_VIEWS = 6
_ELEVATION = 25.0
# A pixel sees the same part of both meshes if their depths differ by at most this share of the
# diagonal. It is several times the deviation of a low-poly mesh with a few hundred triangles.
_SAME_PART = 0.02
# A displaced mesh is subdivided once for all views, into at most about twice the number of pixels.
_MOST_PIECES = 2_000_000


@dataclass(frozen=True, kw_only=True)
class Closeness:
    """How close one mesh comes to the high-poly mesh.

    Attributes
    ----------
    mean_deg, median_deg, p95_deg : float
        Angles in degrees between the shading normals, over the pixels of all views whose center
        sees the same part of both meshes (depths within 2 % of the diagonal of the joint bounding
        box). NaN if there are no such pixels.
    psnr_db : float
        PSNR of the shaded, sRGB-coded picture of the view in the options, over the pixels that
        either mesh touches; infinite for equal pictures.
    ssim : float
        Mean structural similarity over the same pixels.
    silhouette_mismatch : float
        Among the pixel centers that see either mesh, the share that sees only one of them, or
        different parts. Of the other values, only PSNR and SSIM include these pixels.
    n_pixels : int
        Number of pixels in the angle statistics.
    """

    mean_deg: float
    median_deg: float
    p95_deg: float
    psnr_db: float
    ssim: float
    silhouette_mismatch: float
    n_pixels: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Result of comparing a low-poly mesh, with and without its maps, to a high-poly mesh.

    Attributes
    ----------
    mapped, bare : Closeness
        Results for the low-poly mesh with and without its maps.
    normals_only : Closeness, optional
        With the normal map alone, as most viewers show an asset; None unless there is a
        displacement map as well.
    views : tuple of (azimuth, elevation)
        Views, in degrees, in which angles and silhouettes were measured.
    high_frame, bare_frame, mapped_frame : Frame
        Pictures from the view in the options.
    normals_frame : Frame, optional
        With the normal map alone.
    angles_deg : (H, W) float32
        Angle in degrees between the normals of `high_frame` and `mapped_frame`; NaN where they do
        not show the same part.
    names : (str, str, str)
        Captions of the three pictures.
    """

    mapped: Closeness
    bare: Closeness
    views: tuple[tuple[float, float], ...]
    high_frame: Frame
    bare_frame: Frame
    mapped_frame: Frame
    angles_deg: FloatImage
    names: tuple[str, str, str]
    normals_only: Closeness | None = None
    normals_frame: Frame | None = None

    def difference(self) -> FloatImage:
        """(H, W, 3) float32: the angles as linear colors; gray where they are NaN."""
        return colored_angles(self.angles_deg)

    def side_by_side(self) -> FloatImage:
        """(H', W', 3) float32: the pictures and their difference with captions, in linear light."""
        frames = self.high_frame, self.bare_frame, self.mapped_frame
        notes = (
            "",
            f"normals off by {self.bare.mean_deg:.2f}° in the mean",
            f"normals off by {self.mapped.mean_deg:.2f}° in the mean",
        )
        panels = [
            Panel(frame.color, name, note)
            for frame, name, note in zip(frames, self.names, notes, strict=True)
        ]
        panels.append(Panel(self.difference(), "Difference of normals", "", legend=True))
        seen = np.logical_or.reduce([frame.coverage > 0 for frame in frames])
        return side_by_side(panels, seen)


def compare(
    high: MeshLike,
    low: MeshLike,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    high_materials: Materials | None = None,
    options: RenderOptions | None = None,
    views: Sequence[tuple[float, float]] | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Comparison:
    """Compare a low-poly mesh, with and without its maps, to a high-poly mesh by rendering both.

    Parameters
    ----------
    high, low
        The meshes, in the same coordinate system.
    normal_map, displacement, albedo
        Maps of the low-poly mesh; see `texbake.rendering.render.render`. All three meshes are
        shaded with the base color of the options, except that the mapped mesh uses `albedo` if it
        is given.
    high_materials
        Materials of the high-poly mesh, whose normal maps bend its normals. None for none.
    options
        Size and view of the pictures. Angles are measured at the centers of as many pixels.
    views
        Views (azimuth, elevation) in degrees for angles and silhouettes; None for six all around.
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
    views = _around(options) if views is None else tuple(views)
    if not views:
        raise OptionError("views: the list is empty; give at least one azimuth and elevation")
    stages = Stages(progress)
    maps: Any = {"normal_map": normal_map, "displacement": displacement, "albedo": albedo}
    # Shade every sample, so that detail finer than a pixel contributes fully.
    most = min(options.max_triangles, _MOST_PIECES)
    options = replace(options, edges="supersample", filter="bilinear", max_triangles=most)
    with stages.stage("prepare"):
        scenes = _scenes(high, low, high_materials, options, maps)
        # Pictures of two sizes share everything that does not depend on the size.
        models = [prepare(scene, options, threads=threads) for scene in scenes]

    def draw_all(options: RenderOptions) -> list[Frame]:
        camera = Camera.framing(high, low, options=options)
        return [
            draw(replace(model, options=options), camera, keep=("normals",)) for model in models
        ]

    with stages.stage("pictures"):
        frames = draw_all(options)
    depth_tolerance = _SAME_PART * _joint_diagonal(high, low)
    errors: list[list[_Errors]] = [[] for _ in frames[1:]]
    with stages.stage("angles", total=len(views), unit="views") as advance:
        for view in views:
            # One sample per pixel: its center.
            high_frame, *low_frames = draw_all(
                replace(options, view=(*view, options.distance), supersampling=1)
            )
            for found, low_frame in zip(errors, low_frames, strict=True):
                found.append(_errors(high_frame, low_frame, depth_tolerance))
            advance(1)
    with stages.stage("similarity"):
        bare, mapped, *normals_only = (
            _closeness(found, frames[0], frame)
            for found, frame in zip(errors, frames[1:], strict=True)
        )
    return Comparison(
        mapped=mapped,
        bare=bare,
        views=views,
        high_frame=frames[0],
        bare_frame=frames[1],
        mapped_frame=frames[2],
        angles_deg=_angles(frames[0], frames[2], depth_tolerance),
        names=(
            f"{high.name}: {high.n_faces:,} triangles",
            f"{low.name}: {low.n_faces:,} triangles",
            f"{low.name} with its maps",
        ),
        normals_only=normals_only[0] if normals_only else None,
        normals_frame=frames[3] if normals_only else None,
    )


def _scenes(
    high: Mesh,
    low: Mesh,
    materials: Materials | None,
    options: RenderOptions,
    maps: dict[str, Any],
) -> list[Scene]:
    """Scenes of the high-poly mesh, of the low-poly mesh without maps, and of each use of them."""
    scenes = [
        _with_normal_maps(studio_scene(high, options=options), materials),
        studio_scene(low, options=options),
        studio_scene(low, options=options, edge_px=None, **maps),
    ]
    if maps["normal_map"] is not None and maps["displacement"] is not None:
        scenes.append(studio_scene(low, options=options, **{**maps, "displacement": None}))
    return scenes


def _with_normal_maps(scene: Scene, materials: Materials | None) -> Scene:
    """Return the scene of one mesh with the normal maps of its materials."""
    if materials is None or not any(materials.sources("normal")):
        return scene
    (plain,) = scene.objects
    parts = scene_from_materials(plain.mesh, materials.only(("normal",))).objects
    objects = tuple(
        replace(part, material=replace(plain.material, normal_map=part.material.normal_map))
        for part in parts
    )
    return replace(scene, objects=objects)


@dataclass(frozen=True, eq=False)
class _Errors:
    """Angles in degrees in one view, and the number of pixels that see either mesh."""

    angles: npt.NDArray[np.float32]
    n_either: int


def _around(options: RenderOptions) -> tuple[tuple[float, float], ...]:
    return tuple(
        (options.view[0] + k * 360.0 / _N_VIEWS, _ELEVATION if k % 2 == 0 else -_ELEVATION)
        for k in range(_N_VIEWS)
    )


def _errors(high: Frame, low: Frame, depth_tolerance: float) -> _Errors:
    angles = _angles(high, low, depth_tolerance)
    return _Errors(
        angles[np.isfinite(angles)],
        int(np.count_nonzero((high.coverage > 0) | (low.coverage > 0))),
    )


def _angles(a: Frame, b: Frame, depth_tolerance: float) -> FloatImage:
    """(H, W) float32: angle between normals in degrees; NaN where different parts are seen."""
    same = (a.coverage > 0) & (b.coverage > 0)
    same[same] = np.abs(a.depths[same] - b.depths[same]) <= depth_tolerance
    first, second = a.normals[same].astype(np.float64), b.normals[same].astype(np.float64)
    # From the chord length, which is accurate for small angles where the arc cosine is not.
    apart = pm.norm(first - second, axis=1)
    angles = np.full(same.shape, np.nan, np.float32)
    angles[same] = np.degrees(2.0 * pm.arctan2(apart, pm.norm(first + second, axis=1)))
    return angles


def _joint_diagonal(high: Mesh, low: Mesh) -> float:
    bounds = np.concatenate([high.bounds, low.bounds])
    return float(pm.norm(bounds.max(axis=0) - bounds.min(axis=0)))


def _closeness(errors: list[_Errors], high: Frame, low: Frame) -> Closeness:
    angles = np.concatenate([error.angles for error in errors]).astype(np.float64)
    n_either = sum(error.n_either for error in errors)
    if len(angles):
        mean, (median, p95) = float(angles.mean()), np.percentile(angles, (50, 95))
    else:
        mean = median = p95 = math.nan
    psnr, ssim = _similarity(high, low)
    return Closeness(
        mean_deg=mean,
        median_deg=float(median),
        p95_deg=float(p95),
        psnr_db=psnr,
        ssim=ssim,
        silhouette_mismatch=1.0 - len(angles) / n_either if n_either else 0.0,
        n_pixels=len(angles),
    )


def _similarity(high: Frame, low: Frame) -> tuple[float, float]:
    """PSNR and mean SSIM of two pictures, over the pixels that either mesh touches."""
    from skimage.metrics import peak_signal_noise_ratio, structural_similarity

    seen = (high.coverage > 0) | (low.coverage > 0)
    first, second = encode_srgb(high.color[..., :3]), encode_srgb(low.color[..., :3])
    if not seen.any() or np.array_equal(first[seen], second[seen]):
        return math.inf, 1.0
    psnr = peak_signal_noise_ratio(first[seen], second[seen], data_range=1.0)
    window = min(7, *(side - 1 + side % 2 for side in seen.shape))
    if window < 3:
        return float(psnr), math.nan
    _, similarities = structural_similarity(
        first, second, data_range=1.0, channel_axis=2, full=True, win_size=window
    )
    return float(psnr), float(similarities[seen].mean())
