"""How often a COLLADA file places its nodes, before any of them is placed.

Nodes may place other nodes, which place others: ten levels of ten are 3.7 kB and ten billion nodes.
Polygons may say that they have billions of corners.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from typing import IO
from xml.etree.ElementTree import ParseError, iterparse

from texbake.errors import FileFormatError
from texbake.files import PathLike, read_bytes
from texbake.limits import LONGEST_NAME, most_triangles
from texbake.mesh.files.placed_counts import Placed, about, count_placed
from texbake.mesh.files.source import damaged

_MOST_NODES = 200_000
_MOST_TRIANGLES = 100_000_000
_NO_INDEX = re.compile(r"-|\d{11}")
_CHARACTERS = 6  # of the three indices of a triangle, at least
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
                raise damaged(path, error) from error
        if graph.longest_name > LONGEST_NAME:  # each node that is placed gets a name of its own
            raise FileFormatError(
                f"{path}: a name in it has {graph.longest_name:,} characters, more than "
                f"{LONGEST_NAME}; shorten it in the program that made the file"
            )
        placed = graph.placed()
        n_nodes, n_triangles = placed.nodes, placed.triangles
        if n_nodes > max(_MOST_NODES, graph.n_nodes):
            raise FileFormatError(
                f"{path}: its nodes place {about(n_nodes)} nodes, more than {_MOST_NODES:,}; "
                "join them in the program that made the file"
            )
        most = most_triangles(_MOST_TRIANGLES)
        if n_triangles > max(most, graph.n_characters):
            raise FileFormatError(
                f"{path}: its nodes repeat up to {about(n_triangles)} triangles, more than "
                f"{most:,}; if you trust the file, read it with texbake --max-triangles "
                f"{n_triangles}"
            )


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

    def placed(self) -> Placed:
        """Count what the scenes of the file place, triangles at most."""

        def triangles_of(index: int) -> int:
            return sum(self._triangles.get(name, 0) for name in self._nodes[index][2])

        return count_placed(self._roots, self._below, triangles_of)

    def _below(self, index: int) -> list[int]:
        nested, names, _ = self._nodes[index]
        return [*nested, *(self._by_id[name] for name in names if name in self._by_id)]
