import numpy as np
import numpy.typing as npt
import pytest

from texbake.errors import UnwrapError
from texbake.mapping.areas import signed_areas
from texbake.mapping.atlas.packing.pack import Packing, pack_charts

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

SIZE = (128, 96)


def rectangles(widths: Array, heights: Array) -> tuple[Array, Ints, Ints]:
    """One chart each: two triangles."""
    n_charts = len(widths)
    unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    uvs = unit * np.stack([widths, heights], axis=1)[:, None]
    first = 4 * np.arange(n_charts, dtype=np.int32)[:, None, None]
    faces = (np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32) + first).reshape(-1, 3)
    return uvs.reshape(-1, 2), faces, np.repeat(np.arange(n_charts, dtype=np.int32), 4)


def mixed(seed: int, n_charts: int) -> tuple[Array, Ints, Ints]:
    random = np.random.default_rng(seed)
    return rectangles(*random.uniform(1.0, 5.0, (2, n_charts)))


def assert_in_their_tiles(packing: Packing, chart_ids: Ints, padding: int) -> None:
    corner = np.stack([packing.tiles % 10, packing.tiles // 10], axis=1)[chart_ids]
    texels = (packing.uvs - corner) * SIZE
    assert (texels >= padding).all()
    assert (texels <= np.array(SIZE) - padding).all()


def areas_in_texels(packing: Packing, faces: Ints) -> Array:
    return signed_areas(packing.uvs[faces] * SIZE)


@pytest.mark.parametrize("effort", ["fast", "good"])
def test_more_tiles_hold_larger_charts(effort: str) -> None:
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


def test_charts_of_a_tile_do_not_overlap() -> None:
    uvs, faces, chart_ids = mixed(2, 40)
    packing = pack_charts(uvs, faces, chart_ids, size=SIZE, padding=2, tiles=3)
    centers = [
        (np.arange(length * count) + 0.5) / length
        for length, count in zip(SIZE, (3, 1), strict=True)
    ]
    x, y = np.meshgrid(*centers)
    owners = np.zeros(x.shape, dtype=int)
    for corners in packing.uvs[faces]:
        edges = np.roll(corners, -1, axis=0) - corners
        sides = [
            edge[0] * (y - corner[1]) - edge[1] * (x - corner[0])
            for edge, corner in zip(edges, corners, strict=True)
        ]
        owners += np.min(sides, axis=0) > 0.0
    assert owners.max() == 1
    # Charts lie in the middle of their cells, and so hold rather more centers than their area.
    assert owners.sum() >= 0.98 * areas_in_texels(packing, faces).sum()


@pytest.mark.parametrize("density", [None, 3.0])
def test_groups_have_tiles_of_their_own_and_one_density(density: float | None) -> None:
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


def test_a_density_is_kept_and_takes_no_more_tiles_than_it_needs() -> None:
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


def test_a_density_that_needs_more_tiles_says_how_many() -> None:
    charts = rectangles(np.full(10, 6.0), np.full(10, 6.0))
    # At 10 texels per unit two of 60 x 60 fit side by side into 128 x 96, but not on top.
    needed = r"cup: at 10 texels per unit the charts need 5 tiles of "
    with pytest.raises(UnwrapError, match=needed):
        pack_charts(*charts, size=SIZE, padding=1, density=10.0, tiles=4, name="cup")
    packing = pack_charts(*charts, size=SIZE, padding=1, density=10.0, tiles=5)
    assert packing.n_tiles == 5


def test_a_density_at_which_a_chart_is_larger_than_a_tile_says_which_size_would_do() -> None:
    charts = rectangles(np.array([6.0, 20.0]), np.array([6.0, 15.0]))
    with pytest.raises(UnwrapError, match=r"cup: at 10 texels .* 200 texels long.* size of 206 or"):
        pack_charts(*charts, size=SIZE, padding=2, density=10.0, tiles=4, name="cup")
    packing = pack_charts(*charts, size=(206, 206), padding=2, density=10.0, tiles=4)
    assert packing.n_tiles == 2


def test_too_many_charts_for_all_tiles() -> None:
    with pytest.raises(UnwrapError, match="90 charts do not fit into 2 tiles of 128 x 96 texels"):
        pack_charts(*mixed(5, 90), size=SIZE, padding=8, tiles=2)
    with pytest.raises(UnwrapError, match="do not fit into 128 x 96 texels with a padding of 60"):
        pack_charts(*mixed(5, 2), size=SIZE, padding=60)


def test_tens_of_thousands_of_charts_go_the_fastest_way() -> None:
    random = np.random.default_rng(7)
    charts = rectangles(*np.exp(random.normal(0.0, 0.5, (2, 9000))))
    packing = pack_charts(*charts, size=(2048, 2048), padding=1)
    # Rectangles of some 16 texels with gaps of 2 to 4 can fill no more than about .7.
    assert packing.fill > 0.5


@pytest.mark.parametrize(("n_groups", "tiles"), [(9000, 1), (90, 100)])
def test_more_tiles_than_udim_numbers_are_refused(n_groups: int, tiles: int) -> None:
    uvs, faces, chart_ids = mixed(4, n_groups)
    groups = np.arange(n_groups, dtype=np.int32)
    with pytest.raises(UnwrapError, match=r"are 9,000 tiles, more than 1,000"):
        pack_charts(uvs, faces, chart_ids, size=SIZE, padding=1, tiles=tiles, tile_groups=groups)
