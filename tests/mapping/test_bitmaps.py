from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from texbake.mapping.atlas.packing.bins import place_charts
from texbake.mapping.atlas.packing.bitmaps import (
    Bitmaps,
    Outlines,
    PackingGrid,
    border_angles,
    least_box_angles,
    shapes_of,
)
from texbake.mapping.atlas.packing.refine import SearchLimits, pair_weights, separate
from texbake.mesh.shapes import plane

SEARCH = SearchLimits(samples=20, radius=8, step=4, patience=100, work=100_000_000)


def random_bitmaps(seed, n_charts):
    """Blobs of up to 12 x 12 cells, in two poses each, with holes and bays."""
    random = np.random.default_rng(seed)
    boxes = random.integers(3, 13, (n_charts, 2, 2))
    n_cells = boxes.prod(axis=2)
    starts = np.cumsum(n_cells.ravel()).reshape(n_cells.shape) - n_cells
    masks = (random.random(n_cells.sum()) < 0.8).astype(np.uint8)
    masks[starts] = 1
    return Bitmaps(boxes=boxes, shifts=np.zeros((n_charts, 2, 2)), starts=starts, masks=masks)


def mask_of(bitmaps, chart, pose, turn):
    width, height = bitmaps.boxes[chart, pose]
    start = bitmaps.starts[chart, pose]
    # Rows go up, so that a turn counter-clockwise is one clockwise of rows that go down.
    return np.rot90(bitmaps.masks[start : start + width * height].reshape(height, width), -turn)


def stamped(mask, place, shape):
    grid = np.zeros(shape, dtype=np.uint8)
    grid[place[1] : place[1] + mask.shape[0], place[0] : place[0] + mask.shape[1]] = mask
    return grid


@pytest.mark.parametrize("hurry", [0, 1, 2])
@pytest.mark.parametrize("padding", [0, 1, 3])
def test_placed_charts_keep_their_distance(padding, hurry):
    bitmaps = random_bitmaps(padding, 30)
    grid = PackingGrid.over((90, 120), padding, most_cells=200)
    order = np.arange(30, dtype=np.int32)
    places, tops, n_missing = place_charts(bitmaps, order, grid, hurry=hurry)
    assert n_missing == 0
    reach = len(grid.half_widths) // 2
    near = np.array([np.abs(np.arange(2 * reach + 1) - reach) <= half for half in grid.half_widths])
    taken = np.zeros((grid.height, grid.width), dtype=bool)
    for chart, place in enumerate(places):
        mask = mask_of(bitmaps, chart, place[2], place[3])
        cells = stamped(mask, place, taken.shape).astype(bool)
        assert cells.sum() == mask.sum()
        assert not (cells & taken).any()
        assert tops[chart] == place[1] + len(mask)
        taken |= binary_dilation(cells, near)


@pytest.mark.parametrize("cell", [1, 2, 3, 5])
@pytest.mark.parametrize("padding", [0, 1, 3, 8])
def test_cells_with_texels_too_near_each_other_are_kept_apart(padding, cell):
    grid = PackingGrid.over((60 * cell, 50 * cell), padding, most_cells=60)
    assert grid.cell == cell
    reach = len(grid.half_widths) // 2
    texels = np.indices((cell, cell)).reshape(2, -1).T
    for row in range(-reach - 1, reach + 2):
        near = []
        for column in range(2 * padding + 3):
            moves = texels[:, None] - texels + np.array([row, column]) * cell
            near.append((moves**2).sum(axis=2).min() <= (2 * padding) ** 2)
        expected = grid.half_widths[row + reach] + 1 if abs(row) <= reach else 0
        assert sum(near) == expected and all(near[:expected])


def test_charts_without_a_place_are_left_out():
    bitmaps = random_bitmaps(1, 30)
    grid = PackingGrid.over((24, 24), 0, most_cells=200)
    order = np.arange(30, dtype=np.int32)
    places, _, n_missing = place_charts(bitmaps, order, grid, all_or_nothing=False)
    found = places[:, 0] >= 0
    assert 0 < n_missing == 30 - found.sum() < 30
    assert place_charts(bitmaps, order[found], grid)[2] == 0


