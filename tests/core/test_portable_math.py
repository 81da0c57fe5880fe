"""Elementary functions and small linear algebra, against decimal numbers of 60 digits."""

import decimal
import hashlib
import math
from collections.abc import Callable
from decimal import Decimal

import numpy as np
import pytest

from texbake.core import portable_math as pm

# The documented bound; rounding alone gives 0.5.
MOST_ULPS = 0.7

decimal.getcontext().prec = 60
PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899863"
)


def series(terms):
    total = Decimal(0)
    for term in terms:
        total += term
        if abs(term) < abs(total) * Decimal("1e-58") or term == 0:
            return total
    raise AssertionError


def true_sin(x):
    with decimal.localcontext(prec=420):  # 1e308 has 308 digits before its first fraction
        pi = 4 * (4 * _atan_series(Decimal(1) / 5) - _atan_series(Decimal(1) / 239))
        rest = x - 2 * pi * (x / (2 * pi)).to_integral_value()

        def terms():
            term, n = rest, 1
            while True:
                yield term
                term, n = -term * rest * rest / ((n + 1) * (n + 2)), n + 2

        return series(terms())


def _atan_series(x):
    term, total, n = x, x, 1
    while abs(term) > Decimal(10) ** (5 - decimal.getcontext().prec):
        term, n = -term * x * x, n + 2
        total += term / n
    return total


def true_atan(x):
    halvings = 0
    while abs(x) > Decimal("0.05"):
        x, halvings = x / (1 + (1 + x * x).sqrt()), halvings + 1
    return _atan_series(x) * 2**halvings


def true_cos(x):
    with decimal.localcontext(prec=420):
        half = true_sin(x / 2)
        return 1 - 2 * half * half


def true_asin(x):
    return PI / 2 if x == 1 else true_atan(x / ((1 - x) * (1 + x)).sqrt())


TRUTHS: dict[str, Callable[..., Decimal]] = {
    "sin": true_sin, "cos": true_cos, "tan": lambda x: true_sin(x) / true_cos(x),
    "arcsin": true_asin, "arccos": lambda x: 2 * true_asin(((1 - x) / 2).sqrt()),
    "arctan": true_atan, "exp": Decimal.exp, "log": Decimal.ln,
    "log2": lambda x: x.ln() / Decimal(2).ln(), "log10": Decimal.log10, "arctan2": lambda y,
    x: true_atan(y / x) + (0 if x > 0 else PI.copy_sign(y)), "hypot": lambda x,
    y: (x * x + y * y).sqrt(), "power": lambda x, y: (y * x.ln()).exp(),
}  # fmt: skip


def arguments(name):
    """Some 300 arguments of a function, of all sizes and near its difficult points."""
    random = np.random.Generator(np.random.PCG64(7))

    def sizes(low, high, n=100):
        return np.ldexp(random.uniform(0.5, 1.0, n), random.integers(low, high, n))

    signs = np.where(random.random(100) < 0.5, -1.0, 1.0)
    if name in {"sin", "cos", "tan"}:
        near = np.arange(1, 101) * (np.pi / 2.0)
        return [np.concatenate([signs * sizes(-20, 20), sizes(20, 1000, 30), near])]
    if name in {"arcsin", "arccos"}:
        return [np.concatenate([signs * sizes(-30, 0), 1.0 - sizes(-50, 0)])]
    if name == "arctan":
        return [signs * sizes(-30, 30)]
    if name == "exp":
        return [np.concatenate([signs * sizes(-30, 9), random.uniform(-700.0, 700.0, 100)])]
    if name.startswith("log"):
        return [
            np.concatenate([sizes(-1000, 1000), 1.0 + sizes(-50, -2), random.uniform(0.5, 2, 99)])
        ]
    if name == "power":
        return [
            np.concatenate([sizes(-9, 9), 1.0 + sizes(-20, -4)]),
            random.uniform(-60.0, 60.0, 200),
        ]
    return [signs * sizes(-50, 50), np.roll(signs, 3) * sizes(-50, 50)]


def ulps_off(found, truth):
    return float(abs(Decimal(found) - truth) / Decimal(math.ulp(float(truth))))


@pytest.mark.parametrize("name", TRUTHS)
def test_results_are_off_by_less_than_a_unit_in_the_last_place(name):
    given = arguments(name)
    found = getattr(pm, name)(*given).tolist()
    rows = zip(*(map(Decimal, x.tolist()) for x in given), strict=True)
    truths = [TRUTHS[name](*row) for row in rows]
    assert max(map(ulps_off, found, truths)) < MOST_ULPS


def test_bits_are_the_same_on_every_processor():
    digest = hashlib.sha256()
    for name in sorted(TRUTHS):
        digest.update(getattr(pm, name)(*arguments(name)).tobytes())
    assert digest.hexdigest()[:16] == "28c8a7062a986fff"


