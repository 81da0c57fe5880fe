"""Bakes whose results are known in advance."""

import json
from dataclasses import replace

import numpy as np
import pytest

from texbake import BakeOptions, Mesh, OptionError, bake, remap, unwrap
from texbake.baking.rays import checked_cage
from texbake.errors import CageError, MissError
from texbake.mesh.compose import turned_over
from texbake.mesh.normals import flat_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.texture.encoding import encode_normals

HARD_NORMALS = dict(zip(("normals", "normal_faces"), flat_normals(cube()), strict=True))
HARD_EDGES = unwrap(cube().replace(**HARD_NORMALS), size=96)
SHAPES = {"sphere": uv_sphere(12, 24), "box": HARD_EDGES, "plane": plane(3, 2)}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("samples", [1, 16])
@pytest.mark.parametrize("convention", ["opengl", "directx"])
def test_high_equal_to_low_is_flat_everywhere(shape, samples, convention):
    mesh = SHAPES[shape]
    options = BakeOptions(
        size=96, samples=samples, padding=0, maps=("normal", "displacement"),
        front=0.05 * mesh.diagonal, back=0.05 * mesh.diagonal,
    )  # fmt: skip
    result = bake(mesh, mesh, options)
    assert result.report.texels_missed == 0
    normals = result.maps["normal"].values
    codes = encode_normals(normals, bits=8, convention=convention)
    assert (codes == [128, 128, 255]).all()
    # float32 interpolation of unit vectors, and of offsets as long as the rounding of positions
    np.testing.assert_allclose(normals, np.broadcast_to([0, 0, 1], normals.shape), atol=3e-6)
    np.testing.assert_allclose(result.maps["displacement"].values, 0, atol=1e-12 * mesh.diagonal)


def half_a_plane():
    """A high-poly plane without its right half."""
    whole = plane(8, 8)
    middle = whole.positions[whole.faces].mean(axis=1)[:, 0]
    keep = middle < whole.positions[:, 0].mean()
    return Mesh(positions=whole.positions, faces=whole.faces[keep], name="half.obj")


@pytest.mark.parametrize("fill", ["none", "push-pull"])
@pytest.mark.parametrize("size", [64, 300])
def test_misses_are_reported_and_only_colors_go_on_into_them(fill, size):
    """Also where the rays are far longer than the triangles."""
    high, reach = half_a_plane(), size / 300
    blue = np.broadcast_to(np.float32([0.1, 0.2, 0.9]), (high.n_vertices, 3))
    options = BakeOptions(
        maps=("normal", "vertex-color", "displacement"), size=size, front=reach, back=reach,
        fill=fill, space="object",
    )  # fmt: skip
    result = bake(high.replace(colors=blue), plane(), options)
    report, half = result.report, size // 2
    assert report.texels_covered == report.counts.rays_cast == size**2
    assert report.texels_missed == report.counts.rays_missed == size * half
    assert report.miss_percent == 50.0 == json.loads(json.dumps(report.to_json()))["miss_percent"]
    assert any("missed the high-poly mesh" in warning for warning in report.warnings)
    normals, colors, heights = (result.maps[name].values for name in options.maps)
    np.testing.assert_array_equal(normals[:, half:], 0)
    np.testing.assert_array_equal(normals[:, :half], np.broadcast_to([0, 0, 1], (size, half, 3)))
    np.testing.assert_allclose(colors, np.broadcast_to(blue[0], colors.shape), atol=1e-6)
    np.testing.assert_allclose(heights, 0, atol=1e-6)
    picture = result.miss_map()
    assert (picture[:, half:] == [255, 40, 60]).all() and (picture[:, :half] == [70, 110, 70]).all()
    nowhere = high.replace(positions=high.positions + np.array([0.0, 0.0, 9.0]), colors=blue)
    assert not bake(nowhere, plane(), options).maps["vertex-color"].values.any()


def test_fail_on_miss():
    options = BakeOptions(size=16, front=0.1, back=0.1, fail_on_miss=49.9)
    with pytest.raises(MissError, match=r"50\.000 %"):
        bake(half_a_plane(), plane(), options)
    assert bake(
        half_a_plane(), plane(), BakeOptions(size=16, front=0.1, back=0.1, fail_on_miss=50)
    ).report.texels_missed


