"""The maps that an asset is exported with: which file is which, and what is in it."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.map_names import MAP_NAMES
from texbake.errors import FileError, OptionError
from texbake.files import PathLike
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.texture.image import Image

# Maps that a program's material has a place for; all others are copied.
KINDS = ("normal", "displacement", "base-color", "ao", "roughness", "metalness", "emissive",
         "opacity", "bent-normal")  # fmt: skip
COLORS = ("base-color", "emissive")
_ALIASES = {
    "texture": "base-color", "albedo": "base-color", "basecolor": "base-color",
    "base_color": "base-color", "diffuse": "base-color", "color": "base-color",
    "height": "displacement", "occlusion": "ao", "ambient-occlusion": "ao",
    "metallic": "metalness", "metallness": "metalness", "emission": "emissive",
    "rough": "roughness", "nor": "normal", "normals": "normal",
}  # fmt: skip
SUFFIXES = (".exr", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff")
_NUMBER = re.compile(r"^(?P<name>.*?)(?:(?P<mark>[._:])(?P<number>[1-9]\d{2,3}))?$")
# Numbers after `_` or `.` that are a size in pixels; one of them is also that of a UDIM tile.
_SIZES = ("512", "1024", "2048", "4096", "8192")


@dataclass(frozen=True, order=True)
class SourceMap:
    """A map's file: its kind, the UDIM tile or an empty text, and where it is."""

    kind: str
    tile: str
    path: Path


def kind_of(name: str, others: Collection[str] = ()) -> tuple[str, str]:
    """Kind and UDIM tile of a map's name.

    Parameters
    ----------
    name
        Maybe with a tile, 1001 and up, or a size in pixels at its end. 1024 is both: it is a size
        unless it stands after a colon, or other names have tiles.
    others
        Names beside it.

    >>> kind_of("Albedo"), kind_of("normal_1002"), kind_of("ao:1001")
    (('base-color', ''), ('normal', '1002'), ('ao', '1001'))
    >>> kind_of("normal_1024"), kind_of("normal_1024", ["normal_1001"]), kind_of("normal_2048")
    (('normal', ''), ('normal', '1024'), ('normal', ''))
    """
    kind, mark, number = _divided(name)
    is_tile = _is_tile(number)
    if is_tile and number in _SIZES and mark != ":":
        is_tile = any(_is_tile(n) and n not in _SIZES for _, _, n in map(_divided, others))
    if not is_tile and (number not in _SIZES or mark == ":"):
        kind = name
    kind = kind.lower()
    return _ALIASES.get(kind, kind), number if is_tile else ""


def _divided(name: str) -> tuple[str, str, str]:
    """A name, and the mark and the number at its end, which may be empty."""
    found = _NUMBER.match(name)
    assert found is not None  # it matches anything
    return found["name"], found["mark"] or "", found["number"] or ""


def _is_tile(number: str) -> bool:
    return len(number) == 4 and number[0] == "1" and number != "1000"


def source_maps(maps: Mapping[str, PathLike]) -> list[SourceMap]:
    """Maps by their names, such as ``normal`` or, of a UDIM tile, ``normal:1002``; sorted.

    Raises
    ------
    OptionError
        Two names are one map, or a name is empty.
    """
    sources: dict[tuple[str, str], SourceMap] = {}
    for name, path in maps.items():
        kind, tile = kind_of(name, maps)
        if not kind:
            raise OptionError(f"{path}: {name!r} is no name of a map; give one such as normal")
        if (kind, tile) in sources:
            other = sources[kind, tile].path
            raise OptionError(f"{kind}: both {other} and {path} are this map; give one of them")
        sources[kind, tile] = SourceMap(kind, tile, Path(path))
    return sorted(sources.values())


def find_maps(folder: PathLike, named: Mapping[str, PathLike] | None = None) -> dict[str, PathLike]:
    """Images of a folder whose names are, or end in, that of a map; and those that are named.

    ``normal.png``, ``rock_normal.png``, ``rock_normal_1002.png`` of a tile and
    ``rock_normal_2048.png`` of a size are normal maps. An image whose name ends in none is left
    out.

    Parameters
    ----------
    folder
    named
        Files by the name of their map, which stand above those of the folder.

    Raises
    ------
    FileError
        There is no such folder.
    OptionError
        Two files are one map, or none is a map.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(f"{folder}: there is no such folder; give the one that bake wrote")
    known = (*KINDS, *MAP_NAMES, *_ALIASES)
    found: dict[str, Path] = {}
    taken = {kind_of(name, named or ()) for name in named or {}}
    images = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    stems = [path.stem for path in images]
    for path in images:
        name, tile = kind_of(path.stem, stems)
        fits = [word for word in known if name == word or name.endswith(("_" + word, "." + word))]
        if not fits:
            continue
        kind, _ = kind_of(max(fits, key=len))
        if (kind, tile) in taken:
            continue
        key = f"{kind}:{tile}" if tile else kind
        if key in found:
            raise OptionError(
                f"{folder}: {found[key].name} and {path.name} are both {kind}; "
                f"name one with --map {kind}=FILE"
            )
        found[key] = path
    if not found and not taken:
        raise OptionError(f"{folder}: no image in it is named after a map, such as normal.png")
    return {**found, **(named or {})}


def normal_vectors(image: Image, convention: str) -> npt.NDArray[np.float32]:
    """(H, W, 3) vectors of a tangent-space normal map, y up.

    A component whose code is the one that stands for 0 is 0, so that flat stays flat in whatever
    codes it is written again. Vectors keep the length that the codes have.

    Parameters
    ----------
    image
        As `read_image` gives it.
    convention
        Of a map that does not say it.

    Raises
    ------
    OptionError
        It says that it is in another space, or it has fewer than three channels.
    """
    if image.pixels.shape[2] < 3:
        raise OptionError(f"{image.name}: a normal map has three channels; give another image")
    space = image.metadata.get(SPACE, "tangent")
    if space != "tangent":
        raise OptionError(
            f"{image.name}: it is in {space} space; materials need a map baked with --space tangent"
        )
    vectors = image.pixels[..., :3] * np.float32(2.0) - np.float32(1.0)
    if not image.is_float:
        # The code just over the middle decodes to half a step.
        step = np.float32(1.5 / (2**image.bits - 1))
        vectors[(vectors > 0.0) & (vectors < step)] = 0.0
    if image.metadata.get(CONVENTION, convention) == "directx":
        vectors[..., 1] *= -1.0
    return vectors


def heights_of(image: Image) -> tuple[npt.NDArray[np.float32], str | None]:
    """(H, W) heights of a displacement map in model units, and what was taken for granted."""
    levels = image.pixels[..., 0]
    mid, scale = image.metadata.get(DISPLACEMENT_MID), image.metadata.get(DISPLACEMENT_SCALE)
    if isinstance(mid, int | float) and isinstance(scale, int | float):
        return ((levels.astype(np.float64) - mid) * scale).astype(np.float32), None
    if image.is_float:
        return levels, None
    return levels - np.float32(0.5), (
        f"{image.name}: it does not say what its levels stand for; black to white is taken for "
        "1 unit, and the middle for the surface"
    )
