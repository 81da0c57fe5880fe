"""How far rays must reach, measured from the two meshes where the user does not say.

Both ways are looked at. From the dense mesh: each of its points lies some distance outside or
inside the light surface. From the light mesh: along the very rays of the bake, the dense surface
lies some way out or in. The longest of both, and a margin for what lies between the samples, is the
reach; a longer one would let rays start beyond neighboring parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.triangle_tree import TriangleTree
from texbake.raycast.exact_hits import drop_uncertain_hits
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

_HIGH_POINTS = 200_000
_LOW_POINTS = 50_000
# Points between the samples lie a little farther than the farthest sample.
_MARGIN = 1.1
# Of the local frame's unit size: the least reach, above the rounding of float32 rays (1e-7).
LEAST_REACH = 1e-4


@dataclass(frozen=True)
class Reach:
    """Front and back distances of rays, in model units."""

    front: float
    back: float


def measure_reach(
    high: Mesh, low: Mesh, frame: LocalFrame, caster: RayScene, kind: str, threads: int | None
) -> Reach:
    """Measure how far in front of the light surface rays must start and how far behind end.

    Parameters
    ----------
    caster
        Over the dense mesh, in `frame`.
    kind
        Direction of the rays: `smooth`, `vertex` or `face`.
    """
    out_high, in_high = _from_dense_mesh(high, low, frame, threads)
    limit = 2.0 * max(out_high, in_high) + LEAST_REACH
    out_low, in_low = _from_light_mesh(high, low, frame, caster, kind, limit, threads)
    front, back = max(out_high, out_low), max(in_high, in_low)
    return Reach(
        float(frame.length_to_model(front * _MARGIN + LEAST_REACH)),
        float(frame.length_to_model(back * _MARGIN + LEAST_REACH)),
    )


def _from_dense_mesh(
    high: Mesh, low: Mesh, frame: LocalFrame, threads: int | None
) -> tuple[float, float]:
    """Greatest distance of dense vertices outside and inside the light surface, in local units."""
    positions = frame.to_local(low.positions)
    tree = TriangleTree.build(positions, low.faces, threads=threads)
    step = max(1, high.n_faces // _HIGH_POINTS)
    # All vertices, or those of some faces spread over a mesh of which any few are like the rest.
    vertices = np.unique(high.faces) if step == 1 else high.faces[::step, 0]
    points = frame.to_local(high.positions[vertices])
    distances, faces, weights = tree.closest_points(points, threads=threads)
    corners = positions[low.faces[faces]]
    closest = np.einsum("ni,nij->nj", weights, corners)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outside = np.einsum("ij,ij->i", points - closest, normals) >= 0.0
    return _greatest(distances[outside]), _greatest(distances[~outside])


def _from_light_mesh(
    high: Mesh,
    low: Mesh,
    frame: LocalFrame,
    caster: RayScene,
    kind: str,
    limit: float,
    threads: int | None,
) -> tuple[float, float]:
    """Greatest way out and in along rays to the nearer dense surface within `limit`."""
    _, faces, weights = sample_surface(low, _LOW_POINTS, seed=0, threads=threads)
    samples = Samples(np.zeros(len(faces), dtype=np.int32), faces, weights[:, 1:].copy())
    field = RayField(low, frame, kind=kind, front=0.0, back=1.0, threads=threads)
    inward = field.rays(samples)
    lengths = np.where(inward.lengths > 0.0, limit, 0.0)
    # Both ways at once, since a dense mesh in chunks is gone through once a call.
    rays = Rays.joined(
        [
            Rays(inward.origins, directions, lengths, inward.fronts)
            for directions in (-inward.directions, inward.directions)
        ]
    )
    # On its way out a ray meets the dense surface from behind.
    found = caster.cast(rays, cull_back_faces=False)
    drop_uncertain_hits(found, rays, high, frame, threads)
    out, into = np.split(np.where(found.faces == NO_HIT, np.inf, found.distances), 2)
    return (
        _greatest(out[(out < into) & np.isfinite(out)]),
        _greatest(into[(into <= out) & np.isfinite(into)]),
    )


def _greatest(distances: FloatArray) -> float:
    return float(distances.max(initial=0.0))
