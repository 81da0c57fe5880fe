"""The ray scenes of a bake, and how far its rays must go where the user does not say.

The extent of the rays is the greatest distance of the vertices of the high-poly mesh from the
low-poly surface, and of the high-poly surface along the rays of the bake, plus a margin for what
lies between the samples. A longer one would let rays start beyond neighboring parts of the model.

A high-poly mesh that faces inwards is flipped before it is baked, if that agrees better with the
low-poly mesh. It is examined only if the surfaces nearest to a few points of that mesh do not all
face as it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from texbake.baking.inputs import BakeInputs
from texbake.baking.ray_distances import (
    LEAST_EXTENT,
    MARGIN,
    RayProbe,
    measure_ray_distances,
    spread_corners,
)
from texbake.baking.rays import RayField
from texbake.baking.texels import Samples
from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.compose import used_rows
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.progress import Stages
from texbake.raycast.orientation import OrientationReport, oriented_in
from texbake.raycast.rays import NO_HIT, RayHits, Rays
from texbake.raycast.scene import RayScene
from texbake.records import dataclass

_HIGH_POINTS = 200_000
_LOW_POINTS = 50_000
# At most for all parts of a bake together, and at least for each part.
_PARTS_POINTS, _PART_POINTS = 8 * _LOW_POINTS, 2_000
# One high-poly point of so many is measured first: points nearer than these need no exact distance.
_FEW = 64
# Points of the low-poly mesh for each of its faces, where distances are measured vertex by vertex.
_POINTS_PER_FACE = 4
# How far rays look for a surface first, in the local frame.
_NEAR_REACH = 1.0 / 64.0
# Size of both meshes in model units: float32 holds a ten millionth of it with all its digits, and
# as many times it as rays are long without overflow.
_SIZES = (1e-30, 1e37)


@dataclass(frozen=True)
class RayExtent:
    """Model units that rays start in front of the low-poly surface and end behind it."""

    front: float
    back: float


class BakeScenes:
    """What the rays of a bake are cast into, all in one frame, and what is measured with it.

    `n_points`: points at which distances are measured; `occluders`: what secondary rays hit.
    """

    def __init__(
        self,
        high: RayScene,
        low: Mesh,
        occluders: RayScene | None = None,
        n_points: int = _LOW_POINTS,
    ) -> None:
        self.high, self.low, self.occluders = high, low, occluders
        self.frame: LocalFrame = high.frame
        self._n_points = n_points
        self._measured: dict[str, tuple[RayExtent, RayProbe]] = {}  # by the kind of rays
        self._reaches: dict[str, FloatArray] = {}

    @classmethod
    def build(
        cls,
        high: Mesh | StreamedMesh,
        low: Mesh,
        stages: Stages,
        *,
        occluders: RayScene | None = None,
        n_parts: int = 1,
        chunk_faces: int | None = None,
        compact: bool = False,
        threads: int | None = None,
    ) -> BakeScenes:
        """Build the scene of the high-poly mesh, in the frame of `occluders` or of both meshes."""
        frame = LocalFrame.around(high, low) if occluders is None else occluders.frame
        # Lengths of the meshes must fit into the float32 numbers of hits and maps.
        size = 1.0 / frame.scale
        if not _SIZES[0] <= size <= _SIZES[1]:
            raise MeshError(
                f"{low.name}: it and the high-poly mesh are about {size:.1e} model units across, "
                "which the float32 numbers of maps cannot hold; scale both meshes first"
            )
        with stages.stage("build ray tree", total=high.n_faces, unit="triangles"):
            scene = RayScene.build(
                high, frame, chunk_faces=chunk_faces, compact=compact, threads=threads
            )
        n_points = max(min(_LOW_POINTS, _PARTS_POINTS // n_parts), _PART_POINTS)
        return cls(scene, low, occluders, n_points)

    def extent(self, kinds: Sequence[str]) -> RayExtent:
        """Greatest extent of rays of some kinds; measured once for all that use these scenes."""
        for kind in kinds:
            if kind not in self._measured:
                self._measured[kind] = _measured(self.high, self.low, kind, self._n_points)
        extents = [self._measured[kind][0] for kind in kinds]
        return RayExtent(
            max(extent.front for extent in extents), max(extent.back for extent in extents)
        )

    def reach(self, low: Mesh, kind: str) -> FloatArray:
        """(F, 3, 2) local ray distances at corners, also of a tile; measured once for each kind."""
        if kind not in self._reaches:
            extent = self.extent((kind,))
            _, probe = self._measured[kind]
            n_points = min(_POINTS_PER_FACE * self.low.n_faces, _HIGH_POINTS)
            # A tile is probed again as well, no farther than its rays go.
            if low is not self.low or n_points > len(probe.faces):
                limit = float(self.frame.length_to_local(max(extent.front, extent.back)))
                n_points = max(n_points, self._n_points)
                probe = probe_both_ways(self.high, self.low, kind, n_points, limit)
            self._reaches[kind] = measure_ray_distances(
                self.high.source, self.low, self.frame, probe, threads=self.high.threads
            )
        reaches = self._reaches[kind]
        if low is self.low:
            return reaches
        corners = weld_rows(low.positions)[low.faces]
        return np.asarray(reaches[weld_rows(corners)])

    def fitted(self, field: RayField, low: Mesh, kind: str) -> RayField:
        """Return rays that reach as far as each vertex needs, and never farther than a field's."""
        return field.with_reaches(np.minimum(self.reach(low, kind), (field.front, field.back)))

    @cached_property
    def low_scene(self) -> RayScene:
        """The scene of the low-poly mesh."""
        return RayScene.build(self.low, self.frame, threads=self.high.threads)

    @cached_property
    def closest_tree(self) -> TriangleTree:
        """A tree for the closest points of the high-poly mesh."""
        mesh, threads = self.high.mesh, self.high.threads
        return TriangleTree.build(self.frame.to_local(mesh.positions), mesh.faces, threads=threads)

    def with_high(self, turned: Mesh, stages: Stages) -> BakeScenes:
        """Return scenes with the same high-poly mesh flipped."""
        with stages.stage("build ray tree", total=turned.n_faces, unit="triangles"):
            high = self.high
            scene = RayScene.build(turned, self.frame, compact=high.compact, threads=high.threads)
        return BakeScenes(scene, self.low, self.occluders, self._n_points)


