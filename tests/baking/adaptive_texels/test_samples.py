"""Adaptive samples against closed forms, brute force, and themselves."""

import numpy as np
import pytest

from tests.models import moved
from texbake import BakeOptions, Mesh, OptionError, bake
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import plane

SIZE = 64


def ridge(bend=0.2, at=0.0):
    """A plane over [-1, 1]^2 that rises with slope `bend` beyond x = `at`."""
    edges = np.array([-1.0, at, 1.0])
    x, y = np.meshgrid(edges, [-1.0, 1.0])
    z = bend * np.maximum(x - at, 0.0)
    positions = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    return Mesh(positions=positions, faces=faces, name="ridge.obj")


def flat():
    """The square [-1, 1]^2 with coordinates that fill the texture."""
    mesh = plane()
    low, high = mesh.bounds
    unit = (mesh.positions[:, :2] - low[:2]) / (high - low)[:2]
    positions = np.column_stack([2 * unit - 1, np.zeros(len(unit))])
    return mesh.replace(positions=positions, uvs=unit, uv_faces=mesh.faces)


def options(**changes):
    values = {"size": SIZE, "padding": 0, "front": 0.5, "back": 0.5, "max_error": "0.5deg"}
    return BakeOptions(**{**values, **changes})


def means_by_brute_force(high, low, settings, maps):
    """Means of 256 samples per texel: 64 in each of its four quarters."""
    fine = {
        "size": 2 * SIZE, "maps": maps, "samples": 64, "padding": 0,
        "front": settings.front, "back": settings.back, "high_shading": settings.high_shading,
    }  # fmt: skip
    result = bake(high, low, BakeOptions(**fine, keep_hits=True))
    hits = result.hits
    row, column = np.divmod(hits.texel_ids, 2 * SIZE)
    texels = (row // 2) * SIZE + column // 2
    from texbake.baking.inputs import BakeInputs
    from texbake.baking.maps import MAPS

    inputs = BakeInputs.of(high, low, BakeOptions(**fine))
    hit = hits.high_faces >= 0
    results = {}
    for name in maps:
        values = MAPS[name].values(hits.where(hit), inputs)
        sums = np.stack(
            [np.bincount(texels[hit], v, SIZE * SIZE) for v in values.T.astype(float)], axis=1
        )
        counts = np.bincount(texels[hit], minlength=SIZE * SIZE)
        mean = sums / np.maximum(counts, 1)[:, None]
        if name == "normal":
            mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
        results[name] = mean.reshape(SIZE, SIZE, -1), (counts > 0).reshape(SIZE, SIZE)
    return results


def degrees(a, b):
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1)))


def test_only_texels_at_an_edge_get_more_samples():
    """The edge lies in the middle of column 40: it is divided along x, and nothing else is."""
    at = -1 + 2 * (40 + 0.3) / SIZE
    settings = options(high_shading="flat", max_error="0.2deg")
    result = bake(ridge(at=at), flat(), settings)
    report = result.report.sampling
    # The column of the edge and the two beside it, whose second differences cross it.
    assert report.sample_percents[1] >= 100 * (SIZE - 3) / SIZE
    assert report.sample_percents[64] > 0 and report.rays_per_texel < 1 + 3 / SIZE * 84
    values = result.maps["normal"].values
    slope = np.degrees(np.arctan(0.2))
    np.testing.assert_allclose(values[:, :40], np.broadcast_to([0, 0, 1], (SIZE, 40, 3)), atol=1e-6)
    assert degrees(values[:, 41:], np.array([-0.2, 0, 1]) / np.hypot(0.2, 1)).max() < 1e-4
    # 0.7 of the texel lie beyond; 64 samples resolve that to 1/8 of a texel.
    tilt = np.degrees(np.arctan2(-values[:, 40, 0], values[:, 40, 2]))
    np.testing.assert_allclose(tilt, 0.7 * slope, atol=slope / 16 + 0.05)


@pytest.mark.parametrize("maps", [("normal",), ("displacement", "object-id", "position")])
def test_where_no_error_exceeds_the_bound_it_is_the_bake_with_one_sample(maps):
    """Also where rays miss: the high-poly mesh, which is tilted, covers 5/8 of the low-poly one."""
    x, y, _ = flat().positions.T
    high = flat().replace(positions=np.stack([0.625 * x - 0.375, y, 0.1 * x], axis=1))
    one, adaptive = (
        bake(high, flat(), options(maps=maps, **{"max_error": None, **more}))
        for more in ({"samples": 1}, {"max_error": "90deg,100%"})
    )
    for name in maps:
        found, wanted = adaptive.maps[name].values, one.maps[name].values
        np.testing.assert_allclose(found, wanted, atol=1e-6)  # rounding counts as a curve
    np.testing.assert_array_equal(adaptive.texel_faces, one.texel_faces)
    np.testing.assert_array_equal(adaptive.missed, one.missed)
    assert one.missed.mean() == 0.375
    assert adaptive.report.distance_percentiles == one.report.distance_percentiles
    assert adaptive.report.texels_missed == one.report.texels_missed
    assert adaptive.report.sampling.sample_percents == {1: 100.0, 4: 0.0, 16: 0.0, 64: 0.0}