@pytest.mark.parametrize("checkered", [False, True])  # the most runs that cells can have
def test_shapes_are_the_cells_of_turned_bitmaps_and_their_neighborhood(checkered):
    bitmaps = random_bitmaps(2, 6)
    if checkered:
        for (width, height), start in zip(
            bitmaps.boxes.reshape(-1, 2), bitmaps.starts.ravel(), strict=True
        ):
            checkers = 1 - np.indices((height, width)).sum(axis=0) % 2
            bitmaps.masks[start : start + width * height] = checkers.ravel()
    grid = PackingGrid.over((64, 64), 2, most_cells=64)
    shapes = shapes_of(bitmaps, grid.half_widths, turns=4)
    reach = len(grid.half_widths) // 2
    near = np.array([np.abs(np.arange(2 * reach + 1) - reach) <= half for half in grid.half_widths])
    for chart in range(6):
        for orientation in range(8):
            mask = mask_of(bitmaps, chart, orientation // 4, orientation % 4)
            assert (shapes.boxes[chart, orientation] == mask.shape[::-1]).all()
            wide = np.pad(mask, shapes.margin).astype(bool)
            for runs, starts, expected in (
                (shapes.spans, shapes.starts, wide),
                (shapes.reach, shapes.reach_starts, binary_dilation(wide, near)),
            ):
                cells = np.zeros_like(wide)
                for row, begin, end in runs[slice(*starts[chart, orientation])] + shapes.margin:
                    assert not cells[row, begin:end].any()
                    cells[row, begin:end] = True
                assert (cells == expected).all()


def overlap_of(shapes, places, size):
    """Cells of each chart in the neighborhood of each later one."""
    masks = np.zeros((2, len(places), size[1] + 40, size[0] + 40), dtype=bool)
    for chart, (x, y, orientation) in enumerate(places):
        for kind, (runs, starts) in enumerate(
            ((shapes.spans, shapes.starts), (shapes.reach, shapes.reach_starts))
        ):
            for row, begin, end in runs[slice(*starts[chart, orientation])]:
                masks[kind, chart, y + row + 20, x + begin + 20 : x + end + 20] = True
    n = len(places)
    return sum(int((masks[0, a] & masks[1, b]).sum()) for a in range(n) for b in range(a + 1, n))


@pytest.mark.parametrize("padding", [0, 2])
def test_charts_on_one_heap_are_moved_apart(padding):
    bitmaps = random_bitmaps(3, 16)
    half_widths = PackingGrid.over((64, 64), padding, most_cells=64).half_widths
    shapes = shapes_of(bitmaps, half_widths, turns=4)
    places = np.full((16, 3), 20, dtype=np.int32)
    places[:, 2] = 0
    weights = pair_weights(np.full(16, 60.0))
    size = (70, 64)
    apart, overlap, _ = separate(shapes, places, weights, size=size, search=SEARCH, seed=1)
    assert overlap == 0 == overlap_of(shapes, apart, size)
    assert overlap_of(shapes, places, size) > 0
    boxes = shapes.boxes[np.arange(16), apart[:, 2]]
    assert (apart[:, :2] >= 0).all()
    assert (apart[:, :2] + boxes <= size).all()


def test_charts_as_wide_as_the_grid_are_stacked():
    starts = 64 * np.arange(3)[:, None]
    boxes, shifts = np.full((3, 1, 2), 8), np.zeros((3, 1, 2))
    masks = np.ones(3 * 64, np.uint8)
    bitmaps = Bitmaps(boxes=boxes, shifts=shifts, starts=starts, masks=masks)
    shapes = shapes_of(bitmaps, np.zeros(1, dtype=np.int32), turns=1)
    places, weights = np.zeros((3, 3), dtype=np.int32), pair_weights(np.full(3, 64.0))
    apart, overlap, _ = separate(shapes, places, weights, size=(8, 30), search=SEARCH, seed=1)
    assert overlap == 0 == overlap_of(shapes, apart, (8, 30))
    assert (apart[:, 0] == 0).all() and apart[:, 1].max() <= 22


def test_charts_without_room_overlap_by_the_amount_reported():
    shapes = shapes_of(random_bitmaps(4, 12), np.zeros(1, dtype=np.int32), turns=4)
    places = np.zeros((12, 3), dtype=np.int32)
    weights = pair_weights(np.full(12, 60.0))
    size = (20, 20)
    found, overlap, _ = separate(shapes, places, weights, size=size, search=SEARCH, seed=1)
    assert 0 < overlap < overlap_of(shapes, places, size)
    assert overlap == overlap_of(shapes, found, size)


def test_a_turned_rectangle_is_turned_back_to_its_least_box():
    angle = np.radians(-33.0)
    corners = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 2.0], [0.0, 2.0]])
    uvs = corners @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    ids = np.zeros(4, dtype=np.int32)
    found = least_box_angles(uvs, ids)
    assert found == pytest.approx([-angle])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    charts = Outlines(uvs=uvs, faces=faces, chart_ids=ids, n_charts=1)
    poses = charts.turned(np.stack([found, found + np.pi / 2], axis=1))
    assert poses.extents == pytest.approx(np.array([[[5.0, 2.0], [2.0, 5.0]]]))


