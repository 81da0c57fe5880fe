"""Charts packed into one texture or several tiles: apart, undistorted, and dense."""

import tracemalloc
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st
from scipy.ndimage import distance_transform_edt

from texbake.errors import UnwrapError
from texbake.mapping.atlas.packing.bitmaps import Outlines, PackingGrid
from texbake.mapping.atlas.packing.pack import pack_charts, upright_tiles
from texbake.mapping.atlas.packing.refine import refine_layout
from texbake.mapping.atlas.packing.search import coarse_layout, squeeze_layout
from texbake.mapping.corner_uvs import signed_areas

Array = npt.NDArray[np.float64]


def triangles(seed, n_charts):
    """Charts of one triangle each, of sizes from 1 to 10 and any shape."""
    random = np.random.default_rng(seed)
    corners = random.random((n_charts, 3, 2)) * random.uniform(1.0, 10.0, (n_charts, 1, 1))
    corners[signed_areas(corners) < 0.0] = corners[signed_areas(corners) < 0.0, ::-1]
    faces = np.arange(3 * n_charts, dtype=np.int32).reshape(-1, 3)
    return corners.reshape(-1, 2), faces, np.repeat(np.arange(n_charts, dtype=np.int32), 3)


def touched_texels(corners, size):
    """(H, W): texels with a point of the triangles in them, out of points a tenth texel apart."""
    mask = np.zeros(size[::-1], dtype=bool)
    for corner in corners * size:
        n = int(np.ptp(corner, axis=0).max() * 10.0) + 2
        i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
        i, j = i[i + j <= n], j[i + j <= n]
        points = (
            corner[0]
            + (np.outer(i, corner[1] - corner[0]) + np.outer(j, corner[2] - corner[0])) / n
        )
        columns, rows = np.floor(points).astype(int).T
        mask[rows, columns] = True
    return mask


def assert_kept_apart(packing, faces, chart_ids, size, padding):
    face_charts = chart_ids[faces[:, 0]]
    masks = [
        touched_texels(packing.uvs[faces[face_charts == chart]], size)
        for chart in range(chart_ids.max() + 1)
    ]
    everything = np.sum(masks, axis=0)
    assert everything.max() == 1  # no texel is shared
    for mask in masks:
        distances = distance_transform_edt(~mask)
        assert (distances[(everything > 0) & ~mask] > 2 * padding).all()
        rows, columns = np.nonzero(mask)
        assert min(rows.min(), columns.min()) >= padding and rows.max() < size[1] - padding
        assert columns.max() < size[0] - padding


@settings(max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(1, 12),
    st.sampled_from([(96, 96), (128, 64), (50, 111)]), st.integers(0, 5),
    st.sampled_from(["fast", "good", "best"]),
)  # fmt: skip
def test_charts_are_kept_apart_and_keep_their_shape(seed, n_charts, size, padding, effort):
    uvs, faces, chart_ids = triangles(seed, n_charts)
    packing = pack_charts(uvs, faces, chart_ids, size=size, padding=padding, effort=effort)
    assert_kept_apart(packing, faces, chart_ids, size, padding)
    # Rotated and scaled by one factor: the edges in texels are those that came in.
    before, after = (
        corners - np.roll(corners, 1, axis=1) for corners in (uvs[faces], packing.uvs[faces] * size)
    )
    lengths = np.linalg.norm(after, axis=2)
    assert lengths == pytest.approx(np.linalg.norm(before, axis=2) * packing.texels_per_unit)
    areas = signed_areas(packing.uvs[faces] * size)
    assert areas == pytest.approx(signed_areas(uvs[faces]) * packing.texels_per_unit**2)
    assert packing.fill == pytest.approx(areas.sum() / (size[0] * size[1]))


def test_cells_of_several_texels_keep_charts_apart_as_well():
    size = (1200, 150)  # cells of 2 texels
    uvs, faces, chart_ids = triangles(1, 8)
    packing = pack_charts(uvs, faces, chart_ids, size=size, padding=3)
    assert_kept_apart(packing, faces, chart_ids, size, 3)


