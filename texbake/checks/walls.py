"""Thin walls and narrow gaps of the low-poly mesh that the rays of a bake pass through.

A ray of the bake starts in front of the low-poly surface and ends behind it, at the ray distances
that the bake fits to each vertex. It should hit the high-poly surface next to where it crosses the
low-poly one. Behind a wall thinner than the ray distance, or across a gap narrower than it, there
is another wall of the low-poly mesh; a ray that hits the high-poly surface only there takes the
detail of the wrong wall. One ray is cast from the center of each face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.options import BakeOptions
from texbake.baking.rays import RayField
from texbake.baking.scenes import BakeScenes, RayExtent
from texbake.baking.texels import Samples
from texbake.checks.checked_mesh import BoolArray, Finding
from texbake.checks.pair import MeshPair
from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

_MAX_FACES = 100_000  # faces of the low-poly mesh that rays are cast from

# Where a ray leaves the face it starts from, in the local frame: ten float32 roundings.
_LEAVES = 1e-6


@dataclass(frozen=True, eq=False)
class WallProbe:
    """What rays through the centers of low-poly faces meet, in the local frame."""

    faces: npt.NDArray[np.int64]  # (n,) int64; faces that rays were cast from
    step: int  # one of every `step` faces was used
    # (n,) float64; from the face to the back of its wall; inf beyond the end of the ray.
    thicknesses: FloatArray
    # (n,) float64; from the face to the next wall in front of it; inf beyond the start of the ray.
    gaps: FloatArray
    # (n,) float64; height of the hit on the high-poly surface above the face; NaN where the ray
    # misses.
    heights: FloatArray
    reach: RayExtent  # greatest ray distances of the bake, in model units


def probe_walls(pair: MeshPair) -> WallProbe:
    """Cast the rays: at the high-poly mesh as a bake does, at the low-poly mesh both ways."""
    low, frame, threads = pair.low, pair.frame, pair.low.options.threads
    step = -(-low.mesh.n_faces // _MAX_FACES)
    faces = np.arange(0, low.mesh.n_faces, step)
    faces = faces[low.has_area[faces]]
    middles = np.full((len(faces), 2), 1.0 / 3.0)
    samples = Samples(np.zeros(len(faces), np.int32), faces.astype(np.int32), middles)
    scene = RayScene.build(pair.high.mesh, frame, threads=threads)
    kind, scenes = BakeOptions.rays, BakeScenes(scene, low.mesh)
    reach = scenes.extent((kind,))
    longest = RayField(
        low.mesh, frame, kind=kind, front=reach.front, back=reach.back, threads=threads
    )
    rays = scenes.fitted(longest, kind).rays(samples)
    hits = scene.cast(rays)
    heights = np.where(hits.faces == NO_HIT, np.nan, rays.fronts - hits.distances)
    on_face = rays.origins + rays.fronts[:, None] * rays.directions
    scene = RayScene.build(low.mesh, frame, threads=threads)
    distances = []
    for sign, reaches in ((1.0, rays.lengths - rays.fronts), (-1.0, rays.fronts)):
        there = sign * rays.directions
        lengths = np.where(rays.lengths > 0.0, np.maximum(reaches - _LEAVES, 0.0), 0.0)
        probe = Rays(on_face + _LEAVES * there, there, lengths, np.zeros(len(faces)))
        met = scene.cast(probe, cull_back_faces=False)
        # A ray that leaves a wall meets its back, which faces along the ray.
        facing = pm.vecdot(low.normals[met.faces], there)
        meets = (met.faces != NO_HIT) & ((facing > 0.0) if sign > 0.0 else True)
        distances.append(np.where(meets, met.distances + _LEAVES, np.inf))
    return WallProbe(faces, step, distances[0], distances[1], heights, reach)


def thin_walls(pair: MeshPair, rays: WallProbe) -> Finding | None:
    """Faces of walls thinner than the distance that rays go behind them; the thinnest first."""
    thin = np.isfinite(rays.thicknesses)
    return _wall_finding(pair, "thin-walls", rays, thin, rays.thicknesses, rays.reach.back)


def other_parts(pair: MeshPair, rays: WallProbe) -> Finding | None:
    """Faces whose rays hit the high-poly surface only beyond another part of the low-poly mesh."""
    with np.errstate(invalid="ignore"):  # a ray that misses hits no wrong wall
        beyond = (rays.heights > rays.gaps) | (-rays.heights > rays.thicknesses)
    distances = np.where(rays.heights > 0.0, rays.gaps, rays.thicknesses)
    return _wall_finding(pair, "other-parts", rays, beyond, distances, rays.reach.front)


def _wall_finding(
    pair: MeshPair,
    name: str,
    rays: WallProbe,
    which: BoolArray,
    distances: FloatArray,
    reach: float,
) -> Finding | None:
    least = float(pair.frame.length_to_model(distances[which].min(initial=np.inf)))
    part = f" Only one of every {rays.step} faces was checked." if rays.step > 1 else ""
    faces, thinness = rays.faces[which], -distances[which]
    return pair.low.finding(name, len(faces), faces, thinness, least=least, reach=reach, part=part)


def wall_findings(pair: MeshPair) -> list[Finding | None]:
    """All findings about walls and gaps."""
    rays = probe_walls(pair)
    return [thin_walls(pair, rays), other_parts(pair, rays)]