@pytest.mark.parametrize("samples", [1, 4, "adaptive"])
def test_misses_take_the_closest_point(samples):
    options = BakeOptions(
        maps=("normal", "vector-displacement"), space="object", size=64, samples=samples,
        front=0.1, back=0.1, on_miss="closest",
    )  # fmt: skip
    low = plane()
    result = bake(half_a_plane(), low, options)
    assert result.report.texels_missed == 0
    assert result.report.counts.rays_to_closest == result.report.counts.rays_missed > 0
    assert ("closest points", f"{result.report.counts.rays_missed:,} for rays that missed") in (
        result.report.table()
    )
    normals = result.maps["normal"].values
    np.testing.assert_array_equal(normals, np.broadcast_to([0, 0, 1], normals.shape))
    # Right of the edge in the middle, the closest point is straight to the left on it.
    width = np.ptp(low.positions[:, 0])
    beyond = width * (np.arange(64) + 0.5 - 32.0) / 64.0
    expected = np.broadcast_to(-np.maximum(beyond, 0.0), (64, 64))
    shifts = result.maps["vector-displacement"].values
    np.testing.assert_allclose(shifts[..., 0], expected, atol=1e-6 * width)
    np.testing.assert_array_equal(shifts[..., 1:], 0.0)


def test_the_closest_point_faces_the_ray():
    low = plane()
    near = low.replace(positions=low.positions + np.array([0, 0, 0.2]), faces=low.faces[:, ::-1])
    far = low.positions - [0.0, 0.0, 0.5]
    high = Mesh(
        positions=np.concatenate([near.positions, far]),
        faces=np.concatenate([near.faces, low.faces + len(far)]),
    )
    options = BakeOptions(maps=("displacement",), size=8, front=0.1, back=0.1, on_miss="closest")
    options = replace(options, orientation="keep")
    for cull, height in ((True, -0.5), (False, 0.2)):
        heights = bake(high, low, replace(options, cull_back_faces=cull)).maps["displacement"]
        np.testing.assert_allclose(heights.values, height, atol=1e-6)


def test_a_miss_stays_where_no_face_faces_the_ray():
    high = plane().replace(faces=plane().faces[:, ::-1])
    options = BakeOptions(size=8, front=0.1, back=0.1, on_miss="closest", keep_hits=True)
    report = bake(high, plane(), options).report
    assert report.counts.rays_missed == report.texels_missed == 64
    assert report.counts.rays_to_closest == 0


def test_what_does_not_go_with_the_closest_point():
    sphere = uv_sphere(64, 128)
    with pytest.raises(OptionError, match="maps, on_miss: opacity counts misses"):
        bake(sphere, plane(), BakeOptions(maps=("opacity",), on_miss="closest"))
    with pytest.raises(OptionError, match="max_memory, on_miss"):
        bake(sphere, plane(), BakeOptions(size=16, on_miss="closest", max_memory="1M"))


def test_a_cage_and_a_front_distance_contradict_each_other():
    low = uv_sphere(8, 16)
    with pytest.raises(OptionError, match="front, cage"):
        bake(icosphere(3), low, BakeOptions(front=0.1), cage=low)


def test_tangents_of_the_file_are_used():
    """Turned by a quarter, they turn the map's x and y by a quarter."""
    high = plane(40, 40, lambda x, y: 0.02 * np.sin(6 * x + 3 * y))
    low = plane()
    tangents = corner_tangents(low)
    turned = tangents.copy()
    turned[..., :3] = [0, 1, 0]  # along v, where MikkTSpace has them along u
    options = BakeOptions(size=32, front=0.1, back=0.1)
    own = bake(high, low.replace(tangents=turned), options).maps["normal"].values
    usual = bake(high, low, options).maps["normal"].values
    np.testing.assert_allclose(own[..., 0], usual[..., 1], atol=1e-6)
    np.testing.assert_allclose(own[..., 1], -usual[..., 0], atol=1e-6)
    assert np.abs(usual[..., 0] - usual[..., 1]).max() > 0.05


def test_a_cage_takes_the_place_of_the_front_distance():
    low = uv_sphere(8, 16)
    high = low.replace(positions=low.positions * 1.3)
    cage = low.replace(positions=low.positions * 1.5, name="cage.obj")
    inside = low.replace(positions=low.positions * 1.1, name="cage.obj")
    options = BakeOptions(size=64, back=0.05, maps=("displacement",))
    assert bake(high, low, options, cage=cage).report.texels_missed == 0
    report = bake(high, low, options, cage=inside).report
    assert report.texels_missed == report.texels_covered
    assert (report.cage, report.front, report.measured) == ("cage.obj", None, False)
    measured = bake(high, low, BakeOptions(size=16), cage=cage).report
    assert measured.measured and measured.front is None and measured.back > 0.0
    result = bake(high, low, options, cage=cage)
    # Along the radius of a vertex the surfaces are 0.3 apart; within a face the chord is nearer.
    values = result.maps["displacement"].values[result.has_data]
    assert 0.27 < values.min() <= values.max() < 0.3001