def test_small_charts_go_into_the_hole_of_a_large_one():
    def ring(inner):
        outer = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        return np.concatenate([outer, 0.5 + (outer - 0.5) * inner])

    sides = np.arange(4)
    after = (sides + 1) % 4
    ring_faces = np.concatenate(
        [np.stack([sides, after, 4 + after], 1), np.stack([sides, 4 + after, 4 + sides], 1)]
    )
    square = np.array([[0.0, 0.0], [0.6, 0.0], [0.6, 0.6], [0.0, 0.6]])
    uvs = np.concatenate([ring(0.8), square])
    faces = np.concatenate([ring_faces, [[8, 9, 10], [8, 10, 11]]]).astype(np.int32)
    chart_ids = np.repeat([0, 1], [8, 4]).astype(np.int32)
    packing = pack_charts(uvs, faces, chart_ids, size=(128, 128), padding=1)
    # Side by side, the two would leave the ring at most 1/1.6 of the width.
    assert packing.texels_per_unit > 120.0
    assert_kept_apart(packing, faces, chart_ids, (128, 128), 1)


def test_thousands_of_charts_go_a_faster_way_and_are_kept_apart():
    uvs, faces, chart_ids = triangles(2, 1100)
    packing = pack_charts(uvs, faces, chart_ids, size=(512, 512), padding=1)
    corners = packing.uvs[faces]
    shared = np.sum([touched_texels(corners[i : i + 1], (512, 512)) for i in range(1100)], axis=0)
    assert shared.max() == 1
    assert packing.fill > 0.25  # of 1,100 triangles of some 10 texels, with gaps of 2


def test_the_result_is_the_same_every_time():
    charts = triangles(3, 20)
    packings = [
        pack_charts(*charts, size=(128, 128), padding=2, effort="best", threads=threads)
        for threads in (1, 3)
    ]
    assert len({packing.uvs.tobytes() for packing in packings}) == 1


def test_more_effort_fills_more():
    charts = triangles(6, 40)
    fills = [
        pack_charts(*charts, size=(384, 384), padding=1, effort=effort).fill
        for effort in ("fast", "good", "best")
    ]
    # Measured: .655, .693, .752.
    assert (np.diff(fills) > 0.01).all()


def test_a_layout_that_is_too_large_shrinks_until_it_fits_however_little_work_is_left():
    uvs, faces, chart_ids = triangles(4, 12)
    charts = Outlines(uvs=uvs, faces=faces, chart_ids=chart_ids, n_charts=12, aligned=None)
    draft = coarse_layout(charts, (256, 256), 2, most_work=2_000_000, seed=0)
    rough = squeeze_layout(draft, most_work=1, seed=0)
    grid = PackingGrid.over((256, 256), 2, most_cells=1024)
    too_large = replace(rough, scale=1.1 * rough.scale)
    found = refine_layout(charts, too_large, grid, most_work=1, seed=0)
    assert found is not None
    assert 0.9 * rough.scale < found.scale * grid.cell < 1.1 * rough.scale


def rectangles(widths, heights):
    """One chart each: two triangles."""
    n_charts = len(widths)
    unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    uvs = unit * np.stack([widths, heights], axis=1)[:, None]
    first = 4 * np.arange(n_charts, dtype=np.int32)[:, None, None]
    faces = (np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32) + first).reshape(-1, 3)
    return uvs.reshape(-1, 2), faces, np.repeat(np.arange(n_charts, dtype=np.int32), 4)


def outlines(shapes, turns):
    """A chart of triangles around the first corner of each convex outline, turned by an angle."""
    corners = [
        np.array(shape) @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        for shape, turn in zip(shapes, turns, strict=True)
    ]
    sizes = np.array([len(shape) for shape in shapes])
    faces = np.concatenate(
        [
            np.stack([np.zeros(n - 2), np.arange(1, n - 1), np.arange(2, n)], axis=1) + first
            for n, first in zip(sizes, np.cumsum(sizes) - sizes, strict=True)
        ]
    )
    return np.concatenate(corners), faces.astype(np.int32), np.repeat(np.arange(len(sizes)), sizes)


