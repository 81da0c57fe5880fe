"""How often a COLLADA file places its nodes, before any of them is placed.

Nodes may place other nodes, which place others: ten levels of ten are 3.7 kB and ten billion nodes.
Polygons may say that they have billions of corners.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, TypeVar
from xml.etree.ElementTree import ParseError, iterparse

from texbake.errors import FileFormatError, one_line
from texbake.files import PathLike, read_bytes
from texbake.limits import LONGEST_NAME

Node = TypeVar("Node", int, str)

_MOST_NODES = 200_000
_MOST_TRIANGLES = 100_000_000
_NO_INDEX = re.compile(r"-|\d{11}")
_CHARACTERS = 6  # of the three indices of a triangle, at least
# Counts stop here: each level of nodes could add digits, up to gigabytes of them.
_COUNTLESS = 10**12
_HEAD_OF_MACOS = b"\0\5\x16\7"  # of the files about files, ._NAME, that macOS adds to archives


def require_few_instances(path: PathLike) -> None:
    """Raise `FileFormatError` if the nodes of a .dae or .zae file are placed without measure.

    A file may place 200,000 nodes, or as many as it has, and 100 million triangles, or as many as
    it has characters. Names have 400 characters at most. A node that places itself is left to the
    reader, which refuses it. What cannot be counted is refused, too: the reader knows encodings
    that are not known here.
    """
    for file in _documents(path):
        with file:
            try:
                graph = _Graph(file)
            except (ParseError, ValueError, LookupError) as error:
                raise FileFormatError(
                    f"{path}: it is not a {Path(path).suffix.lower()} file, or it is damaged: "
                    f"{one_line(error)}; export it again"
                ) from error
        if graph.longest_name > LONGEST_NAME:  # each node that is placed gets a name of its own
            raise FileFormatError(
                f"{path}: a name in it has {graph.longest_name:,} characters, more than "
                f"{LONGEST_NAME}; shorten it in the program that made the file"
            )
        n_nodes, n_triangles = graph.placed()
        if n_nodes > max(_MOST_NODES, graph.n_nodes):
            raise FileFormatError(
                f"{path}: its nodes place {about(n_nodes)} nodes, more than {_MOST_NODES:,}; "
                "join them in the program that made the file"
            )
        if n_triangles > max(_MOST_TRIANGLES, graph.n_characters):
            raise FileFormatError(
                f"{path}: its nodes repeat up to {about(n_triangles)} triangles, more than "
                f"{_MOST_TRIANGLES:,}; join them in the program that made the file"
            )


def about(number: int) -> str:
    """Return a count in words, where it may have stopped at 10^12."""
    return f"{number:,}" if number < _COUNTLESS else f"at least {_COUNTLESS:,}"


def _documents(path: PathLike) -> Iterator[IO[bytes]]:
    """Yield the documents of an archive, or the file itself."""
    if not zipfile.is_zipfile(path):
        yield io.BytesIO(read_bytes(path))
        return
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            if name.lower().endswith(".dae"):
                content = archive.read(name)
                if not content.startswith(_HEAD_OF_MACOS):
                    yield io.BytesIO(content)


def _require_corners(n_corners: int, n_characters: int) -> None:
    if n_corners > n_characters:
        raise ValueError(f"a list of polygons counts {n_corners:,} corners and has fewer")


class _Graph:
    """Nodes, by their order in the file, with the nodes and geometries that each places."""

    def __init__(self, file: IO[bytes]) -> None:
        self.n_characters = 0
        self.longest_name = 0  # of nodes and geometries
        self._nodes: list[tuple[list[int], list[str], list[str]]] = []
        self._by_id: dict[str, int] = {}
        self._triangles: dict[str, int] = {}
        self._roots: list[int] = []
        self._read(file)

    @property
    def n_nodes(self) -> int:
        """Nodes of the file."""
        return len(self._nodes)

    def _read(self, file: IO[bytes]) -> None:
        inside: list[int] = []  # the nodes around what is read
        n_scenes = 0  # those around it
        geometry = ""
        n_corners, n_written = 0, None  # that polygons say they have, and characters of them
        for event, element in iterparse(file, events=("start", "end")):
            tag = element.tag.rpartition("}")[2]
            is_start = event == "start"
            if is_start and tag in ("node", "geometry"):
                names = (element.get("id", ""), element.get("name", ""))
                self.longest_name = max(self.longest_name, *map(len, names))
            if tag == "node":
                if is_start:
                    self._add_node(element.get("id", ""), inside, n_scenes > 0)
                else:
                    inside.pop()
            elif tag == "visual_scene":
                n_scenes += 1 if is_start else -1
            elif tag == "geometry" and is_start:
                geometry = element.get("id", "")
                self._triangles.setdefault(geometry, 0)
            elif tag == "p" and not is_start:
                text = element.text or ""
                if _NO_INDEX.search(text):  # the reader would take another vertex
                    raise ValueError("an index of its faces is out of range")
                n = len(text)
                n_written = n if n_written is None else n_written  # the reader takes the first
                if geometry:
                    self.n_characters += n
                    self._triangles[geometry] += n // _CHARACTERS
            elif tag == "vcount" and not is_start:
                n_corners += sum(abs(int(count)) for count in (element.text or "").split())
            elif tag == "polylist" and not is_start:
                _require_corners(n_corners, n_written or 0)
                n_corners, n_written = 0, None
            elif inside and is_start and tag in ("instance_node", "instance_geometry"):
                placed = self._nodes[inside[-1]][1 if tag == "instance_node" else 2]
                placed.append(element.get("url", "").lstrip("#"))
            if not is_start:
                element.clear()

    def _add_node(self, name: str, inside: list[int], is_shown: bool) -> None:
        index = len(self._nodes)
        if inside:
            self._nodes[inside[-1]][0].append(index)
        elif is_shown:
            self._roots.append(index)
        self._nodes.append(([], [], []))
        self._by_id.setdefault(name, index)
        inside.append(index)

    def placed(self) -> tuple[int, int]:
        """Return the nodes and, at most, the triangles that the scenes of the file place."""

        def triangles_of(index: int) -> int:
            return sum(self._triangles.get(name, 0) for name in self._nodes[index][2])

        return placed_counts(self._roots, self._below, triangles_of)

    def _below(self, index: int) -> list[int]:
        nested, names, _ = self._nodes[index]
        return [*nested, *(self._by_id[name] for name in names if name in self._by_id)]


def placed_counts(
    roots: Sequence[Node], below: Callable[[Node], list[Node]], own: Callable[[Node], int]
) -> tuple[int, int]:
    """Count what nodes place that place other nodes, each as often as it is placed.

    Parameters
    ----------
    roots
        Nodes at the top.
    below, own
        Functions that return the nodes that a node places, and how many triangles it has itself.

    Returns
    -------
    n_nodes, n_triangles : int
        Those of each root are 10^12 at most; a circle counts as nothing.
    """
    totals: dict[Node, tuple[int, int]] = {}
    open_nodes: set[Node] = set()
    waiting = list(roots)
    while waiting:
        node = waiting[-1]
        if node in totals:  # many nodes may place it
            waiting.pop()
            continue
        placed = below(node)
        later = [other for other in placed if other not in totals and other not in open_nodes]
        if node not in open_nodes and later:
            open_nodes.add(node)
            waiting += later
            continue
        waiting.pop()
        open_nodes.discard(node)
        known = [totals.get(other, (0, 0)) for other in placed]
        n_nodes = 1 + sum(n for n, _ in known)
        n_triangles = own(node) + sum(t for _, t in known)
        totals[node] = min(n_nodes, _COUNTLESS), min(n_triangles, _COUNTLESS)
    found = [totals[node] for node in roots]
    return sum(n for n, _ in found), sum(t for _, t in found)
