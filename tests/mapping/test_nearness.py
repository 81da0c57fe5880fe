"""Neighbors in space lie near each other in the texture, mirror images as mirror images."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from tests.mapping.test_mirrored_charts import symmetric
from tests.mapping.test_pack import assert_kept_apart, triangles
from texbake.mapping.atlas.neighbors import Neighbors
from texbake.mapping.atlas.packing.pack import pack_charts
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.unwrap import unwrap


def neighbors_of(seed, n_charts):
    """Seams between random edges of triangles; no mirror images."""
    random = np.random.default_rng(seed)
    one, other = random.integers(0, n_charts, (2, 2 * n_charts))
    one, other = one[one != other], other[one != other]
    ends = 3 * np.stack([one, other], axis=1)[:, :, None] + np.array([0, 1])
    return Neighbors(
        seams=ends.astype(np.int32),
        weights=random.uniform(0.1, 1.0, len(ends)),
        partners=np.full(n_charts, -1, dtype=np.int32),
        mirrors=np.zeros(n_charts),
    )


def seam_cost(packing, neighbors):
    """Sum of the weighted distances between both sides of seams within tiles."""
    middles = packing.uvs[neighbors.seams].mean(axis=2)
    lengths = np.linalg.norm(middles[:, 0] - middles[:, 1], axis=1)
    tiles = packing.tiles[neighbors.seams[:, :, 0] // 3]
    return float((lengths * neighbors.weights)[tiles[:, 0] == tiles[:, 1]].sum())


@settings(max_examples=6, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.integers(2, 20), st.sampled_from([(128, 128), (128, 64)]),
    st.integers(0, 3), st.integers(1, 3),
)  # fmt: skip
@example(0, 20, (128, 128), 3, 1)
@example(1, 20, (128, 128), 3, 2)
def test_neighbors_come_nearer_at_no_cost(seed, n_charts, size, padding, tiles):
    """The same scale and tiles, no texel shared, and seams that are no longer than before."""
    uvs, faces, ids = triangles(seed, n_charts)
    neighbors = neighbors_of(seed, n_charts)
    options = {"size": size, "padding": padding, "effort": "fast", "tiles": tiles}
    before = pack_charts(uvs, faces, ids, **options)
    after = pack_charts(uvs, faces, ids, **options, neighbors=neighbors)
    assert after.texels_per_unit == before.texels_per_unit
    assert (after.tiles == before.tiles).all()
    cell = 1.0 / min(size)  # costs are measured between whole cells
    total = float(neighbors.weights.sum())
    assert seam_cost(after, neighbors) <= seam_cost(before, neighbors) + cell * total
    areas = signed_areas(after.uvs[faces] * size)
    assert areas == pytest.approx(signed_areas(uvs[faces]) * after.texels_per_unit**2)
    for tile in np.unique(after.tiles):
        own = after.tiles == tile
        corner = np.array([tile % 10, tile // 10])
        kept = own[ids[faces[:, 0]]]
        alone = replace(after, uvs=after.uvs - corner)
        chart_of = np.cumsum(own) - 1
        assert_kept_apart(alone, faces[kept], np.where(own[ids], chart_of[ids], 0), size, padding)


@pytest.mark.parametrize(("effort", "most"), [("fast", 0.85), ("good", 0.95)])
def test_neighbors_come_clearly_nearer(effort, most):
    # Measured: 0.80 and 0.89 in the mean, at 1.000 and 1.001 times the scale.
    ratios = []
    for seed in range(5):
        charts, neighbors = triangles(seed, 40), neighbors_of(seed, 40)
        before, after = (
            pack_charts(*charts, size=(256, 256), padding=1, effort=effort, neighbors=each)
            for each in (None, neighbors)
        )
        scale = after.texels_per_unit / before.texels_per_unit
        ratios.append((seam_cost(after, neighbors) / seam_cost(before, neighbors), scale))
    cost, scale = np.mean(ratios, axis=0)
    assert cost < most
    assert scale > 0.99


def mirrored_triangles(seed, n_pairs):
    """Triangles, their mirror images at any angle, and what is known of the pairs."""
    uvs, faces, ids = triangles(seed, n_pairs)
    turns = np.random.default_rng(seed).uniform(-3.0, 3.0, n_pairs)
    cos, sin = np.cos(turns)[ids], np.sin(turns)[ids]
    x, y = -uvs[:, 0], uvs[:, 1]
    images = np.stack([x * cos - y * sin, x * sin + y * cos], axis=1)
    neighbors = neighbors_of(seed, 2 * n_pairs)
    pairs = np.arange(n_pairs, dtype=np.int32)
    return (
        np.concatenate([uvs, images]),
        np.concatenate([faces, faces[:, ::-1] + len(uvs)]),
        np.concatenate([ids, ids + n_pairs]).astype(np.int32),
        replace(
            neighbors,
            partners=np.concatenate([pairs + n_pairs, pairs]).astype(np.int32),
            mirrors=np.tile(-turns, 2),
        ),
    )


def mirrored_share(uvs, others):
    """Share of pairs of triangles (n, 3, 2) that are mirror images of each other along u or v."""
    edges, images = (each - np.roll(each, 1, axis=1) for each in (uvs, others))
    same = [
        np.isclose(edges * sign, images, atol=1e-9).all(axis=(1, 2))
        for sign in ([-1.0, 1.0], [1.0, -1.0])
    ]
    return np.any(same, axis=0).mean()


def test_more_mirror_images_lie_as_mirror_images():
    shares = []
    for seed in range(4):
        uvs, faces, ids, neighbors = mirrored_triangles(seed, 8)
        options = {"size": (256, 256), "padding": 1, "effort": "good"}
        for each in (neighbors.without_pairs(), neighbors):
            packing = pack_charts(uvs, faces, ids, **options, neighbors=each)
            shares.append(mirrored_share(*packing.uvs.reshape(2, -1, 3, 2)))
    # Measured: none without the pairs, and 0.56 with them; 0.34 if unmirrored pairs cost nothing.
    without, share = np.mean(np.reshape(shares, (-1, 2)), axis=0)
    assert without < 0.1
    assert share > 0.45


def test_straight_mirror_images_lie_as_mirror_images():
    """Charts along u and v only turn by quarters, so that all pairs can be mirrored."""
    n = 8
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
    sizes = np.linspace(1.0, 2.0, n)[:, None, None]
    charts = np.concatenate([corners * sizes, (corners * [-1.0, 1.0])[::-1] * sizes])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    fans = [fan] * n + [5 - fan[:, ::-1]] * n
    faces = np.concatenate([each + 6 * k for k, each in enumerate(fans)]).astype(np.int32)
    ids = np.repeat(np.arange(2 * n, dtype=np.int32), 6)
    pairs = np.arange(n, dtype=np.int32)
    neighbors = replace(
        neighbors_of(0, 2 * n),
        seams=np.zeros((0, 2, 2), dtype=np.int32),
        weights=np.zeros(0),
        partners=np.concatenate([pairs + n, pairs]),
        mirrors=np.zeros(2 * n),
    )
    shares = []
    for each in (neighbors.without_pairs(), neighbors):
        packing = pack_charts(
            charts.reshape(-1, 2), faces, ids, size=(256, 256), padding=1, neighbors=each
        )
        at = packing.uvs.reshape(2, n, 6, 2)
        shares.append(mirrored_share(at[0], at[1][:, ::-1]))
    # Measured: 0.5 without the pairs, where half of the quarter turns are right by chance.
    assert shares[0] < 0.7
    assert shares[1] > 0.8


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_the_result_is_the_same_for_any_number_of_threads(quality):
    mesh = symmetric()
    results = [unwrap(mesh, quality=quality, threads=threads) for threads in (1, 2, 3)]
    assert len({result.uvs.tobytes() for result in results}) == 1