@pytest.mark.parametrize("effort", ["fast", "good", "best"])
def test_straight_borders_lie_along_u_and_v(effort):
    arc = np.radians(np.arange(181.0))
    half_disk = np.stack([np.cos(arc), np.sin(arc)], axis=1)
    rounded = np.concatenate([[[-1.0, -2.0], [1.0, -2.0]], half_disk])
    bevelled = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [2.0, 1.02], [1.9, 2.0], [0.0, 2.0]]
    shapes = [rounded, bevelled, [[0.0, 0.0], [3.0, 0.0], [3.0, 0.5], [0.0, 0.5]]] * 4
    turns = np.radians(np.random.default_rng(8).uniform(0.0, 360.0, len(shapes)))
    uvs, faces, ids = outlines(shapes, turns)
    packing = pack_charts(
        uvs, faces, ids.astype(np.int32), size=(256, 256), padding=1, effort=effort
    )
    sides = [[0, 1], [0, 1], [0, 1]] * 4
    for chart, (tail, head) in enumerate(sides):  # the longest straight side of each
        own = packing.uvs[ids == chart]
        assert np.abs(own[head] - own[tail]).min() < 1e-14


@pytest.mark.parametrize("effort", ["fast", "good"])
def test_squares_that_fill_a_square_leave_only_their_gaps(effort):
    # 16 equal ones, and a large one with 12 small ones around two sides of it and 1 corner each.
    for sides in ([1.0] * 16, [3.0] + [1.0] * 7):
        packing = pack_charts(
            *rectangles(np.array(sides), np.array(sides)), size=(256, 256), padding=1, effort=effort
        )
        # In a row of 4 cells of the pattern lie 3 gaps of at least 2 whole texels, and 1 texel at
        # either border; a texel per square is lost where its sides do not fall on texels.
        side = (256 - 2 - 3 * 2) / 4
        assert side * 0.992 - 1.0 <= packing.texels_per_unit <= side


def test_a_chart_without_area_takes_a_place_all_the_same():
    uvs = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.3]])
    faces = np.array([[0, 1, 2], [3, 3, 3]], dtype=np.int32)
    packing = pack_charts(uvs, faces, np.array([0, 0, 0, 1], np.int32), size=(32, 32), padding=1)
    assert ((packing.uvs > 0.0) & (packing.uvs < 1.0)).all()
    assert packing.n_tiles == 1
    point = pack_charts(uvs[3:], faces[1:] - 3, np.zeros(1, np.int32), size=(32, 32), padding=1)
    assert ((point.uvs > 0.0) & (point.uvs < 1.0)).all()


SIZE = (128, 96)


def mixed(seed, n_charts):
    random = np.random.default_rng(seed)
    return rectangles(*random.uniform(1.0, 5.0, (2, n_charts)))