def measure_extent(scene: RayScene, low: Mesh, kind: str) -> RayExtent:
    """Measure how far in front of the low-poly surface rays start, and how far behind they end."""
    return _measured(scene, low, kind, _LOW_POINTS)[0]


def _measured(scene: RayScene, low: Mesh, kind: str, n_points: int) -> tuple[RayExtent, RayProbe]:
    """As `measure_extent`; also return what the rays of the low-poly mesh met."""
    points, positions = _spread_points(scene.source), scene.frame.to_local(low.positions)
    tree = TriangleTree.build(positions, low.faces, threads=scene.threads)
    few = _from_high(scene, tree, points[::_FEW], (0.0, 0.0))
    out_high, in_high = _from_high(scene, tree, points, few)
    limit = 2.0 * max(out_high, in_high) + LEAST_EXTENT
    probe = probe_both_ways(scene, low, kind, n_points, limit)
    if ((probe.out.faces == NO_HIT) & (probe.into.faces == NO_HIT)).any():
        # The corners of a bevel may lie on the low-poly surface, and all that is between them deep
        # below it.
        mid = _from_high(scene, tree, _middles(scene.source), (out_high, in_high))
        if max(mid) > max(out_high, in_high):
            out_high, in_high = mid
            probe = _cast_farther(scene, probe, 2.0 * max(out_high, in_high) + LEAST_EXTENT)
    out_low, in_low = _from_low(probe)
    front, back = max(out_high, out_low), max(in_high, in_low)
    extent = RayExtent(
        float(scene.frame.length_to_model(front * MARGIN + LEAST_EXTENT)),
        float(scene.frame.length_to_model(back * MARGIN + LEAST_EXTENT)),
    )
    return extent, probe


def _from_high(
    scene: RayScene, low: TriangleTree, points: FloatArray, known: tuple[float, float]
) -> tuple[float, float]:
    """Greatest local distance of high-poly points outside and inside, measured above `known`."""
    points, enough = scene.frame.to_local(points), min(known)
    distances, faces, weights = low.closest_points(points, enough=enough, threads=scene.threads)
    far = distances > enough
    corners = low.positions[low.faces[faces[far]]]
    closest = pm.vecmat(weights[far], corners)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outside = pm.vecdot(points[far] - closest, normals) >= 0.0
    distances = distances[far]
    return (
        max(known[0], _greatest(distances[outside])),
        max(known[1], _greatest(distances[~outside])),
    )


