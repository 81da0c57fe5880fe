"""Elementary functions and small linear algebra with the same bits on every processor.

The results of NumPy's `sin`, `exp`, `power` and the like, of its matrix products, and of the
functions of C and of `math` depend on the processor and on the version of the library. Use the
functions here, named as in NumPy, for everything that reaches a file or decides something.
Addition, multiplication, division and square roots are safe: IEEE 754 prescribes their results.
`tests/test_architecture.py` forbids the functions that are not portable.

The elementary functions accept numbers or arrays, which are broadcast, and return a float for
numbers. They compute in float64 with an error below 0.7 units in the last place; results for
float32 arrays are rounded to float32. Kernel: `core/portable_math.c`.
"""

from __future__ import annotations

import math
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from texbake.core.library import core

Array = npt.NDArray[Any]


class _Unary:
    """A function of one number, by the name of its kernel."""

    def __init__(self, kernel: str) -> None:
        self._kernel = kernel

    @overload
    def __call__(self, x: float, /) -> float: ...
    @overload
    def __call__(self, x: Array, /) -> Array: ...
    @overload
    def __call__(self, x: Any, /) -> Any: ...

    def __call__(self, x: Any, /) -> Any:
        values, rounded = _prepared(x)
        out = np.empty(values.shape)
        getattr(core, self._kernel)(values.reshape(-1), out.reshape(-1))
        return _finished(out, x, rounded=rounded)


class _Binary:
    """A function of two numbers, by the names of its kernels for float64 and, if any, float32."""

    def __init__(self, kernel: str, float_kernel: str | None = None) -> None:
        self._kernel, self._float_kernel = kernel, float_kernel

    @overload
    def __call__(self, x: float, y: float, /) -> float: ...
    @overload
    def __call__(self, x: Array, y: Any, /) -> Array: ...
    @overload
    def __call__(self, x: Any, y: Array, /) -> Array: ...
    @overload
    def __call__(self, x: Any, y: Any, /) -> Any: ...

    def __call__(self, x: Any, y: Any, /) -> Any:
        a, b = np.broadcast_arrays(x, y)
        if self._float_kernel and a.ndim and _is_float32(a) and _is_float32(b):
            short = np.empty(a.shape, np.float32)
            singles = (np.ascontiguousarray(values).reshape(-1) for values in (a, b))
            getattr(core, self._float_kernel)(*singles, short.reshape(-1))
            return short
        first, rounded = _prepared(a)
        second, other = _prepared(b)
        out = np.empty(first.shape)
        getattr(core, self._kernel)(first.reshape(-1), second.reshape(-1), out.reshape(-1))
        return _finished(out, a if np.ndim(x) or np.ndim(y) else 0.0, rounded=rounded and other)


def _prepared(x: Any) -> tuple[npt.NDArray[np.float64], bool]:
    """The values as contiguous float64, and whether they were float32 before."""
    return np.ascontiguousarray(x, np.float64).reshape(np.shape(x)), _is_float32(x)


def _is_float32(x: Any) -> bool:
    return isinstance(x, np.ndarray) and x.dtype == np.float32


def _finished(out: npt.NDArray[np.float64], x: Any, *, rounded: bool) -> Any:
    if np.ndim(x) == 0:
        return float(out)
    return out.astype(np.float32) if rounded else out


sin, cos, tan = _Unary("array_sin"), _Unary("array_cos"), _Unary("array_tan")
arcsin, arccos, arctan = _Unary("array_asin"), _Unary("array_acos"), _Unary("array_atan")
exp, log = _Unary("array_exp"), _Unary("array_log")
log2, log10 = _Unary("array_log2"), _Unary("array_log10")
arctan2, hypot = _Binary("array_atan2"), _Binary("array_hypot")
power = _Binary("array_power", "array_float_power")