@pytest.mark.parametrize(("name", "given", "result"), [
    ("power", (0.0, 0.0), 1.0), ("power", (-8.0, 3.0), -512.0),
    ("power", (-8.0, 0.5), np.nan),
    ("power", (0.0, -1.0), np.inf), ("power", (2.0, -np.inf), 0.0),
    ("power", (10.0, 400.0), np.inf),
    ("exp", (-np.inf,), 0.0), ("exp", (800.0,), np.inf), ("log", (0.0,), -np.inf),
    ("log", (-1.0,), np.nan), ("log10", (1000.0,), 3.0), ("log2", (0.125,), -3.0),
    ("arctan2", (0.0, -1.0), np.pi), ("arctan2", (-0.0, -1.0), -np.pi),
    ("arctan2", (0.0, 0.0), 0.0), ("arctan2", (np.inf, -np.inf), 0.75 * np.pi),
    ("hypot", (3 * 2.0**600, 2.0**602), 5 * 2.0**600), ("hypot", (np.inf, np.nan), np.inf),
    ("sin", (np.inf,), np.nan), ("arccos", (1.0,), 0.0), ("arcsin", (1.5,), np.nan),
    ("sin", (-0.0,), -0.0),
])  # fmt: skip
def test_special_values_are_as_in_c(name, given, result):
    np.testing.assert_equal(getattr(pm, name)(*given), result)


def test_numbers_give_numbers_and_float32_gives_float32():
    assert type(pm.sin(np.float64(1.0))) is float
    assert pm.power(np.full((2, 3), 2.0, np.float32), np.float32(0.5)).dtype == np.float32
    assert pm.arctan2(np.ones((2, 1)), np.ones(3)).shape == (2, 3)
    light = np.linspace(0.0, 1.0, 4097, dtype=np.float32)
    exact = pm.power(light.astype(np.float64), float(np.float32(1 / 2.4)))
    found = pm.power(light, np.float32(1 / 2.4))
    assert np.abs(found - exact).max() <= 0.51 * np.spacing(np.float32(0.5))


def test_matrices_are_multiplied_as_by_numpy():
    random = np.random.Generator(np.random.PCG64(1))
    for a, b in (
        ((3, 4), (4, 2)), ((5, 3, 4), (4, 2)), ((4, 4), (5, 4, 2)), ((5, 3, 4), (5, 4, 2)),
        ((2, 1, 3, 4), (5, 4, 2)), ((4,), (4, 2)), ((3, 4), (4,)), ((4,), (4,)), ((0, 4), (4, 2)),
        ((5, 0, 4), (4, 0)),
    ):  # fmt: skip
        first, second = random.normal(size=a), random.normal(size=b)
        np.testing.assert_allclose(pm.matmul(first, second), first @ second, rtol=1e-13, atol=1e-14)


def test_systems_inverses_and_determinants():
    random = np.random.Generator(np.random.PCG64(2))
    a, b = random.normal(size=(50, 4, 4)), random.normal(size=(50, 4, 2))
    np.testing.assert_allclose(pm.matmul(a, pm.solve(a, b)), b, atol=1e-11)
    np.testing.assert_allclose(pm.matmul(a, pm.inv(a)), np.tile(np.eye(4), (50, 1, 1)), atol=1e-11)
    np.testing.assert_allclose(pm.det(a), np.linalg.det(a), rtol=1e-11)
    assert pm.det([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) == -1.0
    np.testing.assert_array_equal(pm.inv(2.0**-500 * np.eye(4)), 2.0**500 * np.eye(4))
    with pytest.raises(np.linalg.LinAlgError):
        pm.inv([[1.0, 2.0], [2.0, 4.0]])


@pytest.mark.parametrize("function", [pm.eigh, pm.svd, pm.inv, pm.det])
def test_the_order_in_memory_changes_nothing(function):
    a = np.random.Generator(np.random.PCG64(5)).normal(size=(4, 4))
    symmetric = a + a.T
    by_columns = np.asfortranarray(symmetric)
    np.testing.assert_equal(function(by_columns), function(symmetric))


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_eigenvectors_and_singular_vectors(scale):
    random = np.random.Generator(np.random.PCG64(3))
    a = random.normal(size=(20, 3, 3)) * scale
    symmetric = a + a.swapaxes(1, 2)
    values, vectors = pm.eigh(symmetric)
    assert (np.diff(values, axis=1) >= 0.0).all()
    np.testing.assert_allclose(
        pm.matmul(symmetric, vectors), vectors * values[:, None], atol=1e-14 * scale
    )
    for shape in (3, 4), (6, 3), (1, 2):
        matrix = random.normal(size=shape) * scale
        sizes, directions = pm.svd(matrix)
        np.testing.assert_allclose(sizes, np.linalg.svd(matrix)[1], rtol=1e-13)
        identity = pm.matmul(directions, directions.T)
        np.testing.assert_allclose(identity, np.eye(shape[1]), atol=1e-14)
        images = pm.norm(pm.matmul(matrix, directions.T), axis=0)[: len(sizes)]
        np.testing.assert_allclose(images, sizes, rtol=1e-13)


def test_least_squares_of_a_matrix_without_full_rank():
    random = np.random.Generator(np.random.PCG64(4))
    matrix = random.normal(size=(9, 3))
    matrix[:, 2] = matrix[:, 0] - matrix[:, 1]
    sides = random.normal(size=9)
    found, rank = pm.lstsq(matrix, sides, rcond=1e-10)
    assert rank == 2
    np.testing.assert_allclose(found, np.linalg.lstsq(matrix, sides, rcond=1e-10)[0], atol=1e-13)


def test_interpolation_is_that_of_numpy():
    rng = np.random.default_rng(5)
    places, values = np.sort(rng.normal(size=9)), rng.normal(size=9)
    x = np.concatenate([rng.normal(scale=2.0, size=1000), places, [-np.inf, np.inf]])
    np.testing.assert_allclose(pm.interp(x, places, values), np.interp(x, places, values), 1e-14)
    assert pm.interp(places, places, values).tolist() == values.tolist()
