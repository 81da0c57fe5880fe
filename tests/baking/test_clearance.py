"""Models whose parts stand close together: each texel has the surface of its own part.

A texel counts as wrong where its ray hits another part although the point of its own part that the
ray comes to lies in the open. How many there were with one distance for all rays stands beside.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.baking.crowded_parts import Crowd, hand, hinge
from texbake.baking.bake import bake
from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.triangle_tree import TriangleTree

SIZE = 128
BoolArray = npt.NDArray[np.bool_]


def bake_of(crowd: Crowd, **changes: float) -> Hits:
    result = bake(crowd.high, crowd.low, BakeOptions(size=SIZE, keep_hits=True, **changes))
    assert result.hits is not None
    return result.hits


def lies_open(crowd: Crowd) -> BoolArray:
    """(SIZE * SIZE,) bool: whether the texel's own part, baked alone, is outside of all others."""
    is_open = np.zeros(SIZE * SIZE, dtype=np.bool_)
    trees = [TriangleTree.build(mesh.positions, mesh.faces) for mesh in crowd.alone]
    assert crowd.low.uv_faces is not None
    for part, high in enumerate(crowd.alone):
        own = crowd.low_parts == part
        low = Mesh(
            positions=crowd.low.positions,
            faces=crowd.low.faces[own],
            uvs=crowd.low.uvs,
            uv_faces=crowd.low.uv_faces[own],
        )
        hits = bake(high, low, BakeOptions(size=SIZE, front=0.3, back=0.1, keep_hits=True)).hits
        assert hits is not None
        hits = hits.where(hits.high_faces >= 0)
        second, third = hits.low_barycentrics.T.astype(np.float64)
        weights = np.stack([1.0 - second - third, second, third], axis=1)
        points = np.einsum("ni,nij->nj", weights, low.positions[low.faces[hits.low_faces]])
        points += hits.offsets
        others = [tree for other, tree in enumerate(trees) if other != part]
        is_open[hits.texel_ids] = np.all([is_outside(points, tree) for tree in others], axis=0)
    return is_open


def is_outside(points: FloatArray, tree: TriangleTree) -> BoolArray:
    """(n,) bool: whether points are in front of the closest face of a closed mesh."""
    _, faces, weights = tree.closest_points(points)
    corners = tree.positions[tree.faces[faces]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offsets = points - np.einsum("ni,nij->nj", weights, corners)
    return np.asarray(np.einsum("ij,ij->i", offsets, normals) >= 0.0)


def n_wrong(crowd: Crowd, hits: Hits, is_open: BoolArray) -> int:
    assert crowd.high.face_groups is not None
    hits = hits.where((hits.high_faces >= 0) & is_open[hits.texel_ids])
    return int(
        np.count_nonzero(crowd.high.face_groups[hits.high_faces] != crowd.low_parts[hits.low_faces])
    )


@pytest.mark.parametrize(
    ("make", "front", "back", "before", "most"),
    [(hand, 0.22, 0.004, 500, 15), (hinge, 0.275, 0.11, 500, 7)],
)
def test_texels_have_the_surface_of_their_own_part(make, front, back, before, most):
    """`before`: at least as many are wrong with the greatest distances everywhere."""
    model = make()
    is_open = lies_open(model)
    assert n_wrong(model, bake_of(model, front=front, back=back), is_open) > before
    fitted = bake_of(model)
    assert n_wrong(model, fitted, is_open) <= most
    assert np.count_nonzero(fitted.high_faces < 0) == 0