@pytest.mark.parametrize(
    "other", [uv_sphere(8, 15), icosphere(2), turned_over(uv_sphere(8, 16), np.ones(224, bool))]
)
def test_a_cage_with_other_faces_is_an_error(other):
    low = uv_sphere(8, 16)
    with pytest.raises(CageError, match=r"must have the faces of the low-poly mesh"):
        bake(icosphere(3), low, cage=other)


def test_a_cage_may_have_other_diagonals_than_the_mesh():
    """Those of quads that are no longer rectangles once their corners have moved."""
    low = plane().replace(polygon_of=[0, 0])
    outer = low.positions + [[0, 0, 0.1 + 0.1 * i] for i in range(4)]
    cage = Mesh(positions=outer, faces=[[0, 1, 2], [1, 3, 2]], polygon_of=[0, 0])
    assert not set(map(tuple, cage.faces)) & set(map(tuple, low.faces))
    found = checked_cage(cage, low)
    assert np.array_equal(found.faces, low.faces) and np.array_equal(found.positions, outer)


def _permuted(low, seed):
    order = np.random.default_rng(seed).permutation(low.n_vertices)
    return low.replace(positions=1.1 * low.positions[order])


@pytest.mark.parametrize("change, message", [
    (lambda low: low.replace(positions=0.9 * low.positions), "100 % of it lies behind"),
    (lambda low: _permuted(low, 0), "in another order"),
    (lambda low: low.replace(positions=1.1 * np.roll(low.positions, 5, axis=0)), "order"),
    (lambda low: low.replace(positions=-1.1 * low.positions), "100 % of it lies behind"),
    (lambda low: low, None),
    (lambda low: low.replace(positions=1.5 * low.positions), None),
])  # fmt: skip
@pytest.mark.parametrize("size", [1.0, 1e150])
def test_a_cage_must_enclose_the_mesh_with_its_vertices_in_order(change, message, size):
    low = uv_sphere(8, 16)
    cage = change(low).replace(name="cage")
    low, cage = (mesh.replace(positions=size * mesh.positions) for mesh in (low, cage))
    if message is None:
        checked_cage(cage, low)
    else:
        with pytest.raises(CageError, match=message):
            checked_cage(cage, low)


def test_measured_distances_suffice_and_are_not_much_longer():
    low = uv_sphere(24, 48)

    def bumps(theta, phi):
        return 1.0 + 0.05 * np.sin(5 * theta) * np.sin(6 * phi)

    high = uv_sphere(200, 400, bumps)
    report = bake(high, low, BakeOptions(size=128)).report
    assert report.measured
    assert report.texels_missed == 0
    # Bumps reach 0.05 either way, and the chords of the low-poly sphere lie up to 0.9 % inside.
    assert 0.05 < report.front < 0.075 and 0.05 < report.back < 0.075


def test_remap_keeps_the_options_of_the_rays():
    high, low = icosphere(4), uv_sphere(10, 20)
    both = {"size": (64, 40), "front": 0.1, "back": 0.1, "samples": 4}
    kept = bake(high, low, BakeOptions(**both, keep_hits=True))
    changes = {"maps": ("displacement", "normal"), "space": "object", "padding": 3}
    other = BakeOptions(**changes, size=16, samples=16, rays="face", on_miss="closest")
    again, direct = remap(kept, high, low, other), bake(high, low, BakeOptions(**both, **changes))
    assert again.report.options == replace(direct.report.options, keep_hits=True)
    assert list(again.maps) == ["displacement", "normal"]
    for name in again.maps:
        np.testing.assert_array_equal(again.maps[name].values, direct.maps[name].values)
    with pytest.raises(OptionError, match="keep_hits"):
        remap(direct, high, low, other)
    with pytest.raises(OptionError, match="not the meshes that were baked"):
        remap(kept, icosphere(2), low, other)