def assert_in_their_tiles(packing, chart_ids, padding):
    corner = np.stack([packing.tiles % 10, packing.tiles // 10], axis=1)[chart_ids]
    texels = (packing.uvs - corner) * SIZE
    assert (texels >= padding).all() and (texels <= np.array(SIZE) - padding).all()


def areas_in_texels(packing, faces):
    return signed_areas(packing.uvs[faces] * SIZE)


@pytest.mark.parametrize("effort", ["fast", "good"])
def test_more_tiles_hold_larger_charts(effort):
    uvs, faces, chart_ids = mixed(1, 60)
    one, three, twelve = (
        pack_charts(uvs, faces, chart_ids, size=SIZE, padding=1, tiles=tiles, effort=effort)
        for tiles in (1, 3, 12)
    )
    assert one.texels_per_unit < three.texels_per_unit < twelve.texels_per_unit
    assert (one.n_tiles, three.n_tiles, twelve.n_tiles) == (1, 3, 12)
    for packing in (one, three, twelve):
        assert_in_their_tiles(packing, chart_ids, 1)
        assert packing.tiles.dtype == np.int32
        areas = areas_in_texels(packing, faces)
        expected = signed_areas(uvs[faces]) * packing.texels_per_unit**2
        assert areas == pytest.approx(expected, rel=1e-9)
        room = packing.n_tiles * SIZE[0] * SIZE[1]
        assert packing.fill == pytest.approx(areas.sum() / room, rel=1e-9)
    assert len(np.unique(twelve.tiles)) == 12
    assert twelve.uvs[:, 1].max() > 1.0  # tiles 1011 and 1012 lie above 1001 and 1002


def test_charts_of_a_tile_do_not_overlap():
    uvs, faces, chart_ids = mixed(2, 40)
    packing = pack_charts(uvs, faces, chart_ids, size=SIZE, padding=2, tiles=3)
    side_by_side = replace(packing, uvs=packing.uvs / (3.0, 1.0))
    assert_kept_apart(side_by_side, faces, chart_ids, (3 * SIZE[0], SIZE[1]), 2)


@pytest.mark.parametrize("density", [None, 3.0])
def test_groups_have_tiles_of_their_own_and_one_density(density):
    uvs, faces, chart_ids = mixed(3, 60)
    groups = np.array([0, 2, 2], dtype=np.int32)[np.arange(60) % 3]  # no chart in group 1
    packing = pack_charts(
        uvs, faces, chart_ids, size=SIZE, padding=1, tiles=4, tile_groups=groups, density=density
    )
    assert (packing.tiles // 4 == groups).all()
    assert_in_their_tiles(packing, chart_ids, 1)
    expected = signed_areas(uvs[faces]) * packing.texels_per_unit**2
    assert areas_in_texels(packing, faces) == pytest.approx(expected, rel=1e-9)
    assert packing.n_tiles == len(np.unique(packing.tiles))
    if density is None:
        assert packing.n_tiles == 4 + len(np.unique(packing.tiles[groups == 0]))


def test_a_density_is_kept_and_takes_no_more_tiles_than_it_needs():
    uvs, faces, chart_ids = mixed(4, 40)
    area = float(signed_areas(uvs[faces]).sum())
    for share in (0.3, 0.6, 1.2, 3.0):  # of the area of a tile
        density = float(np.sqrt(share * SIZE[0] * SIZE[1] / area))
        packing = pack_charts(uvs, faces, chart_ids, size=SIZE, padding=1, tiles=8, density=density)
        assert packing.texels_per_unit == pytest.approx(density, rel=1e-12)
        assert packing.n_tiles <= np.ceil(share / 0.6)
        expected = signed_areas(uvs[faces]) * density**2
        assert areas_in_texels(packing, faces) == pytest.approx(expected, rel=1e-9)
        assert (np.unique(packing.tiles) == np.arange(packing.n_tiles)).all()


def test_a_density_that_needs_more_tiles_reports_how_many():
    charts = rectangles(np.full(10, 6.0), np.full(10, 6.0))
    # At 10 texels per unit two of 60 x 60 fit side by side into 128 x 96, but not on top.
    needed = r"cup: at 10 texels per unit the charts need 5 tiles of "
    with pytest.raises(UnwrapError, match=needed):
        pack_charts(*charts, size=SIZE, padding=1, density=10.0, tiles=4, name="cup")
    packing = pack_charts(*charts, size=SIZE, padding=1, density=10.0, tiles=5)
    assert packing.n_tiles == 5


def test_a_chart_larger_than_a_tile_names_the_size_that_it_needs():
    charts = rectangles(np.array([6.0, 20.0]), np.array([6.0, 15.0]))
    with pytest.raises(UnwrapError, match=r"cup: at 10 texels .* 200 texels long.* size of 206 or"):
        pack_charts(*charts, size=SIZE, padding=2, density=10.0, tiles=4, name="cup")
    packing = pack_charts(*charts, size=(206, 206), padding=2, density=10.0, tiles=4)
    assert packing.n_tiles == 2


def test_too_many_charts_for_all_tiles():
    with pytest.raises(UnwrapError, match="90 charts do not fit into 2 tiles of 128 x 96 texels"):
        pack_charts(*mixed(5, 90), size=SIZE, padding=8, tiles=2)
    with pytest.raises(UnwrapError, match="do not fit into 128 x 96 texels with a padding of 60"):
        pack_charts(*mixed(5, 2), size=SIZE, padding=60)


def test_tens_of_thousands_of_charts_go_the_fastest_way():
    random = np.random.default_rng(7)
    charts = rectangles(*np.exp(random.normal(0.0, 0.5, (2, 9000))))
    packing = pack_charts(*charts, size=(2048, 2048), padding=1)
    # Rectangles of some 16 texels with gaps of 2 to 4 can fill no more than about .7.
    assert packing.fill > 0.5


@pytest.mark.parametrize(("n_groups", "tiles"), [(9000, 1), (90, 100)])
def test_more_tiles_than_udim_numbers_are_refused(n_groups, tiles):
    uvs, faces, chart_ids = mixed(4, n_groups)
    groups = np.arange(n_groups, dtype=np.int32)
    with pytest.raises(UnwrapError, match=r"are 9,000 tiles, more than 1,000"):
        pack_charts(uvs, faces, chart_ids, size=SIZE, padding=1, tiles=tiles, tile_groups=groups)


def peak_memory(charts, effort):
    """The packing, and the most bytes of arrays at any one time while it was made."""
    tracemalloc.start()
    try:
        packing = pack_charts(*charts, size=(256, 256), padding=1, effort=effort, threads=1)
        return packing, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("effort", ["fast", "good"])
@pytest.mark.parametrize(
    ("n_long", "n_squares"), [(1, 0), (1, 12), (40, 3), (600, 0)], ids=lambda count: f"{count}"
)
def test_memory_does_not_grow_with_the_length_of_charts(n_long, n_squares, effort):
    n_charts = n_long + n_squares
    side = np.ones(n_charts)
    moderate, absurd = (
        rectangles(np.where(np.arange(n_charts) < n_long, length, side), side)
        for length in (10.0, 1e6)
    )
    _, usual = peak_memory(moderate, effort)
    packing, peak = peak_memory(absurd, effort)
    # Bitmaps of thin charts at eight angles are larger than those of squares, but no larger than
    # the coarse grid of the search: 92 MB for 43 charts. Of 1e6 x 1 texels one would take 70 GB.
    assert peak < max(2 * usual, 150_000_000)
    assert ((packing.uvs > 0.0) & (packing.uvs < 1.0)).all()


@pytest.mark.parametrize("square", [True, False])
def test_each_tile_is_turned_upright(square):
    uvs, faces, chart_ids = triangles(3, 12)
    packing = pack_charts(uvs, faces, chart_ids, size=SIZE, padding=1, tiles=3)
    assert packing.n_tiles > 1
    owners = packing.tiles[chart_ids[faces[:, 0]]]
    u, v = np.moveaxis(packing.uvs[faces], 2, 0)
    heights = np.choose(owners[:, None] % 4, [-v, u, v, -u])
    upright = upright_tiles(packing, chart_ids, faces, heights, square=square)
    assert np.array_equal(np.floor(upright), np.floor(packing.uvs))  # in their tiles
    corners, before = upright[faces], packing.uvs[faces]
    assert np.allclose(signed_areas(corners), signed_areas(before))
    standing = owners % 4 % 2 == 0 if not square else np.ones(len(owners), dtype=bool)
    rise = (corners - corners[:, :1])[standing][..., 1]
    assert np.allclose(rise, (heights - heights[:, :1])[standing])
    flat = upright_tiles(packing, chart_ids, faces, np.zeros(faces.shape), square=square)
    assert np.array_equal(flat, packing.uvs)
