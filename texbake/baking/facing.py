"""A high-poly mesh that faces inwards is flipped before it is baked.

Rays from a few points of the low-poly mesh show whether that could be so: the nearest high-poly
surface along them should face as the low-poly mesh does. Only if some of it does not, which is
rare, the whole high-poly mesh is examined. It is flipped only if it then agrees better.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.baking.inputs import BakeInputs
from texbake.baking.scenes import BakeScenes, probe_both_ways
from texbake.mesh.mesh import Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.progress import Stages
from texbake.raycast.orientation import OrientationReport, oriented_in
from texbake.raycast.rays import NO_HIT

_POINTS = 4096
# Share of the points at which the surfaces may face against each other, as thin walls do here and
# there, before the high-poly mesh is examined.
_TOLERATED = 0.01
# How far to look, in the local frame, whose unit is about the size of both meshes.
_REACH = 4.0


def face_outwards(
    inputs: BakeInputs, scenes: BakeScenes, stages: Stages
) -> tuple[BakeInputs, BakeScenes, OrientationReport]:
    """Flip the parts of the high-poly mesh that face inwards, if `orientation` is auto.

    A mesh that is traced in chunks is left as it is.

    Returns the inputs and scenes given, or others with the mesh flipped; the given scenes are then
    closed.
    """
    high, options = inputs.source, inputs.options
    nothing = OrientationReport(mesh=high.name)
    if options.orientation == "keep" or isinstance(high, StreamedMesh) or scenes.high.in_chunks:
        return inputs, scenes, nothing
    with stages.part("measure distances"):
        against = _share_against(scenes, inputs.low, options.rays)
    if against <= _TOLERATED:
        return inputs, scenes, nothing
    with stages.stage("find which side is outside"):
        turned, report = oriented_in(high, scenes.high)
    if turned is high:
        return inputs, scenes, report
    others = scenes.with_high(turned, stages)
    if _share_against(others, inputs.low, options.rays) >= against:
        # A room that is seen from within faces inwards on purpose, as its low-poly mesh does.
        others.close()
        return inputs, scenes, nothing
    scenes.close()
    surface = replace(inputs.high_surface, mesh=turned)
    return replace(inputs, high_surface=surface), others, report


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
