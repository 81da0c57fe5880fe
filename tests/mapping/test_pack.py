import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st
from scipy.ndimage import distance_transform_edt

from texbake.errors import UnwrapError
from texbake.mapping.areas import signed_areas
from texbake.mapping.atlas.packing.pack import Packing, pack_charts

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]


def triangles(seed: int, n_charts: int) -> tuple[Array, Ints, Ints]:
    """Charts of one triangle each, of sizes from 1 to 10 and any shape."""
    random = np.random.default_rng(seed)
    corners = random.random((n_charts, 3, 2)) * random.uniform(1.0, 10.0, (n_charts, 1, 1))
    corners[signed_areas(corners) < 0.0] = corners[signed_areas(corners) < 0.0, ::-1]
    faces = np.arange(3 * n_charts, dtype=np.int32).reshape(-1, 3)
    return corners.reshape(-1, 2), faces, np.repeat(np.arange(n_charts, dtype=np.int32), 3)


def touched_texels(corners: Array, size: tuple[int, int]) -> npt.NDArray[np.bool_]:
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


def assert_kept_apart(
    packing: Packing, faces: Ints, chart_ids: Ints, size: tuple[int, int], padding: int
) -> None:
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
        assert min(rows.min(), columns.min()) >= padding
        assert rows.max() < size[1] - padding
        assert columns.max() < size[0] - padding


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 12),
    st.sampled_from([(96, 96), (128, 64), (50, 111)]),
    st.integers(0, 5),
    st.sampled_from(["fast", "good", "best"]),
)
def test_charts_are_kept_apart_and_keep_their_shape(
    seed: int, n_charts: int, size: tuple[int, int], padding: int, effort: str
) -> None:
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


@pytest.mark.parametrize(
    ("size", "padding"), [((256, 256), 0), ((256, 256), 16), ((512, 64), 2), ((64, 512), 2)]
)
def test_any_padding_and_proportion(size: tuple[int, int], padding: int) -> None:
    uvs, faces, chart_ids = triangles(5, 9)
    packing = pack_charts(uvs, faces, chart_ids, size=size, padding=padding)
    assert_kept_apart(packing, faces, chart_ids, size, padding)


def test_cells_of_several_texels_keep_charts_apart_as_well() -> None:
    size = (1200, 150)  # cells of 2 texels
    uvs, faces, chart_ids = triangles(1, 8)
    packing = pack_charts(uvs, faces, chart_ids, size=size, padding=3)
    assert_kept_apart(packing, faces, chart_ids, size, 3)


@pytest.mark.parametrize("size", [(256, 256), (256, 128), (100, 300)])
def test_a_square_fills_the_shorter_side(size: tuple[int, int]) -> None:
    uvs = np.array([[0.0, 0.0], [7.0, 0.0], [7.0, 7.0], [0.0, 7.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    packing = pack_charts(uvs, faces, np.zeros(4, np.int32), size=size, padding=3)
    side = min(size) - 6
    # The search stops a step of 0.4 % short, at most; a chart never reaches into the padding.
    assert side * 0.992 <= packing.texels_per_unit * 7.0 <= side


def test_small_charts_go_into_the_hole_of_a_large_one() -> None:
    def ring(inner: float) -> Array:
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


def test_thousands_of_charts_go_a_faster_way_and_are_kept_apart() -> None:
    uvs, faces, chart_ids = triangles(2, 1100)
    packing = pack_charts(uvs, faces, chart_ids, size=(512, 512), padding=1)
    corners = packing.uvs[faces]
    shared = np.sum([touched_texels(corners[i : i + 1], (512, 512)) for i in range(1100)], axis=0)
    assert shared.max() == 1
    assert packing.fill > 0.25  # of 1,100 triangles of some 10 texels, with gaps of 2


def test_the_result_is_the_same_every_time() -> None:
    charts = triangles(3, 20)
    packings = [
        pack_charts(*charts, size=(128, 128), padding=2, effort="best", threads=threads)
        for threads in (1, 2, 3)
    ]
    assert len({packing.uvs.tobytes() for packing in packings}) == 1


def test_more_effort_fills_more() -> None:
    charts = triangles(6, 40)
    fills = [
        pack_charts(*charts, size=(384, 384), padding=1, effort=effort).fill
        for effort in ("fast", "good", "best")
    ]
    # Measured: .655, .693, .752.
    assert (np.diff(fills) > 0.01).all()


def squares(sides: list[float]) -> tuple[Array, Ints, Ints]:
    """One square chart of each side."""
    unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    uvs = np.concatenate([unit * side for side in sides])
    first = 4 * np.arange(len(sides), dtype=np.int32)[:, None, None]
    faces = (np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32) + first).reshape(-1, 3)
    return uvs, faces, np.repeat(np.arange(len(sides), dtype=np.int32), 4)


@pytest.mark.parametrize("effort", ["fast", "good"])
def test_squares_that_fill_a_square_leave_only_their_gaps(effort: str) -> None:
    # 16 equal ones, and a large one with 12 small ones around two sides of it and 1 corner each.
    for sides in ([1.0] * 16, [3.0] + [1.0] * 7):
        packing = pack_charts(*squares(sides), size=(256, 256), padding=1, effort=effort)
        # In a row of 4 cells of the pattern lie 3 gaps of at least 2 whole texels, and 1 texel at
        # either border; a texel a square is lost where its sides do not fall on texels.
        side = (256 - 2 - 3 * 2) / 4
        assert side * 0.992 - 1.0 <= packing.texels_per_unit <= side


def test_a_chart_without_area_takes_a_place_all_the_same() -> None:
    uvs = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.3]])
    faces = np.array([[0, 1, 2], [3, 3, 3]], dtype=np.int32)
    packing = pack_charts(uvs, faces, np.array([0, 0, 0, 1], np.int32), size=(32, 32), padding=1)
    assert ((packing.uvs > 0.0) & (packing.uvs < 1.0)).all()
    assert packing.n_tiles == 1
    point = pack_charts(uvs[3:], faces[1:] - 3, np.zeros(1, np.int32), size=(32, 32), padding=1)
    assert ((point.uvs > 0.0) & (point.uvs < 1.0)).all()


def test_too_many_charts_for_the_texture() -> None:
    with pytest.raises(
        UnwrapError, match="bolt: 50 charts do not fit into 32 x 32 texels with a p"
    ):
        pack_charts(*triangles(4, 50), size=(32, 32), padding=4, name="bolt")
