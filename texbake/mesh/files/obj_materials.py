"""Materials of OBJ files: which faces have which, and the colors that .mtl files give them.

Based on: Wavefront Technologies, "Object Files (.obj)", appendix B1, and "MTL material format",
1995. What they leave open is decided so: Kd is linear; where there is a `map_Kd` it is the color by
itself, because programs that write one leave anything in Kd. Options of `map_Kd` are skipped but
for `-clamp`.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.obj_statements import MARK, F, find_lines, read_corners
from texbake.mesh.files.polygons import fan_corners
from texbake.mesh.files.source import decode_name, map_file
from texbake.mesh.materials import BaseColor, Materials
from texbake.mesh.mesh import Mesh

_USE = re.compile(rb"usemtl\b[^\S\r\n]*([^\r\n]*)")
_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_STATEMENT = re.compile(rb"^[^\S\r\n]*(newmtl|Kd|map_Kd)[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
# Options of a map, by how many words follow them at most.
_OPTION_WORDS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1,
    "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip


def read_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of an OBJ file; None where no face has one.

    Faces before the first `usemtl` have the material `default`.

    Raises
    ------
    FileError
        A .mtl file or an image that it names is missing or cannot be read.
    FileFormatError
        A color is not three numbers.
    """
    data = map_file(path)
    lines = find_lines(data)
    starts = np.searchsorted(lines[F], lines[MARK]).tolist()
    uses = [
        (decode_name(match[1].strip()) or "default", start)
        for at, start in zip(lines[MARK].tolist(), starts, strict=True)
        if (match := _USE.match(data.data, at))
    ]
    if not uses:
        return None
    n_polygons = len(lines[F])
    polygons = np.zeros(n_polygons, dtype=np.int32)
    ids: dict[str, int] = {"default": 0} if uses[0][1] > 0 else {}
    stops = [start for _, start in uses[1:]]
    for (name, start), stop in zip(uses, [*stops, n_polygons], strict=True):
        if stop > start:
            polygons[start:stop] = ids.setdefault(name, len(ids))
    faces = polygons
    if n_polygons != mesh.n_faces:
        sizes, _ = read_corners(path, data, lines)
        faces = polygons[fan_corners(sizes)[1]]
    colors = _read_libraries(Path(path), data.data)
    return Materials(
        face_materials=faces, names=tuple(ids), base_colors=tuple(colors.get(name) for name in ids)
    )


def _read_libraries(path: Path, data: memoryview) -> dict[str, BaseColor]:
    """Base colors by the names of materials; the first library that has a name counts."""
    colors: dict[str, BaseColor] = {}
    for match in _LIBRARY.finditer(data):
        name = decode_name(match[1].strip())
        # One name with spaces in it, or several without.
        names = [name] if (path.parent / name).is_file() else name.split()
        for library in names:
            colors = {**_read_library(path.parent / library), **colors}
    return colors


def _read_library(path: Path) -> dict[str, BaseColor]:
    colors: dict[str, BaseColor] = {}
    name = "default"
    mapped = set()
    for match in _STATEMENT.finditer(map_file(path).data):
        keyword, words = match[1], decode_name(match[2].strip())
        if keyword == b"newmtl":
            name = words
            colors[name] = BaseColor()
        elif keyword == b"map_Kd":
            colors[name] = _mapped(path, words)
            mapped.add(name)
        elif name not in mapped:
            colors[name] = BaseColor(factor=_factor(path, words))
    return colors


def _factor(path: Path, words: str) -> tuple[float, float, float]:
    try:
        numbers = [float(word) for word in words.split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
        raise FileFormatError(f"{path}: Kd {words!r} is not a color of three numbers; mend it")
    red, green, blue = numbers * 3 if len(numbers) == 1 else numbers
    return red, green, blue


def _mapped(path: Path, words: str) -> BaseColor:
    """Base color of a map_Kd statement: options, then the name of a file, spaces and all."""
    wrap, rest = "repeat", words
    while (parts := rest.split(maxsplit=1)) and parts[0] in _OPTION_WORDS:
        option, rest = parts[0], parts[1] if len(parts) > 1 else ""
        for _ in range(_OPTION_WORDS[option]):
            value, _, after = rest.partition(" ")
            if _OPTION_WORDS[option] > 1 and not _is_number(value):
                break
            if option == "-clamp" and value == "on":
                wrap = "clamp"
            rest = after.lstrip()
    image = path.parent / rest.replace("\\", "/")
    return BaseColor(image=map_file(image).tobytes(), image_name=str(image), wrap=wrap)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
