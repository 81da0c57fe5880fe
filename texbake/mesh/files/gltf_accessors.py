"""Where the values of all accessors of a glTF document are, and many of them read at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.files.gltf_document import COMPONENTS, WIDTHS, Document
from texbake.mesh.files.source import ByteArray

Integers = npt.NDArray[np.int64]

_MOST_ROWS = 1 << 12  # of an array; a call for each array takes less than reading more than these
_LARGEST = 1 << 48  # of counts and offsets, as in `Document.integer`


@dataclass(frozen=True, eq=False)
class Accessors:
    """Where the values of all accessors are.

    Attributes
    ----------
    kinds : (n,) int64
        Component type, width, and whether integers are normalized, as one number; -1 for those that
        are not read here.
    counts, buffers, starts, strides : (n,) int64
        Rows, the buffer, its byte where the first row is, and bytes from one row to the next.
    """

    document: Document
    kinds: Integers
    counts: Integers
    buffers: Integers
    starts: Integers
    strides: Integers

    @classmethod
    def of(cls, document: Document) -> Accessors:
        """Look at all accessors and views of a document."""
        accessors, views = document.items("accessors"), document.items("bufferViews")
        lengths = np.array([0, *map(len, document.buffers)], np.int64)
        # The first stands for accessors without a view.
        of_views = [{"buffer": -1}, *views]
        buffers = column_of(of_views, "buffer", -1)
        is_read = (buffers >= 0) & (buffers < len(lengths) - 1)
        buffers[~is_read | [("extensions" in view) for view in of_views]] = -1
        at, n_bytes, strides = (
            column_of(of_views, key, 0) for key in ("byteOffset", "byteLength", "byteStride")
        )
        is_sound = (buffers >= 0) & (at >= 0) & (n_bytes >= 0) & (strides >= 0)
        is_sound &= at + n_bytes <= lengths[buffers + 1]

        kinds = _kinds(accessors)
        counts, offsets = column_of(accessors, "count", -1), column_of(accessors, "byteOffset", 0)
        numbers = column_of(accessors, "bufferView", -1)
        numbers = np.where((numbers < -1) | (numbers >= len(views)), -1, numbers) + 1
        steps = np.where(strides[numbers] > 0, strides[numbers], _row_bytes(kinds))
        needed = offsets + steps * (counts - 1) + _row_bytes(kinds)
        is_plain = is_sound[numbers] & (counts > 0) & (counts <= _MOST_ROWS) & (offsets >= 0)
        is_plain &= needed <= n_bytes[numbers]
        is_plain &= np.array(["sparse" not in accessor for accessor in accessors], bool)
        kinds[~is_plain] = -1
        return cls(document, kinds, counts, buffers[numbers], at[numbers] + offsets, steps)

    def rows(self, of: Integers) -> npt.NDArray[Any]:
        """(n, width) values of accessors of one kind, joined; normalized integers as float64."""
        dtype, width, is_normalized = of_kind(int(self.kinds[of[0]]))
        n_item = dtype.itemsize * width
        counts = self.counts[of]
        ends = np.cumsum(counts)
        places = np.arange(ends[-1]) - np.repeat(ends - counts, counts)
        starts = np.repeat(self.starts[of], counts) + places * np.repeat(self.strides[of], counts)
        items = np.empty(len(starts), np.dtype((np.void, n_item)))
        in_buffers = np.repeat(self.buffers[of], counts)
        for number in np.unique(in_buffers).tolist():
            chosen = in_buffers == number
            items[chosen] = _windows(self.document.buffers[number], n_item)[starts[chosen]]
        values = items.view(dtype).reshape(-1, width)
        if is_normalized and dtype.kind in "iu":
            return np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values


def column_of(objects: Sequence[dict[str, Any]], key: str, default: int) -> Integers:
    """(n,) integers that objects hold under a key; -1 where one holds something else."""
    values = [item.get(key, default) for item in objects]
    if set(map(type, values)) - {int}:
        values = [value if type(value) is int else -1 for value in values]
    try:
        column = np.array(values, np.int64)
    except OverflowError:  # integers of JSON have any length
        column = np.array([value if abs(value) < _LARGEST else -1 for value in values], np.int64)
    column[column >= _LARGEST] = -1
    return column


def _windows(buffer: ByteArray, n_item: int) -> npt.NDArray[np.void]:
    """Items of so many bytes that begin at each byte of a buffer."""
    n = max(len(buffer) - n_item + 1, 0)
    return np.ndarray((n,), np.dtype((np.void, n_item)), buffer=buffer, strides=(1,))


_CODES = list(COMPONENTS)
_TYPES = list(WIDTHS)


def _kinds(accessors: Sequence[dict[str, Any]]) -> Integers:
    """(n,) numbers that say what the values of accessors are; -1 where that is not known."""
    names: list[Any] = [item.get("type") for item in accessors]
    if set(map(type, names)) - {str}:
        names = [name if isinstance(name, str) else "" for name in names]
    types = {name: i for i, name in enumerate(_TYPES)}
    of_names = np.array([types.get(name, -1) for name in names], np.int64)
    codes = column_of(accessors, "componentType", -1)
    at = np.minimum(np.searchsorted(_CODES, codes), len(_CODES) - 1)
    are_normalized = np.array([item.get("normalized") is True for item in accessors], np.int64)
    kinds = 2 * (at * len(_TYPES) + of_names) + are_normalized
    return np.where((of_names < 0) | (np.array(_CODES)[at] != codes), -1, kinds)


def of_kind(kind: int) -> tuple[np.dtype[Any], int, bool]:
    """Component type and width of a kind of values, and whether integers are normalized."""
    number, is_normalized = divmod(kind, 2)
    code, name = divmod(number, len(_TYPES))
    return COMPONENTS[_CODES[code]], WIDTHS[_TYPES[name]], bool(is_normalized)


def _row_bytes(kinds: Integers) -> Integers:
    sizes = [of_kind(kind) for kind in range(2 * len(_CODES) * len(_TYPES))]
    # The last is that of a kind that is not known, -1.
    return np.array([*(dtype.itemsize * width for dtype, width, _ in sizes), 1])[kinds]
