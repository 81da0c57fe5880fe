import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.errors import OptionError
from texbake.texture.padding import fill, nearest_owner, push_pull


@st.composite
def charts(draw):
    height, width = draw(st.integers(1, 20)), draw(st.integers(1, 20))
    seed, density = draw(st.integers(0, 1 << 30)), draw(st.sampled_from([0.0, 0.02, 0.1, 0.5, 1.0]))
    rng = np.random.default_rng(seed)
    ids = rng.integers(0, 3, (height, width))
    return np.where(rng.random((height, width)) < density, ids, -1).astype(np.int32)


def squared_distances(chart_ids):
    """(H, W, n) to each of the n owners, and their rows and columns."""
    rows, columns = np.nonzero(chart_ids >= 0)
    y, x = np.indices(chart_ids.shape)
    return (y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2, rows, columns


@given(chart_ids=charts(), padding=st.integers(0, 30))
@settings(max_examples=200)
def test_it_agrees_with_trying_all_owners_and_counts_what_two_charts_reach(chart_ids, padding):
    owners = nearest_owner(chart_ids, padding, threads=1)
    distances, rows, columns = squared_distances(chart_ids)
    near = distances <= padding**2
    reached = near.any(axis=2)
    np.testing.assert_array_equal(owners.indices >= 0, reached)
    n_charts = sum(near[..., chart_ids[rows, columns] == i].any(2).astype(int) for i in range(3))
    assert owners.n_meeting == int(((n_charts >= 2) & (chart_ids < 0)).sum())
    if len(rows) == 0:
        return
    # Ties: the fewest columns between, then the left, then the upper.
    across = np.indices(chart_ids.shape)[1][..., None] - columns
    rank = np.lexsort((np.broadcast_to(rows, across.shape), -across, abs(across), distances))
    nearest = (rows * chart_ids.shape[1] + columns)[rank[..., 0]]
    np.testing.assert_array_equal(owners.indices[reached], nearest[reached])


@given(chart_ids=charts(), value=st.floats(-(2.0**100), 2.0**100, width=32))
@settings(max_examples=100)
def test_push_pull_of_a_constant_is_exactly_that_constant(chart_ids, value):
    mask = chart_ids >= 0
    values = np.where(mask[..., None], np.float32(value), np.float32(np.nan))
    filled = push_pull(values, mask, threads=1)
    if mask.any():
        assert (filled == np.float32(value)).all()


def test_a_padding_that_cannot_be_is_an_error():
    for padding in (-1, 16384):
        with pytest.raises(OptionError, match=r"padding: -?\d+ is not between"):
            nearest_owner(np.zeros((2, 2), np.int32), padding)


def test_push_pull_follows_the_nearest_side():
    values = np.zeros((32, 32, 1), np.float32)
    mask = np.zeros((32, 32), bool)
    mask[:, 0], mask[:, -1] = True, True
    values[:, -1] = 1.0
    means = push_pull(values, mask)[..., 0].mean(axis=0)
    assert (np.diff(means) >= -1e-6).all()  # float32 of a mean of 32
    assert means[8] < 0.3 and means[23] > 0.7


@given(chart_ids=charts(), padding=st.none() | st.integers(0, 30), kind=st.sampled_from("fIB?"))
def test_fill_keeps_data_types_and_shapes(chart_ids, padding, kind):
    known = chart_ids >= 0
    rng = np.random.default_rng(0)
    texels = rng.integers(0, 256, (*known.shape, 3)).astype(kind)
    if kind == "f":
        texels[~known] = np.nan  # is not read
    filled = fill(texels, known.astype(np.uint8), padding=padding)
    assert filled.dtype == texels.dtype and filled.shape == texels.shape
    np.testing.assert_array_equal(filled[known], texels[known])
    np.testing.assert_array_equal(fill(texels[..., 0], known, padding=padding), filled[..., 0])
    if padding is not None:
        sources = nearest_owner(np.where(known, 0, -1).astype(np.int32), padding).indices
        reached = sources >= 0
        np.testing.assert_array_equal(filled[reached], texels.reshape(-1, 3)[sources[reached]])
        np.testing.assert_array_equal(filled[~reached], texels[~reached])
    elif known.any() and kind != "?":
        assert (filled >= texels[known].min(axis=0)).all()
        assert (filled <= texels[known].max(axis=0)).all()
    elif not known.any():
        np.testing.assert_array_equal(filled, texels)


def test_fill_does_not_change_its_input_and_says_what_does_not_fit():
    texels = np.zeros((4, 6, 2), np.float16)
    texels.flags.writeable = False
    assert fill(texels, np.eye(4, 6)).dtype == np.float16
    with pytest.raises(OptionError, match=r"mask: its shape is \(6, 4\), that of the texels \(4,"):
        fill(texels, np.eye(6, 4))
    for wrong in (np.zeros(3), np.zeros((1, 2, 3, 4)), np.full((2, 2), "a"), None):
        with pytest.raises(OptionError, match="texels: "):
            fill(wrong, np.ones((2, 2)))
    with pytest.raises(OptionError, match=r"texels: their shape is \(0, 0\)"):
        fill(np.zeros((0, 0)), np.zeros((0, 0)))
    for padding in (-1, 1.5):
        with pytest.raises(OptionError, match=f"padding: {padding}"):
            fill(texels, np.eye(4, 6), padding=padding)
    with pytest.raises(OptionError, match="texels: there are integers beyond"):
        fill([[2**53 + 2, 0]], [[1, 0]])


@pytest.mark.parametrize("value", [
    np.uint32(2**32 - 1), np.int32(-(2**31)), np.int64(2**40 + 1), np.float64(1e300),
    np.float64(0.1),
])  # fmt: skip
def test_fill_keeps_numbers_that_float32_cannot_hold(value):
    filled = fill(np.array([[value, 0, 0]]).astype(value.dtype), [[1, 0, 0]])
    assert (filled == value).all() and filled.dtype == value.dtype
    filled = fill(np.array([[value, 0, value // 2]]).astype(value.dtype), [[1, 0, 1]])
    assert min(value, value // 2) <= filled[0, 1] <= max(value, value // 2)


def test_fill_leaves_out_infinite_values():
    filled = fill([[[1.0, 2.0], [0.0, 0.0], [np.inf, 4.0]]], [[1, 0, 1]])
    assert filled[0, 1].tolist() == [1.0, 2.0]


def test_padding_copies_integers_of_any_size():
    filled = fill(np.array([[2**64 - 1, 0]], np.uint64), [[1, 0]], padding=1)
    assert filled.tolist() == [[2**64 - 1] * 2]


def test_fill_takes_any_order_of_memory():
    rng = np.random.default_rng(1)
    planes, mask = rng.random((3, 9, 7)), rng.random((7, 9)).T < 0.4
    texels = planes.transpose(1, 2, 0)
    for padding in (None, 2):
        expected = fill(texels.copy("C"), mask.copy("C"), padding=padding)
        assert np.array_equal(fill(texels, mask, padding=padding), expected)