def test_meeting_padding_and_overlaps_give_warnings():
    uvs = np.array([[0, 0], [0.5, 0], [0.5, 1], [0, 1]])
    apart = np.vstack([uvs * [0.96, 1], uvs * [0.96, 1] + [0.52, 0]])
    mesh = Mesh(
        positions=np.column_stack([apart, np.zeros(8)]),
        faces=[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        uvs=apart,
        uv_faces=[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    )
    result = bake(mesh, mesh, BakeOptions(size=50, padding=2, front=0.1, back=0.1))
    # A gutter of two texels, 50 high, and each is nearer than 2 to both charts.
    assert result.report.padding_meets == 100
    assert any("padding of two charts" in warning for warning in result.report.warnings)
    over = mesh.replace(uvs=np.vstack([uvs, uvs + np.array([0.02, 0.0])]))
    overlapping = bake(mesh, over, BakeOptions(size=50, front=0.1, back=0.1)).report
    assert overlapping.texels_overlapping == 24 * 50
    assert any("overlap" in warning for warning in overlapping.warnings)


@pytest.mark.parametrize("maps", [(), ["normal"]])
def test_maps_are_a_tuple_of_one_or_more(maps):
    with pytest.raises(OptionError, match=r"^maps: "):
        BakeOptions(maps=maps)


def test_faces_without_a_texel_are_reported():
    """A sliver between two rows of centers, and a face beneath another."""
    low = plane()
    uvs = np.vstack([low.uvs, [[0.0, 0.5], [1.0, 0.5], [1.0, 0.501]]])
    positions = np.vstack([low.positions, [[0, 0, 1], [1, 0, 1], [1, 1, 1]]])
    faces = np.vstack([low.faces, [[4, 5, 6]], low.faces[:1]])
    uv_faces = np.vstack([low.uv_faces, [[4, 5, 6]], low.uv_faces[:1]])
    mesh = Mesh(positions=positions, faces=faces, uvs=uvs, uv_faces=uv_faces)
    report = bake(low, mesh, BakeOptions(size=16, front=0.1, back=0.1)).report
    assert report.faces_without_texel == 2
    assert any("2 of 4 triangles own no texel" in warning for warning in report.warnings)


@pytest.mark.parametrize("tile", [0, 1])
@pytest.mark.parametrize("baked", [(), ("0",), ("15",)])
def test_mirrored_halves_that_share_texels_are_both_right(tile, baked):
    """The normals of one map, decoded with the tangents of either half, against the formula."""
    sheets = [plane(n, n // 2) for n in (4, 256)]
    low, high = (mesh.replace(positions=mesh.positions * [2, 1, 1] - [1, 0, 0]) for mesh in sheets)
    x, y, _ = high.positions.T
    heights = 0.05 * np.sin(7.0 * np.abs(x)) * np.cos(5.0 * y)
    high = high.replace(positions=np.stack([x, y, heights], axis=1), uvs=None, uv_faces=None)
    corners = low.positions[low.faces]
    is_left = corners[..., 0].mean(axis=1) < 0.0
    uvs = np.abs(corners[..., :2]) * 0.9 + 0.05 + [tile, 0] * is_left[:, None, None]
    low = low.replace(uvs=uvs.reshape(-1, 2), uv_faces=np.arange(48).reshape(-1, 3))

    options = BakeOptions(size=64, keep_hits=True, bake_island=baked)
    result = bake(high, low, options)
    report, hits = result.report, result.hits
    assert report.counts.islands_sharing == len(report.warnings) == 1
    assert report.texels_overlapping == report.faces_without_texel == 0
    sides = is_left[hits.low_faces]
    assert sides.all() or not sides.any()
    if baked:
        assert sides[0] == is_left[int(baked[0])]

    values = result.maps["normal"].values.reshape(-1, 3)[hits.texel_ids].astype(float)
    weights = np.column_stack([1.0 - hits.low_barycentrics.sum(axis=1), hits.low_barycentrics])
    x, y, _ = np.abs((weights[..., None] * corners[hits.low_faces]).sum(axis=1)).T
    for side, half in (1.0, ~is_left), (-1.0, is_left):
        tangents = corner_tangents(low)[half].reshape(-1, 4).astype(float)
        assert np.allclose(tangents, tangents[0], atol=1e-6)  # each half is flat
        bitangent = tangents[0, 3] * np.cross([0.0, 0.0, 1.0], tangents[0, :3])
        found = values @ np.stack([tangents[0, :3], bitangent, [0.0, 0.0, 1.0]])
        along = -0.35 * side * np.cos(7.0 * x) * np.cos(5.0 * y)
        wanted = np.stack([along, 0.25 * np.sin(7.0 * x) * np.sin(5.0 * y), np.ones_like(x)], 1)
        wanted /= np.linalg.norm(wanted, axis=1)[:, None]
        # Smooth normals of cells of 1/128 differ from the formula by less than 1/100.
        assert np.abs(found - wanted)[x > 0.02].max() < 0.01
