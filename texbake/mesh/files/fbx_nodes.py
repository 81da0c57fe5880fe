"""The nodes that an FBX file is made of, whether it is binary or text: a name, values, children."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NoReturn, Protocol

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.source import decode_name

MAX_DEPTH = 64  # levels of nodes; programs write fewer than ten
MAX_NODES = 2_000_000  # some 600 MB of Python objects

# Nodes whose children nobody asks for: they are passed over, however many there are.
PASSED_OVER = frozenset({
    "AnimationCurve", "AnimationCurveNode", "AnimationLayer", "AnimationStack", "Control",
    "CollectionExclusive", "Deformer", "Document", "Documents", "FBXHeaderExtension",
    "NodeAttribute", "Pose", "References", "Shape", "Takes", "Thumbnail",
})  # fmt: skip


class Array(Protocol):
    """Numbers that stand in the file, converted when they are asked for."""

    def load(self) -> npt.NDArray[Any]:
        """(n,) numbers."""


@dataclass(slots=True)
class Node:
    """A node of the file.

    Attributes
    ----------
    values : list
        int, float, bytes (text as it stands in the file) or `Array`.
    """

    name: str
    values: list[Any] = field(default_factory=list)
    children: list[Node] = field(default_factory=list)

    def child(self, name: str) -> Node | None:
        """Return the first child of a name."""
        return next((child for child in self.children if child.name == name), None)

    def named(self, name: str) -> list[Node]:
        """Return all children of a name."""
        return [child for child in self.children if child.name == name]

    def text(self, index: int = 0) -> str:
        """Return a value as text; empty where it is none."""
        value = self.values[index] if index < len(self.values) else b""
        return decode_name(value) if isinstance(value, bytes) else ""

    def child_text(self, name: str) -> str:
        """Return the text of a child; empty where there is none."""
        child = self.child(name)
        return "" if child is None else child.text()

    def numbers(self, name: str) -> npt.NDArray[Any]:
        """(n,) numbers of a child, or of its child `a`, as text files have it; none where none."""
        child = self.child(name)
        if child is None:
            return np.zeros(0)
        inner = child.child("a")
        parts = [
            value.load() if hasattr(value, "load") else np.array([value])
            for value in (child if inner is None else inner).values
            if not isinstance(value, bytes)
        ]
        if len(parts) == 1:
            return np.asarray(parts[0])
        return np.concatenate(parts) if parts else np.zeros(0)


class Budget:
    """Bytes of numbers that a file may still ask for; what it may grow to follows its size.

    A file whose numbers pack so well that they are more than this counts as an attack.
    """

    def __init__(self, path: PathLike, n_bytes: int) -> None:
        self.path = path
        self.left = max(256 << 20, 64 * n_bytes)

    def take(self, n_bytes: int) -> None:
        """Count bytes, and raise `FileFormatError` where the file asks for too many."""
        self.left -= n_bytes
        if self.left < 0:
            self.fail("its arrays unpack to far more than its size; export it again")

    def fail(self, what: str) -> NoReturn:
        """Raise `FileFormatError`."""
        raise FileFormatError(f"{self.path}: {what}")
