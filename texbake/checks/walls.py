"""Walls and gaps of the light mesh that the rays of a bake reach through.

A ray of the bake starts in front of the light surface and ends behind it, as far as the bake itself
measures that it must. What it should find is the dense surface next to where it crosses the light
one. Behind a wall thinner than the reach, or before a gap narrower than it, there is another part
of the light mesh; a ray that finds the dense surface only there takes the wrong one. One ray is
cast at the middle of each face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.distances import Reach, measure_reach
from texbake.baking.options import BakeOptions
from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.checks.finding import Finding, found
from texbake.checks.pair import Pair
from texbake.checks.subject import BoolArray
from texbake.mesh.mesh import FloatArray
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

_MOST_FACES = 100_000  # of the light mesh that rays are cast at
# Of the local frame's unit size: where a ray leaves the face it is cast at, ten float32 roundings.
_LEAVES = 1e-6


@dataclass(frozen=True, eq=False)
class Crossed:
    """What rays at the middles of light faces cross, in the local frame.

    Attributes
    ----------
    faces : (n,) int64
        Faces looked at.
    step : int
        One in so many faces is.
    thicknesses : (n,) float64
        From the face to the back of the wall it belongs to; inf beyond the reach.
    gaps : (n,) float64
        From the face to the next part in front of it; inf beyond the reach.
    heights : (n,) float64
        Of the dense surface that the ray finds over the light one; NaN where it finds none.
    reach : Reach
        Of the bake, in model units.
    """

    faces: npt.NDArray[np.int64]
    step: int
    thicknesses: FloatArray
    gaps: FloatArray
    heights: FloatArray
    reach: Reach


def crossed(pair: Pair) -> Crossed:
    """Cast the rays: on the dense mesh as a bake does, and on the light one both ways."""
    light, frame, threads = pair.light, pair.frame, pair.light.options.threads
    step = -(-light.mesh.n_faces // _MOST_FACES)
    faces = np.arange(0, light.mesh.n_faces, step)
    faces = faces[light.has_area[faces]]
    middles = np.full((len(faces), 2), 1.0 / 3.0)
    samples = Samples(np.zeros(len(faces), np.int32), faces.astype(np.int32), middles)
    with RayScene.build(pair.dense.mesh, frame, threads=threads) as scene:
        kind = BakeOptions.rays
        reach = measure_reach(pair.dense.mesh, light.mesh, frame, scene, kind, threads)
        field = RayField(
            light.mesh, frame, kind=kind, front=reach.front, back=reach.back, threads=threads
        )
        rays = field.rays(samples)
        hits = scene.cast(rays)
    heights = np.where(hits.faces == NO_HIT, np.nan, rays.fronts - hits.distances)
    on_face = rays.origins + rays.fronts[:, None] * rays.directions
    with RayScene.build(light.mesh, frame, threads=threads) as scene:
        ways = []
        for sign, length in ((1.0, field.back), (-1.0, field.front)):
            there = sign * rays.directions
            lengths = np.where(rays.lengths > 0.0, max(length - _LEAVES, 0.0), 0.0)
            probe = Rays(on_face + _LEAVES * there, there, lengths, np.zeros(len(faces)))
            met = scene.cast(probe, cull_back_faces=False)
            # The back of a wall is left, and looks the way that the ray goes.
            facing = np.einsum("ij,ij->i", light.normals[met.faces], there)
            meets = (met.faces != NO_HIT) & ((facing > 0.0) if sign > 0.0 else True)
            ways.append(np.where(meets, met.distances + _LEAVES, np.inf))
    return Crossed(faces, step, ways[0], ways[1], heights, reach)


def thin_walls(pair: Pair, rays: Crossed) -> Finding | None:
    """Find faces of walls thinner than rays go in behind them; the thinnest are the worst."""
    thin = np.isfinite(rays.thicknesses)
    return _found(pair, "thin-walls", rays, thin, rays.thicknesses, rays.reach.back)


def other_parts(pair: Pair, rays: Crossed) -> Finding | None:
    """Find faces whose rays find the dense surface beyond another part of the light mesh."""
    with np.errstate(invalid="ignore"):  # a ray that finds nothing finds nothing wrong
        beyond = (rays.heights > rays.gaps) | (-rays.heights > rays.thicknesses)
    ways = np.where(rays.heights > 0.0, rays.gaps, rays.thicknesses)
    return _found(pair, "other-parts", rays, beyond, ways, rays.reach.front)


def _found(
    pair: Pair, name: str, rays: Crossed, which: BoolArray, ways: FloatArray, reach: float
) -> Finding | None:
    least = float(pair.frame.length_to_model(ways[which].min(initial=np.inf)))
    part = f" One face in {rays.step} was looked at." if rays.step > 1 else ""
    return found(
        name, "light", which.sum(), rays.faces[which], -ways[which],
        least=least, reach=reach, part=part,
    )  # fmt: skip


def wall_findings(pair: Pair) -> list[Finding | None]:
    """Everything of this module."""
    rays = crossed(pair)
    return [thin_walls(pair, rays), other_parts(pair, rays)]