def vecdot(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Sums of products along the last axis, added in order, of float32 arrays in float64."""
    first, second = np.broadcast_arrays(a, b)
    out = np.empty(first.shape[:-1])
    rows = _listed(first, 1)
    others = rows if a is b else _listed(second, 1)
    core.sum_row_products(rows, others, out.reshape(-1))
    return _as_given(out, first, second)


def matmul(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Products of matrices (..., n, k) and (..., k, m), or of one with a vector, as `a @ b`."""
    first, second = np.asarray(a), np.asarray(b)
    if first.ndim == 1 and second.ndim == 1:
        return vecdot(first, second)
    if first.ndim == 1:
        return matmul(first[None], second)[..., 0, :]
    if second.ndim == 1:
        return matmul(first, second[:, None])[..., 0]
    (rows, inner), (of_inner, columns) = first.shape[-2:], second.shape[-2:]
    if inner != of_inner:
        raise ValueError(f"matmul: shapes {first.shape} and {second.shape} do not match")
    if first.ndim == 2 and second.ndim == 2:
        product = np.empty((1, rows, columns))
        core.multiply_matrices(_listed(first[None], 2), _listed(second[None], 2), product)
        return _as_given(product[0], first, second)
    if second.ndim == 2:  # multiply all rows of `first` as one matrix
        listed = matmul(first.reshape(math.prod(first.shape[:-1]), inner), second)
        return np.asarray(listed.reshape(*first.shape[:-1], columns))
    shape = np.broadcast_shapes(first.shape[:-2], second.shape[:-2])
    out = np.empty((*shape, rows, columns))
    core.multiply_matrices(_matrices(first, shape), _matrices(second, shape), _listed(out, 2))
    return _as_given(out, first, second)


def matvec(matrices: npt.ArrayLike, vectors: npt.ArrayLike) -> Array:
    """Products of matrices (..., n, k) with vectors (..., k)."""
    return matmul(matrices, np.asarray(vectors)[..., None])[..., 0]


def vecmat(vectors: npt.ArrayLike, matrices: npt.ArrayLike) -> Array:
    """Products of vectors (..., k) with matrices (..., k, m): weighted sums of their rows."""
    return matmul(np.asarray(vectors)[..., None, :], matrices)[..., 0, :]


def norm(
    vectors: npt.ArrayLike, axis: int | tuple[int, int] | None = None, *, keepdims: bool = False
) -> Any:
    """Lengths of vectors along an axis; without an axis, the root of the sum of all squares."""
    values = np.asarray(vectors)
    values = values if values.dtype == np.float32 else values.astype(np.float64, copy=False)
    return np.sqrt((values * values).sum(axis=axis, keepdims=keepdims))


def interp(x: npt.ArrayLike, places: npt.ArrayLike, values: npt.ArrayLike) -> Array:
    """Interpolate at increasing places as `np.interp` does, without fused multiply-adds."""
    x, places, values = np.asarray(x), np.asarray(places), np.asarray(values)
    left = np.clip(np.searchsorted(places, x, side="right") - 1, 0, len(places) - 2)
    slopes = np.diff(values) / np.diff(places)
    inside = np.clip(x, places[0], places[-1])
    found = slopes[left] * (inside - places[left]) + values[left]
    return np.asarray(np.where(inside == places[-1], values[-1], found))


def det(matrices: npt.ArrayLike) -> Any:
    """Determinants of square matrices (..., n, n)."""
    a = np.array(matrices, np.float64)
    out = np.empty(a.shape[:-2])
    core.solve_systems(_listed(a, 2), np.empty((out.size, a.shape[-1], 0)), out.reshape(-1))
    return out if a.ndim > 2 else float(out)


def solve(matrices: npt.ArrayLike, sides: npt.ArrayLike) -> Array:
    """Solve `matrices @ x = sides` for matrices (..., n, n) and sides (..., n, m) or (n,)."""
    if np.ndim(sides) == 1:
        return solve(matrices, np.asarray(sides)[:, None])[:, 0]
    a, b = np.array(matrices, np.float64, order="C"), np.asarray(sides, np.float64)
    out = np.broadcast_to(b, (*a.shape[:-2], *b.shape[-2:])).copy()
    core.solve_systems(_listed(a, 2), _listed(out, 2), np.empty(math.prod(a.shape[:-2])))
    if not np.diagonal(a, axis1=-2, axis2=-1).all():  # a pivot is 0
        raise np.linalg.LinAlgError("Singular matrix")
    return out


def inv(matrices: npt.ArrayLike) -> Array:
    """Inverses of square matrices; raises `numpy.linalg.LinAlgError` if one is singular."""
    return solve(matrices, np.eye(np.shape(matrices)[-1]))


def eigh(matrices: npt.ArrayLike) -> tuple[Array, Array]:
    """Eigenvalues (..., n) of symmetric matrices, ascending, and eigenvectors as columns."""
    a = np.array(matrices, np.float64, order="C")
    vectors = np.empty_like(a)
    core.diagonalize(_listed(a, 2), _listed(vectors, 2))
    values = np.diagonal(a, axis1=-2, axis2=-1)
    order = np.argsort(values, axis=-1, kind="stable")
    return (
        np.take_along_axis(values, order, axis=-1),
        np.take_along_axis(vectors, order[..., None, :], axis=-1),
    )


def svd(matrix: npt.ArrayLike) -> tuple[Array, Array]:
    """Singular values of a matrix (m, n), descending, and all n right singular vectors as rows."""
    a = np.array(matrix, np.float64, order="C")[None]
    _, exponent = np.frexp(np.abs(a).max(initial=0.0))  # scaled so that no square overflows
    a = np.ldexp(a, -exponent)
    vectors = np.empty((1, a.shape[2], a.shape[2]))
    core.orthogonalize_columns(a, vectors)
    sizes = norm(a[0], axis=0)
    order = np.argsort(-sizes, kind="stable")
    sizes = np.ldexp(sizes[order][: min(a.shape[1:])], exponent)
    return sizes, np.ascontiguousarray(vectors[0].T[order])


def lstsq(matrix: npt.ArrayLike, sides: npt.ArrayLike, *, rcond: float) -> tuple[Array, int]:
    """Shortest x with `matrix @ x` closest to sides (m,), and the rank by singular values."""
    a = np.asarray(matrix, np.float64)
    sizes, directions = svd(a)
    rank = int(np.count_nonzero(sizes > rcond * sizes[0]))
    kept = directions[:rank]
    images = matmul(a, kept.T)
    shares = matmul(images.T, sides) / np.square(sizes[:rank])
    return matmul(shares, kept), rank


def decode_srgb(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Linear values of sRGB values, by IEC 61966-2-1; those above 1 continue the curve."""
    values = np.asarray(values, np.float64)
    return np.where(values <= 0.04045, values / 12.92, power((values + 0.055) / 1.055, 2.4))


def encode_srgb(light: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Convert linear values to sRGB values; the inverse of `decode_srgb`."""
    light = np.asarray(light, np.float64)
    bent = 1.055 * power(np.maximum(light, 0.0031308), 1.0 / 2.4) - 0.055
    return np.where(light <= 0.0031308, light * 12.92, bent)


def _listed(values: Array, n_axes: int) -> npt.NDArray[np.float64]:
    """Contiguous float64, with all axes but the last `n_axes` joined into one."""
    kept = values.shape[values.ndim - n_axes :]
    shape = math.prod(values.shape[: values.ndim - n_axes]), *kept
    return np.ascontiguousarray(values, np.float64).reshape(shape)


def _matrices(values: Array, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """A list of matrices, or a single matrix that serves for the whole list."""
    if values.ndim > 2 and values.shape[:-2] != shape:
        values = np.broadcast_to(values, (*shape, *values.shape[-2:]))
    return _listed(values, 2)


def _as_given(out: npt.NDArray[np.float64], *arrays: Array) -> Array:
    return out.astype(np.float32) if all(map(_is_float32, arrays)) else out