def test_values_that_change_evenly_need_one_sample_at_borders_too():
    """A turned chart: texels at its border are covered in part, and are sampled in the middle."""
    low = flat()
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    low = low.replace(uvs=0.5 + 0.6 * (low.uvs - 0.5) @ turn)
    corners = 1.5 * low.positions
    slope = np.array([0.1, 0.05])
    high = low.replace(positions=np.column_stack([corners[:, :2], corners[:, :2] @ slope]))
    settings = options(maps=("displacement",), max_error="0.004")
    result = bake(high, low, settings)
    assert result.report.sampling.sample_percents[1] == 100
    assert result.report.sampling.rays_per_texel == 1
    truth, has_data = means_by_brute_force(high, low, options(), ("displacement",))["displacement"]
    errors = np.abs(result.maps["displacement"].values - truth)[has_data & result.has_data]
    # A texel is 2 / (0.6 SIZE) wide; the middle lies within half a sub-square of a covered one, and
    # the finest slivers have their sub-squares' own.
    per_texel = 2.0 / (0.6 * SIZE) * np.linalg.norm(slope)
    assert errors.max() < 0.25 * per_texel and np.percentile(errors, 99) < per_texel / 8
    plain = bake(high, low, options(maps=("displacement",), max_error=None))
    off = np.abs(plain.maps["displacement"].values - truth)[has_data & plain.has_data]
    assert np.percentile(off, 99) > 1.4 * np.percentile(errors, 99)


def bumps(x, y):
    return 0.05 * np.sin(9 * x) * np.cos(8 * y) + 0.03 * np.abs(np.sin(5 * x + 3 * y))


@pytest.mark.parametrize(
    ("shading", "bound", "within"), [("smooth", "0.5deg", 0.999), ("flat", "2deg", 0.995)]
)
def test_the_bound_holds_against_256_samples(shading, bound, within):
    """The estimate proves nothing: on a flat-shaded mesh 64 samples miss 1/8 of a leap."""
    high, low = plane(90, 90, bumps), plane()
    settings = options(max_error=bound, high_shading=shading)
    result = bake(high, low, settings)
    truth, has_data = means_by_brute_force(high, low, settings, ("normal",))["normal"]
    np.testing.assert_array_equal(result.has_data, has_data)
    errors = degrees(result.maps["normal"].values.astype(float), truth)[has_data]
    limit = float(bound.removesuffix("deg"))
    assert (errors <= limit).mean() >= within
    one = bake(high, low, options(max_error=None, high_shading=shading))
    plain = degrees(one.maps["normal"].values.astype(float), truth)[has_data]
    assert (plain <= limit).mean() < within - 0.02  # the bound is not met by chance
    # The check agrees with the truth, up to the error of its own few samples.
    measured = result.report.sampling.errors[0].measured_within_percent
    assert abs(measured / 100 - (errors <= limit).mean()) < 0.05


def test_heights_have_bounds_as_a_length_and_as_a_share_of_the_diagonal():
    def steps(x, y):
        return 0.1 * (np.abs(x - 0.313) < 0.2) * (np.abs(y - 0.2) < 0.3)

    high, low = plane(200, 200, steps), plane()
    share = 0.002 / low.diagonal
    results = [
        bake(high, low, options(maps=("displacement",), max_error=bound))
        for bound in ("0.002", f"{100 * share!r}%")
    ]
    values = [result.maps["displacement"].values for result in results]
    np.testing.assert_array_equal(*values)
    truth, has_data = means_by_brute_force(high, low, options(), ("displacement",))["displacement"]
    errors = np.abs(values[0] - truth)[has_data]
    assert (errors <= 0.002).mean() > 0.99
    assert results[0].report.sampling.errors[0].unit == "model units"
    assert results[0].report.sampling.sample_percents[1] > 80  # the flat part gets no more