def _spread_points(high: Mesh | StreamedMesh) -> FloatArray:
    """All vertices, or in a large mesh one for each of evenly spread faces: (n, 3) float64."""
    step = max(1, high.n_faces // _HIGH_POINTS)
    if step == 1 and isinstance(high, Mesh):
        return high.positions[used_rows(high.faces, high.n_vertices)[0]]
    return spread_corners(high, step)[:, : 3 if step == 1 else 1].reshape(-1, 3)


def _middles(high: Mesh | StreamedMesh) -> FloatArray:
    """(n, 3) float64: middles of faces and their edges, in a large mesh of evenly spread faces."""
    corners = spread_corners(high, max(1, high.n_faces // (_HIGH_POINTS // 4)))
    first, second, third = np.moveaxis(corners, 1, 0)
    edges = [(first + second) / 2.0, (second + third) / 2.0, (third + first) / 2.0]
    return np.concatenate([*edges, (first + second + third) / 3.0])


def _from_low(probe: RayProbe) -> tuple[float, float]:
    """Greatest distance out and in along rays to the nearer high-poly surface."""
    hits = probe.out, probe.into
    out, into = (np.where(found.faces == NO_HIT, np.inf, found.distances) for found in hits)
    return (
        _greatest(out[(out < into) & np.isfinite(out)]),
        _greatest(into[(into <= out) & np.isfinite(into)]),
    )


def probe_both_ways(scene: RayScene, low: Mesh, kind: str, n_points: int, limit: float) -> RayProbe:
    """Cast rays of length `limit` out and in from low-poly points, to front and back faces."""
    threads = scene.threads
    _, faces, weights = sample_surface(low, n_points, seed=0, threads=threads)
    samples = Samples(np.zeros(len(faces), dtype=np.int32), faces, weights[:, 1:].copy())
    field = RayField(low, scene.frame, kind=kind, front=0.0, back=1.0, threads=threads)
    inward, n = field.rays(samples), len(samples)
    probe = RayProbe(faces, inward, RayHits.misses(n), RayHits.misses(n))
    # Most rays meet something near. A scene in chunks takes longer for two calls.
    near = limit if scene.in_chunks else min(_NEAR_REACH, limit)
    for reach in sorted({near, limit}):
        probe = _cast_farther(scene, probe, reach)
    return probe


def _cast_farther(scene: RayScene, probe: RayProbe, limit: float) -> RayProbe:
    """Cast longer rays from points of a probe that met no surface facing as the mesh does."""
    rows = np.flatnonzero(np.isinf(probe.distances()).all(axis=0))
    inward = probe.inward.where(rows)
    lengths = np.where(inward.lengths > 0.0, limit, 0.0)
    # Both directions at once, since a scene in chunks rebuilds its trees for each call.
    rays = Rays.joined(
        [
            Rays(inward.origins, directions, lengths, inward.fronts)
            for directions in (-inward.directions, inward.directions)
        ]
    )
    found = scene.cast(rays, cull_back_faces=False)
    out, into = (RayHits.joined([hits]) for hits in (probe.out, probe.into))
    out.take(found.where(slice(len(rows))), rows)
    into.take(found.where(slice(len(rows), None)), rows)
    return RayProbe(probe.faces, probe.inward, out, into)


def _greatest(distances: FloatArray) -> float:
    return float(distances.max(initial=0.0))


_POINTS = 4096
# Share of the points at which the surfaces may face against each other, as thin walls do here and
# there, before the high-poly mesh is examined.
_TOLERATED = 0.01
# Farther than any place, in the local frame, whose unit is about the size of both meshes.
_REACH = 4.0


def face_outwards(
    inputs: BakeInputs, scenes: BakeScenes, stages: Stages
) -> tuple[BakeInputs, BakeScenes, OrientationReport]:
    """Flip parts of an unchunked high-poly mesh that face inwards, if `orientation` is auto."""
    high, options = inputs.source, inputs.options
    nothing = OrientationReport(mesh=high.name)
    if options.orientation == "keep" or isinstance(high, StreamedMesh) or scenes.high.in_chunks:
        return inputs, scenes, nothing
    with stages.part("find outside"):
        against = _share_against(scenes, inputs.low, options.rays)
    if against <= _TOLERATED:
        return inputs, scenes, nothing
    with stages.stage("find outside"):
        turned, report = oriented_in(high, scenes.high)
    if turned is high:
        return inputs, scenes, report
    others = scenes.with_high(turned, stages)
    if _share_against(others, inputs.low, options.rays) >= against:
        # A room that is seen from within faces inwards on purpose, as its low-poly mesh does.
        return inputs, scenes, nothing
    return replace(inputs, high_surface=replace(inputs.high_surface, mesh=turned)), others, report


def _share_against(scenes: BakeScenes, low: Mesh, kind: str) -> float:
    """Share of points of the low-poly mesh whose nearest high-poly surface faces against them."""
    probe = probe_both_ways(scenes.high, low, kind, _POINTS, _REACH)
    out, into = probe.out, probe.into
    distances = [np.where(hits.faces == NO_HIT, np.inf, hits.distances) for hits in (out, into)]
    # A ray that goes out meets a surface from behind, one that goes in from the front.
    is_out = distances[0] < distances[1]
    against = np.where(is_out, ~out.passed_back, into.passed_back)
    found = np.isfinite(np.minimum(*distances))
    return float(np.count_nonzero(against & found)) / max(int(np.count_nonzero(found)), 1)
