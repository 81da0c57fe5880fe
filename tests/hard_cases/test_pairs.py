"""Every stage that takes two meshes, on every pair of the catalog."""

import numpy as np
import pytest

import texbake


def baked(pair, **options):
    maps = ("normal", "displacement", "vector-displacement")
    options = texbake.BakeOptions(size=48, maps=maps, threads=1, **options)
    return texbake.bake(pair.high, pair.low, options)


@pytest.mark.parametrize("cull", [True, False])
@pytest.mark.parametrize("rays", ["smooth", "vertex", "face"])
def test_maps_are_finite_and_unit_and_misses_are_counted(pair_case, rays, cull):
    result = baked(pair_case.make(), rays=rays, cull_back_faces=cull)
    for item in result.maps.values():
        assert np.isfinite(item.values).all()
    lengths = np.linalg.norm(result.maps["normal"].values.astype(np.float64), axis=2)
    assert np.abs(lengths - 1.0).max() < 2e-7
    assert result.report.texels_missed == np.count_nonzero(result.missed)
    assert (result.missed <= (result.texel_faces >= 0)).all()


def test_heights_are_those_of_the_surface_in_front(pair_case):
    """Closed form: sheets lie over one another at one distance, but for the one set apart."""
    pair = pair_case.make()
    result = baked(pair)
    if "apart" in pair_case.traits:
        return
    faces = result.texel_faces[result.has_data]
    heights = result.maps["displacement"].values[..., 0][result.has_data]
    near = pair.low.positions[pair.low.faces[faces]][..., 0].max(axis=1) <= 1.0
    # Found in float64, kept in float32.
    np.testing.assert_allclose(heights[near], pair.height, rtol=0, atol=1e-6)


def test_rays_miss_where_there_is_no_surface(case_named):
    hole = baked(case_named("high-poly mesh with a hole").make())
    assert 0 < hole.report.texels_missed < hole.report.texels_covered
    inside_out = baked(case_named("high-poly mesh inside out").make())
    assert inside_out.report.texels_missed == inside_out.report.texels_covered
    assert inside_out.report.counts.rays_past_back_faces > 0


# What the checks must report for each pair; for the others, nothing but notes.
SAID = {
    "high-poly mesh coarser than the low-poly one": "high-is-coarser",
    # Rays are as long as each vertex needs, and so do not go through the wall.
    "wall thinner than the cage": "close-charts",
    "high-poly mesh with a hole": "far-from-high",
    "high-poly mesh inside out": "opposite-sides",
    "high-poly mesh elsewhere": "differing-place",
}


def test_the_checks_name_it(pair_case):
    pair = pair_case.make()
    report = texbake.check(pair.high, pair.low, texbake.CheckOptions(size=48))
    name = SAID.get(pair_case.name)
    assert name is None or report.finding(name) is not None
    if name is None:
        assert {finding.severity for finding in report.findings} <= {"note"}


def test_distances_are_finite_and_compared_pictures_too(pair_case):
    pair = pair_case.make()
    assert np.isfinite(texbake.surface_distance(pair.low, pair.high, n_samples=200).max)
    options = texbake.RenderOptions(width=24, height=16)
    views = [(30.0, 20.0)]
    seen = texbake.compare(pair.high, pair.low, options=options, views=views, threads=1)
    assert 0.0 <= seen.bare.outline_mismatch <= 1.0
