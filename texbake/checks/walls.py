"""Thin walls and narrow gaps of the low-poly mesh that the rays of a bake pass through.

A ray should hit the high-poly surface next to where it crosses the low-poly one. Behind a wall
thinner than the ray distance, or across a narrower gap, it can take the detail of another wall
instead. One ray is cast from the center of each face, as far as the bake fits to it.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.options import BakeOptions
from texbake.baking.rays import RayField
from texbake.baking.scenes import BakeScenes
from texbake.baking.texels import Samples
from texbake.checks.checked_mesh import Finding
from texbake.checks.pair import MeshPair
from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, Int64Array
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

_MAX_FACES = 100_000  # faces of the low-poly mesh that rays are cast from

# Where a ray leaves the face it starts from, in the local frame: ten float32 roundings.
_LEAVES = 1e-6


def wall_findings(pair: MeshPair) -> list[Finding | None]:
    """Findings on walls thinner than rays reach behind them, and on surfaces beyond others."""
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
    rays = scenes.fitted(longest, low.mesh, kind).rays(samples)
    hits = scene.cast(rays)
    # Heights of the hits on the high-poly surface above the faces; NaN for a ray that misses.
    heights = np.where(hits.faces == NO_HIT, np.nan, rays.fronts - hits.distances)
    thicknesses, gaps = _walls(pair, faces, rays)
    with np.errstate(invalid="ignore"):  # a ray that misses hits no wrong wall
        beyond = (heights > gaps) | (-heights > thicknesses)
    passed = np.where(heights > 0.0, gaps, thicknesses)
    part = f" Only one of every {step} faces was checked." if step > 1 else ""
    return [
        low.finding(
            name,
            which.sum(),
            faces[which],
            -distances[which],
            least=float(frame.length_to_model(distances[which].min(initial=np.inf))),
            reach=end,  # in model units
            part=part,
        )
        for name, which, distances, end in (
            ("thin-walls", np.isfinite(thicknesses), thicknesses, reach.back),
            ("other-parts", beyond, passed, reach.front),
        )
    ]


def _walls(pair: MeshPair, faces: Int64Array, rays: Rays) -> tuple[FloatArray, FloatArray]:
    """(n,) local distances along rays to the back of the wall, and to the next in front; or inf."""
    low = pair.low
    on_face = rays.origins + rays.fronts[:, None] * rays.directions
    scene = RayScene.build(low.mesh, pair.frame, threads=low.options.threads)
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
    return distances[0], distances[1]