def test_each_of_several_maps_has_its_own_estimate():
    """A bound that nothing exceeds divides nothing, so the other map is as if baked alone."""
    high, low = plane(90, 90, bumps), plane()

    def estimates(maps, bound):
        settings = options(maps=maps, max_error=bound, high_shading="flat")
        report = bake(high, low, settings).report.sampling
        return report.rays_per_texel, {item.name: item.estimated for item in report.errors}

    rays, alone = estimates(("normal",), "1deg")
    assert rays > 2.5  # more than a few texels are divided
    both = ("normal", "displacement")
    for length in ("1000", "500"):
        results = estimates(both, f"1deg,{length}")
        assert results[0] == rays
        # Sums over cells in another order, of float32.
        assert results[1]["normal"] == pytest.approx(alone["normal"], rel=1e-5)
        # Lengths, not shares of a bound; with more samples they are below those of one.
        if length == "1000":
            wide = results[1]["displacement"]
        assert results[1]["displacement"] == pytest.approx(wide, rel=1e-5)
    _, once = estimates(("displacement",), "1000")
    for percent in (50, 99, 100):
        assert 0 < wide[percent] <= once["displacement"][percent]
    assert wide[99] < 0.8 * once["displacement"][99]


def test_slivers_and_uncovered_centers_get_their_texels():
    """A chart 0.3 texels wide beside the centers, and one that only a center lies in."""

    def chart(x, y, width, height):
        u = np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])
        return u / SIZE

    uvs = np.concatenate([chart(10.1, 5, 0.3, 20), chart(30.49, 30.49, 0.02, 0.02)])
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    positions = np.concatenate([corners, corners + np.array([2, 0, 0])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    mesh = Mesh(positions=positions, faces=faces, uvs=uvs, uv_faces=faces)
    result = bake(mesh, mesh, options(front=0.1, back=0.1))
    assert result.has_data.sum() == 21
    assert result.has_data[SIZE - 1 - 30, 30]
    assert result.report.texels_missed == 0
    np.testing.assert_allclose(result.maps["normal"].values[result.has_data], [[0, 0, 1]] * 21)


def test_a_chart_in_another_part_of_the_texture_has_the_same_texels():
    """Two charts of the same faces, half a texture apart, in a texture of several pieces."""
    low = flat()
    place = low.uvs * [0.031, 0.37] + [0.011, 0.071]
    twice = low.replace(
        faces=np.tile(low.faces, (2, 1)),
        uvs=np.concatenate([place, place + np.array([0.0, 0.5])]),
        uv_faces=np.concatenate([low.uv_faces, low.uv_faces + len(place)]),
    )
    result = bake(ridge(), twice, options(size=(2048, 128)))
    upper, lower = np.split(result.maps["normal"].values, 2)
    assert result.has_data.sum() > 2 * 63 * 47
    np.testing.assert_array_equal(upper, lower)


def test_a_chart_beside_changes_no_texel():
    low, others = flat(), plane(6, 6)
    place = low.uvs * [0.43, 0.87] + [0.03, 0.04]
    low = low.replace(uvs=place)
    others = moved(others, by=(3.0, 0.0, 0.0))
    others = others.replace(uvs=others.uvs * [0.43, 0.87] + [0.5, 0.05])
    lows = low, join_meshes([low, others])
    alone, beside = (bake(ridge(at=0.123), each, options()) for each in lows)
    data = alone.has_data
    found, expected = (result.maps["normal"].values[data] for result in (beside, alone))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("changes", "words"), [
    ({"max_error": "0.5"}, "bounds nothing of normal"),
    ({"max_error": "1deg", "maps": ("displacement",)}, "bounds nothing of displacement"),
    ({"samples": 4}, "leave nothing to choose"),
    ({"samples": "many"}, "not one of"),
    ({"keep_hits": True}, "keep_hits"),
    ({"time_budget": 0}, "is not a duration"),
])  # fmt: skip
def test_wrong_options_are_one_clear_error(changes, words):
    with pytest.raises(OptionError, match=words):
        bake(plane(), plane(), options(**changes))


def test_adaptive_alone_has_a_bound_for_every_map():
    settings = {"size": 16, "samples": "adaptive", "front": 0.1, "back": 0.1}
    for name in ("normal", "displacement", "vector-displacement"):
        report = bake(plane(), plane(), BakeOptions(**settings, maps=(name,))).report
        assert report.sampling.max_error == "0.5deg,0.01%"
        assert report.to_json()["sampling"]["errors"][0]["name"] == name


def test_a_bound_that_64_samples_do_not_meet_is_reported():
    """Errors of texels that a leap crosses stay above the bound, and a warning reports them."""
    high, low = plane(90, 90, bumps), plane()
    report = bake(high, low, options(max_error="0.2deg", high_shading="flat")).report
    assert report.sampling.within_percent < 80
    assert any("estimated to be off by more" in warning for warning in report.warnings)
