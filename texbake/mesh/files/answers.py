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
from typing import IO, Any

import numpy as np
import numpy.typing as npt

_LENGTH = struct.Struct("<Q")
_KINDS = "bifu"  # of arrays: booleans and numbers
Classes = Mapping[str, type]


class AnswerError(Exception):
    """What was received is cut off, or not what the other side may send."""


def send(value: Any, file: IO[bytes]) -> None:
    """Write a value: numbers, texts, bytes, arrays, sequences, mappings and dataclasses of them.

    Keys of mappings are texts or numbers. Sequences are received as tuples.
    """
    writer = _Writer()
    text = json.dumps(writer.tree(value)).encode()
    file.write(_LENGTH.pack(len(text)))
    file.write(text)
    for blob in writer.blobs:
        file.write(blob)
    file.flush()


def receive(file: IO[bytes], classes: Classes) -> Any:
    """Read a value that `send` has written."""
    try:
        (length,) = _LENGTH.unpack(_read(file, _LENGTH.size).tobytes())
        return _Reader(file, classes).value(json.loads(_read(file, length).tobytes()))
    except (ValueError, TypeError, LookupError, RecursionError, MemoryError) as error:
        raise AnswerError(f"{type(error).__name__}: {error}") from None


class _Writer:
    """Makes what JSON can hold of a value, and keeps the bytes that follow it."""

    def __init__(self) -> None:
        self.blobs: list[memoryview | bytes] = []
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


def _read(file: IO[bytes], length: int) -> npt.NDArray[np.uint8]:
    """Read an exact number of bytes."""
    data = np.empty(length, dtype=np.uint8)
    view = data.data
    while view:
        n = file.readinto(view)  # type: ignore[attr-defined]
        if not n:
            raise AnswerError("it is cut off")
        view = view[n:]
    return data


class _Reader:
    """Makes values of JSON and of the bytes that follow, in the order in which they were sent."""

    def __init__(self, file: IO[bytes], classes: Classes) -> None:
        self._file = file
        self._classes = classes
        self._received: list[bytes] = []

    def value(self, tree: Any) -> Any:
        """Make a value."""
        if isinstance(tree, list):
            return tuple(self.value(item) for item in tree)
        if not isinstance(tree, dict):
            return tree
        if "bytes" in tree:
            self._received.append(_read(self._file, tree["bytes"]).tobytes())
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
            raise AnswerError(f"it has an array of {dtype}")
        return _read(self._file, math.prod(shape) * dtype.itemsize).view(dtype).reshape(shape)
