"""How often a 3MF file places its objects, before any of them is placed.

The build of a file lists objects, which consist of others, as often as they like. trimesh takes
time with the square of the objects that are placed, and with that of their levels. Without a word,
it stops at a number of steps that two levels of objects can exceed, and leaves out all but one
object of a part number. So all of this is refused.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import chain
from typing import IO
from xml.etree.ElementTree import Element, ParseError, iterparse
from zipfile import BadZipFile, ZipFile

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.limits import LONGEST_NAME, most_triangles
from texbake.mesh.files.placed_counts import Placed, about, count_placed
from texbake.mesh.files.source import damaged

_MODEL = "3d/3dmodel.model"
_MOST_OBJECTS = 10_000
_MOST_LEVELS = 64
_MOST_TRIANGLES = 20_000_000
_NAMES = ("id", "name", "objectid", "partnumber")


def require_few_objects(path: PathLike) -> None:
    """Raise `FileFormatError` if a .3mf file places its objects without measure.

    It may place 10,000 objects in 64 levels, and 20 million triangles, or as many as it has bytes
    when it is unpacked. What cannot be counted is refused, too: the reader knows encodings that are
    not known here.
    """
    try:
        with ZipFile(path) as archive:
            build = _Build(archive)
            n_bytes = sum(part.file_size for part in archive.infolist())
    except (BadZipFile, KeyError):
        return  # the reader says what is wrong
    except (ParseError, ValueError, LookupError) as error:
        raise damaged(path, error) from error
    advice = "write it as a .glb file"
    if build.longest_name > LONGEST_NAME:
        raise FileFormatError(
            f"{path}: a name in it has {build.longest_name:,} characters, more than "
            f"{LONGEST_NAME}; {advice}"
        )
    placed = build.placed()
    if placed.levels > _MOST_LEVELS:
        raise FileFormatError(
            f"{path}: its objects consist of others in more than {_MOST_LEVELS} levels; {advice}"
        )
    if placed.nodes > _MOST_OBJECTS:
        raise FileFormatError(
            f"{path}: it places {about(placed.nodes)} objects, more than {_MOST_OBJECTS:,}; "
            f"{advice}"
        )
    most = most_triangles(_MOST_TRIANGLES)
    if placed.triangles > max(most, n_bytes):
        raise FileFormatError(
            f"{path}: it places up to {about(placed.triangles)} triangles, more than {most:,}; "
            f"if you trust the file, read it with texbake --max-triangles {placed.triangles}"
        )
    if placed.nodes > build.n_steps or build.has_twins:
        raise FileFormatError(
            f"{path}: it places its objects in a way in which some of them would be lost; {advice}"
        )


class _Build:
    """Objects by their ids, with those that each consists of, and the list of those to be built."""

    def __init__(self, archive: ZipFile) -> None:
        self.longest_name = 0
        self._items: list[str] = []
        self._numbered: list[tuple[str, str]] = []  # those of them with part numbers
        self._components: dict[str, list[str]] = defaultdict(list)
        self._triangles: dict[str, int] = defaultdict(int)
        self._of_parts: dict[str, int] = {}
        # As trimesh chooses it.
        main = next((name for name in archive.namelist() if _MODEL in name.lower()), "")
        with archive.open(main) as file:
            self._read(file, archive)

    @property
    def has_twins(self) -> bool:
        """Whether the build lists an object twice with one part number."""
        return any(n > 1 for n in Counter(self._numbered).values())

    @property
    def n_steps(self) -> int:
        """Steps after which trimesh stops, each from one object to one that it consists of."""
        placed = [*self._items, *chain.from_iterable(self._components.values())]
        return len(placed) * len({"the build", *placed, *self._components})

    def placed(self) -> Placed:
        """Count what the build places, triangles at most."""
        return count_placed(
            self._items,
            lambda name: self._components.get(name, []),
            lambda name: self._triangles.get(name, 0),
        )

    def _read(self, file: IO[bytes], archive: ZipFile) -> None:
        index = ""
        for event, element in iterparse(file, events=("start", "end")):
            tag = _tag(element)
            if event == "end":
                element.clear()
                continue
            self.longest_name = max(
                self.longest_name, *(len(element.get(name, "")) for name in _NAMES)
            )
            if tag == "object":
                index = element.get("id", "")
            elif tag == "triangle":
                self._triangles[index] += 1
            elif tag == "component":
                name = element.get("objectid", "")
                self._components[index].append(name)
                place = next((v for k, v in element.items() if k.endswith("path")), None)
                if place is not None:  # in another part of the archive
                    self._triangles[name] += self._of_part(archive, place.strip("/"))
            elif tag == "item":
                self._items.append(element.get("objectid", ""))
                number = element.get("partnumber")
                if number is not None:
                    self._numbered.append((self._items[-1], number))

    def _of_part(self, archive: ZipFile, name: str) -> int:
        """Return the triangles of a part of the archive."""
        if name not in self._of_parts:
            self._of_parts[name] = 0
            if name in archive.namelist():
                with archive.open(name) as file:
                    for _, element in iterparse(file):
                        self._of_parts[name] += _tag(element) == "triangle"
                        element.clear()
        return self._of_parts[name]


def _tag(element: Element) -> str:
    """Return the tag of an element without its namespace."""
    return element.tag.rpartition("}")[2]
