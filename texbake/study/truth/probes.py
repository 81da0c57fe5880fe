"""Truth at any point of a light mesh: a ray cast from that very point, with no texture between.

Probes are spread evenly over the light mesh. At each, a ray goes where a bake's would go, and what
it finds is the truth: the normal and the height of the dense mesh, or of the closed form that it
was made from. A map is held against it as a renderer reads it: looked up bilinearly at the probe's
coordinates, and turned from tangent space with interpolated normals and tangents.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.baking.distances import measure_reach
from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents
from texbake.raycast.rays import NO_HIT
from texbake.raycast.scene import RayScene
from texbake.study.case import Pair
from texbake.texture.lookup import lookup


@dataclass(frozen=True, eq=False)
class Probes:
    """Points on a light mesh with coordinates, and what lies there on the dense one.

    Attributes
    ----------
    low : Mesh
    faces : (n,) int32
    barycentrics : (n, 3) float64
    normals : (n, 3) float64
        True ones, unit, model space.
    heights : (n,) float64
        True ones along the ray, model units, positive outwards.
    dense_deg : float
        By how much the dense mesh itself is off in the mean, in degrees: no map of it is better.
    """

    low: Mesh
    faces: IntArray
    barycentrics: FloatArray
    normals: FloatArray
    heights: FloatArray
    dense_deg: float

    @cached_property
    def uvs(self) -> FloatArray:
        """(n, 2) float64: texture coordinates."""
        return np.asarray(
            np.einsum("nc,ncx->nx", self.barycentrics, self.low.corner_uvs()[self.faces])
        )

    @cached_property
    def frames(self) -> FloatArray:
        """(n, 3, 3) float64: rows T, B, N as a renderer interpolates them, not normalized."""
        normals, corners = shading_normals(self.low)
        tangents = corner_tangents(self.low) if self.low.tangents is None else self.low.tangents
        t4 = tangents[self.faces].astype(np.float64)
        n = np.einsum("nc,ncx->nx", self.barycentrics, normals[corners[self.faces]])
        t = np.einsum("nc,ncx->nx", self.barycentrics, t4[:, :, :3])
        return np.stack([t, np.cross(n, t) * t4[:, 0, 3:], n], axis=1)

    def normal_errors(self, tangent_normals: npt.NDArray[np.float32]) -> FloatArray:
        """(n,) degrees between the truth and a tangent-space normal map (H, W, 3)."""
        read = lookup(tangent_normals, self.uvs).astype(np.float64)
        return angles_deg(np.einsum("nk,nkx->nx", read, self.frames), self.normals)

    def height_errors(self, heights: npt.NDArray[np.float32]) -> FloatArray:
        """(n,) model units between the truth and a displacement map (H, W, 1)."""
        return np.abs(lookup(heights, self.uvs)[:, 0].astype(np.float64) - self.heights)


def angles_deg(vectors: FloatArray, units: FloatArray) -> FloatArray:
    """(n,) degrees between vectors of any length but 0 and unit vectors, exact for small ones."""
    lengths = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    away = vectors / np.where(lengths > 0.0, lengths, 1.0)[:, None] - units
    chords = np.sqrt(np.einsum("ij,ij->i", away, away))
    return np.asarray(np.degrees(2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))))


def probe(pair: Pair, n: int, *, kind: str = "smooth", threads: int | None = None) -> Probes:
    """Cast a ray from each of about `n` points of a light mesh.

    Points whose ray finds nothing are left out, and so are those at which the closed form, where
    there is one, is only touched.
    """
    high, low = pair.high, pair.low
    _, faces, barycentrics = sample_surface(low, n, threads=threads)
    frame = LocalFrame.around(high, low)
    scene = RayScene.build(high, frame, threads=threads)
    try:
        reach = measure_reach(high, low, frame, scene, kind, threads)
        field = RayField(low, frame, kind=kind, front=reach.front, back=reach.back, threads=threads)
        samples = Samples(
            np.arange(n, dtype=np.int32), faces, np.ascontiguousarray(barycentrics[:, 1:])
        )
        rays = field.rays(samples)
        found = scene.cast(rays)
    finally:
        scene.close()
    heights = (rays.fronts - found.distances) / frame.scale
    hit = found.faces != NO_HIT
    high_normals, high_corners = shading_normals(high, threads=threads)
    b = found.barycentrics
    weights = np.column_stack([1.0 - b.sum(axis=1), b])
    normals = np.einsum("nc,ncx->nx", weights, high_normals[high_corners[found.faces]])
    truth = normals
    if pair.surface is not None:
        points = _points_on(high, found.faces, weights)
        exact, settled = pair.surface.hits(points, rays.directions)
        truth = pair.surface.normals(exact)
        heights -= np.einsum("ij,ij->i", exact - points, rays.directions)
        hit &= settled
    lengths = np.linalg.norm(truth, axis=1)
    hit &= (lengths > 0.0) & (np.einsum("ij,ij->i", normals, normals) > 0.0)
    truth = truth[hit] / lengths[hit, None]
    off = float(angles_deg(normals[hit], truth).mean()) if hit.any() else 0.0
    return Probes(low, faces[hit], barycentrics[hit], truth, heights[hit], off)


def truth_of(pair: Pair, probes: Probes) -> tuple[str, str]:
    """Return which truth the probes of a pair tell, and a sentence on it."""
    if pair.surface is not None:
        return "closed form", (
            "At points spread evenly over the light mesh, a ray of its own meets the formula that "
            "the dense mesh was made from; its normal and height there are the truth. The dense "
            f"mesh's own normals are off by {probes.dense_deg:.3f}° there, which no map gets below."
        )
    return "rays", (
        "At points spread evenly over the light mesh, a ray of its own is cast into the dense "
        "mesh; what it finds is the truth, and no texture stands between."
    )


def _points_on(mesh: Mesh, faces: IntArray, weights: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nc,ncx->nx", weights, mesh.positions[mesh.faces[faces]]))