def test_the_border_of_a_circle_has_no_direction_and_that_of_a_square_one():
    arc = np.arange(120) * np.radians(3.0)
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    uvs = np.concatenate([np.stack([np.cos(arc), np.sin(arc)], axis=1), square @ turn])
    fans = [[[0, i, i + 1] for i in range(1, 119)], [[120, 121, 122], [120, 122, 123]]]
    faces = np.concatenate(fans).astype(np.int32)
    ids = np.repeat(np.arange(2, dtype=np.int32), [120, 4])
    charts = Outlines(uvs=uvs, faces=faces, chart_ids=ids, n_charts=2)
    angles, shares = border_angles(charts)
    assert angles[1] == pytest.approx(0.4)
    assert shares == pytest.approx([4.0 / 120.0, 1.0], abs=1e-6)
    # Unless it is too long: then only a border that is straight all around decides.
    assert charts.along_axes(9.0).aligned.tolist() == [False, True]
    assert charts.along_axes(0.1).aligned.tolist() == [False, True]


def test_a_chart_between_cell_centers_still_takes_a_cell():
    uvs = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [3.0, 0.0], [7.4, 0.0], [3.0, 6.4]])
    faces = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
    ids = np.repeat(np.arange(2, dtype=np.int32), 3)
    charts = Outlines(uvs=uvs, faces=faces, chart_ids=ids, n_charts=2)
    poses = charts.turned(np.zeros((2, 1)))
    bitmaps = poses.bitmaps(1.0, -0.5)
    # The triangle of 4.4 x 6.4 lies in the middle of 4 x 6 cells, with centers from (0.7, 0.7) on:
    # 5, 4, 2 and 1 of the columns are below its long side.
    assert (np.add.reduceat(bitmaps.masks, bitmaps.starts.ravel()) == [1, 12]).all()


@pytest.mark.parametrize("margin", [-0.3, 0.0, 1 / 512, 0.6])
@pytest.mark.parametrize("scale", [0.7, 4.0, 23.7])
def test_cells_inside_a_chart_are_those_that_its_faces_touch(margin, scale):
    grid = plane(24, 8)
    u, v = (grid.positions[:, :2] * [24.0, 8.0]).T
    n, jitter = len(u), np.random.default_rng(7).uniform(-0.3, 0.3, (len(u), 2))
    turn, radius = u / 3.0, 4.0 + 0.2 * u + 0.5 * v
    layouts = [
        np.stack([u, v], axis=1),  # on the borders of cells
        np.stack([u, v], axis=1) + jitter,
        np.stack([radius * np.cos(turn), -radius * np.sin(turn)], axis=1),  # overlapping itself
        np.stack([np.abs(u - 12.3), v], axis=1),  # folded
        np.stack([u * (1.0 - 1e-9 * v), v * 1e-9], axis=1),  # as thin as a line
    ]
    charts = Outlines(
        uvs=np.concatenate(layouts),
        faces=np.concatenate([grid.faces + n * np.int32(i) for i in range(5)]),
        chart_ids=np.repeat(np.arange(5, dtype=np.int32), n),
        n_charts=5,
    )
    angles = np.array([[0.0, 0.3, np.pi / 4.0]] * len(layouts))
    found = charts.turned(angles).bitmaps(scale, margin)
    assert [len(drawn) > 0 for drawn in charts.drawn] == [True, True]
    alone = replace(charts)
    alone.__dict__["drawn"] = charts.faces, np.empty((0, 2), dtype=np.int32)
    assert (found.masks == alone.turned(angles).bitmaps(scale, margin).masks).all()
