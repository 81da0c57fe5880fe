"""Ground truth for maps: rays from points of the low-poly mesh, or very many rays per texel.

From each of evenly spread probes a ray is cast as in a bake, and its hit is the truth: the normal
and the height of the high-poly mesh, or of its closed form. Maps are read as in a renderer:
bilinearly, and from tangent space with interpolated normals and tangents.

For the mean normal of a texel, all rays are added up before normalizing: a mean of normalized means
would give too much weight to parts with differing normals.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MAPS
from texbake.baking.options import BakeOptions
from texbake.baking.rays import RayField
from texbake.baking.scenes import measure_extent
from texbake.baking.texels import Samples
from texbake.baking.trace import BakeSetup, Trace
from texbake.core import portable_math as pm
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals, smooth_normals
from texbake.mesh.tangents import shading_tangents
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.study.knob import StudyPair
from texbake.study.truth.surfaces import Surface
from texbake.texture.lookup import lookup


@dataclass(frozen=True, eq=False)
class Probes:
    """Points on an unwrapped low-poly mesh, and what the high-poly mesh is like there."""

    low: Mesh
    faces: IntArray  # (n,) int32
    barycentrics: FloatArray  # (n, 3) float64
    normals: FloatArray  # (n, 3) float64; true unit normals in model space
    # (n,) float64; true heights along the ray, in model units, positive outwards.
    heights: FloatArray
    # Mean error of the high-poly mesh itself, in degrees: no map of it is more accurate.
    high_deg: float = 0.0

    @cached_property
    def uvs(self) -> FloatArray:
        """(n, 2) float64 texture coordinates."""
        return np.asarray(pm.vecmat(self.barycentrics, self.low.corner_uvs()[self.faces]))

    @cached_property
    def points(self) -> FloatArray:
        """(n, 3) float64 places in model space."""
        return np.asarray(
            pm.vecmat(self.barycentrics, self.low.positions[self.low.faces[self.faces]])
        )

    @cached_property
    def outward(self) -> FloatArray:
        """(n, 3) float64 smooth normals of the low-poly mesh, along which it is displaced."""
        return _smooth(self.low, self.faces, self.barycentrics)

    @cached_property
    def frames(self) -> FloatArray:
        """(n, 3, 3) float64 rows T, B, N as a renderer interpolates them, not normalized."""
        normals, corners = shading_normals(self.low)
        t4 = shading_tangents(self.low)[self.faces].astype(np.float64)
        n = pm.vecmat(self.barycentrics, normals[corners[self.faces]])
        t = pm.vecmat(self.barycentrics, t4[:, :, :3])
        return np.stack([t, np.cross(n, t) * t4[:, 0, 3:], n], axis=1)

    def normal_errors(self, tangent_normals: Float32Array) -> FloatArray:
        """(n,) angles in degrees between the truth and a tangent-space normal map (H, W, 3)."""
        read = lookup(tangent_normals, self.uvs).astype(np.float64)
        return angles_deg(pm.vecmat(read, self.frames), self.normals)

    def height_errors(self, heights: Float32Array) -> FloatArray:
        """(n,) differences in model units between the truth and a displacement map (H, W, 1)."""
        return np.abs(lookup(heights, self.uvs)[:, 0].astype(np.float64) - self.heights)


def angles_deg(vectors: FloatArray, units: FloatArray) -> FloatArray:
    """(n,) angles in degrees between nonzero vectors and unit vectors, exact for small ones."""
    lengths = np.sqrt(pm.vecdot(vectors, vectors))
    away = vectors / np.where(lengths > 0.0, lengths, 1.0)[:, None] - units
    chords = np.sqrt(pm.vecdot(away, away))
    return np.asarray(np.degrees(2.0 * pm.arcsin(np.minimum(0.5 * chords, 1.0))))


def probe(pair: StudyPair, n: int, *, threads: int | None = None) -> Probes:
    """Cast a ray from each of about `n` points of a low-poly mesh; keep clear hits."""
    high, low = pair.high, pair.low
    _, faces, barycentrics = sample_surface(low, n, threads=threads)
    frame = LocalFrame.around(high, low)
    scene = RayScene.build(high, frame, threads=threads)
    reach = measure_extent(scene, low, "smooth")
    field = RayField(low, frame, kind="smooth", front=reach.front, back=reach.back, threads=threads)
    samples = Samples(
        np.arange(n, dtype=np.int32), faces, np.ascontiguousarray(barycentrics[:, 1:])
    )
    rays = field.rays(samples)
    hits = scene.cast(rays)
    heights = (rays.fronts - hits.distances) / frame.scale
    hit = hits.faces != NO_HIT
    high_normals, high_corners = shading_normals(high, threads=threads)
    b = hits.barycentrics
    weights = np.column_stack([1.0 - b.sum(axis=1), b])
    normals = pm.vecmat(weights, high_normals[high_corners[hits.faces]])
    truth = normals
    if pair.surface is not None:
        points = _points_on(high, hits.faces, weights)
        exact, settled = pair.surface.hits(points, rays.directions)
        truth = pair.surface.normals(exact)
        heights -= pm.vecdot(exact - points, rays.directions)
        hit &= settled
    lengths = pm.norm(truth, axis=1)
    hit &= (lengths > 0.0) & (pm.vecdot(normals, normals) > 0.0)
    truth = truth[hit] / lengths[hit, None]
    off = float(angles_deg(normals[hit], truth).mean()) if hit.any() else 0.0
    return Probes(low, faces[hit], barycentrics[hit], truth, heights[hit], off)


def probe_surface(surface: Surface, low: Mesh, n: int, *, reach: float) -> Probes:
    """Follow rays over ±`reach` from about `n` points of a low-poly mesh to a formula."""
    points, faces, barycentrics = sample_surface(low, n)
    outward = _smooth(low, faces, barycentrics)
    starts = points + reach * outward
    distances, found = surface.first_hits(starts, -outward, 2.0 * reach)
    hits = starts - distances[:, None] * outward
    return Probes(
        low, faces[found], barycentrics[found], surface.normals(hits[found]),
        reach - distances[found],
    )  # fmt: skip


def _smooth(low: Mesh, faces: IntArray, barycentrics: FloatArray) -> FloatArray:
    normals = pm.vecmat(barycentrics, smooth_normals(low)[low.faces[faces]])
    lengths = pm.norm(normals, axis=1)
    return np.asarray(normals / np.where(lengths > 0.0, lengths, 1.0)[:, None])


def truth_of(pair: StudyPair, probes: Probes) -> tuple[str, str]:
    """Return the kind of truth that the probes of a pair have, and a sentence on it."""
    if pair.surface is not None:
        return "closed form", (
            "From points spread evenly over the low-poly mesh, rays are cast at the formula that "
            "the high-poly mesh was made from; its normal and height there are the truth. The "
            f"normals of the high-poly mesh itself are off by {probes.high_deg:.3f}° there, and no "
            "map is more accurate."
        )
    return "rays", (
        "From points spread evenly over the low-poly mesh, rays are cast at the high-poly mesh; "
        "what they hit is the truth, without a texture between."
    )


def _points_on(mesh: Mesh, faces: IntArray, weights: FloatArray) -> FloatArray:
    return np.asarray(pm.vecmat(weights, mesh.positions[mesh.faces[faces]]))


# Finer texels along one side of each texel, and their samples: a grid of 16 x 16 in all.
_FINER, _SAMPLES = 2, 64
N_RAYS = _FINER**2 * _SAMPLES


def mean_normals(
    pair: StudyPair, size: int, *, threads: int | None = None
) -> tuple[FloatArray, BoolArray]:
    """(size, size, 3) mean tangent-space normals over covered texels, and where known."""
    options = BakeOptions(size=_FINER * size, samples=_SAMPLES, threads=threads)
    inputs = BakeInputs.of(pair.high, pair.low, options)
    sums = np.zeros((size * size, 3))
    for hits in Trace(BakeSetup([], inputs, Stages())).hits():
        _add(hits.where(hits.is_hit), inputs, size, sums)
    lengths = pm.norm(sums, axis=1, keepdims=True)
    means = sums / np.where(lengths > 0.0, lengths, 1.0)
    return means.reshape(size, size, 3), (lengths > 0.0).reshape(size, size)


def _add(hits: Hits, inputs: BakeInputs, size: int, sums: FloatArray) -> None:
    """Add the normals of some hits, whose texels are the finer ones."""
    if not len(hits):
        return
    rows, columns = np.divmod(hits.texel_ids, _FINER * size)
    texels = (rows // _FINER) * size + columns // _FINER
    # A trace goes row by row, so these are few of all texels.
    first, stop = int(texels.min()), int(texels.max()) + 1
    values = MAPS["normal"].values(hits, inputs)
    for axis in range(3):
        sums[first:stop, axis] += np.bincount(texels - first, values[:, axis], stop - first)
