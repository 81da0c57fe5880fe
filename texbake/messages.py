"""Values that one process sends another: JSON, and after it the bytes of arrays and images.

Nothing that is received runs, and only the classes that the receiver lists are made, so that the
sender may be a process that reads files of strangers.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

_LENGTH = struct.Struct("<Q")
_KINDS = "bifu"  # of arrays: booleans and numbers
_ALIGNMENT = 16  # bytes
Classes = Mapping[str, type]


class MessageError(Exception):
    """What was received is cut off, or not what the other side may send."""


def pack(value: Any) -> list[bytes | memoryview]:
    """Message of a number, text, bytes, array, or sequence, mapping or dataclass of such values."""
    writer = _Writer()
    text = json.dumps(writer.tree(value)).encode()
    text += b" " * _padding(_LENGTH.size + len(text))
    parts: list[bytes | memoryview] = [_LENGTH.pack(len(text)) + text]
    for blob in writer.blobs:
        parts += [blob, bytes(_padding(len(blob)))]
    return parts


def unpack(message: bytes, classes: Classes) -> Any:
    """Return the value of a message; arrays share its memory."""
    try:
        (length,) = _LENGTH.unpack_from(message)
        end = _LENGTH.size + length
        return _Reader(message, end, classes).value(json.loads(message[_LENGTH.size : end]))
    except (struct.error, ValueError, TypeError, LookupError, RecursionError) as error:
        raise MessageError(f"{type(error).__name__}: {error}") from None


def _padding(n_bytes: int) -> int:
    return -n_bytes % _ALIGNMENT


class _Writer:
    """Makes what JSON can hold of a value, and keeps the bytes that follow it."""

    def __init__(self) -> None:
        self.blobs: list[bytes | memoryview] = []
        self._sent: dict[int, int] = {}

    def tree(self, value: Any) -> Any:
        """Return what JSON can hold of a value."""
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, bytes):
            return self._bytes(value)
        if isinstance(value, np.ndarray):
            array = np.ascontiguousarray(value)
            self.blobs.append(array.reshape(-1).view(np.uint8).data)
            return {"array": array.dtype.str, "shape": list(array.shape)}
        if isinstance(value, Mapping):
            return {"pairs": [[self.tree(key), self.tree(item)] for key, item in value.items()]}
        if is_dataclass(value):
            members = {f.name: self.tree(getattr(value, f.name)) for f in fields(value)}
            return {"class": type(value).__name__, "members": members}
        return [self.tree(item) for item in value]

    def _bytes(self, value: bytes) -> dict[str, int]:
        """Bytes that several members share, such as the content of an image, are sent once."""
        if id(value) in self._sent:
            return {"again": self._sent[id(value)]}
        self._sent[id(value)] = len(self._sent)
        self.blobs.append(value)
        return {"bytes": len(value)}


class _Reader:
    """Makes values of JSON and of the bytes that follow, in the order in which they were sent."""

    def __init__(self, message: bytes, at: int, classes: Classes) -> None:
        self._message, self._at, self._classes = message, at, classes
        self._received: list[bytes] = []

    def value(self, tree: Any) -> Any:
        """Make a value."""
        if isinstance(tree, list):
            return tuple(self.value(item) for item in tree)
        if not isinstance(tree, dict):
            return tree
        if "bytes" in tree:
            at = self._take(tree["bytes"])
            self._received.append(self._message[at : at + tree["bytes"]])
            return self._received[-1]
        if "again" in tree:
            return self._received[tree["again"]]
        if "array" in tree:
            return self._array(np.dtype(tree["array"]), tree["shape"])
        if "pairs" in tree:
            return {self.value(key): self.value(item) for key, item in tree["pairs"]}
        made = self._classes[tree["class"]]
        return made(**{name: self.value(item) for name, item in tree["members"].items()})

    def _array(self, dtype: np.dtype[Any], shape: list[int]) -> npt.NDArray[Any]:
        if dtype.kind not in _KINDS:
            raise MessageError(f"it has an array of {dtype}")
        n = math.prod(shape)
        at = self._take(n * dtype.itemsize)
        return np.frombuffer(self._message, dtype, n, at).reshape(shape)

    def _take(self, n_bytes: int) -> int:
        """Return where the next bytes begin, and pass over them."""
        at = self._at
        if not 0 <= n_bytes <= len(self._message) - at:
            raise MessageError("it is cut off")
        self._at = at + n_bytes + _padding(n_bytes)
        return at
