"""The maps of an asset to export: which file is which map, and how its values are decoded."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.maps import MAP_NAMES
from texbake.errors import FileError, OptionError, quoted
from texbake.files import PathLike, is_folder
from texbake.jobs.export.options import KINDS
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.texture.image import Image

COLORS = ("base-color", "emissive")
# Maps of which each channel is a map of its own.
PACKED = {"orm": ("ao", "roughness", "metalness")}
_ALIASES = {
    "texture": "base-color", "albedo": "base-color", "basecolor": "base-color",
    "base_color": "base-color", "diffuse": "base-color", "color": "base-color",
    "height": "displacement", "occlusion": "ao", "ambient-occlusion": "ao",
    "metallic": "metalness", "metallness": "metalness", "emission": "emissive",
    "rough": "roughness", "nor": "normal", "normals": "normal", "arm": "orm",
    "occlusion_roughness_metallic": "orm", "occlusionroughnessmetallic": "orm",
}  # fmt: skip
KNOWN = tuple(dict.fromkeys((*KINDS, *PACKED, *MAP_NAMES, *_ALIASES)))
"""Every name of a map."""
# How alike a name that is none must be to one that is to count as a slip, from 0 to 1.
_CLOSE = 0.75
SUFFIXES = (".exr", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff")
_NUMBER = re.compile(r"^(?P<name>.*?)(?:(?P<mark>[._:])(?P<number>[1-9]\d{2,3}))?$")
# Numbers after `_` or `.` that are a size in pixels; 1024 is also a UDIM tile.
_SIZES = ("512", "1024", "2048", "4096", "8192")


@dataclass(frozen=True, order=True)
class SourceMap:
    """A map: its kind, its UDIM tile (empty without one), its file, and its channel in that.

    Without a channel it is the whole file.
    """

    kind: str
    tile: str
    path: Path
    channel: int | None = None

    def of_channel(self, image: Image) -> Image:
        """Return what the map is of its file."""
        if self.channel is None:
            return image
        n_channels = image.pixels.shape[2]
        if n_channels < 3:
            raise OptionError(
                f"{self.path}: an ORM map has three channels, and this has {n_channels}"
            )
        return replace(image, pixels=image.pixels[..., [self.channel]])


def kind_of(name: str, others: Collection[str] = ()) -> tuple[str, str]:
    """Return the kind and the UDIM tile of a map's name.

    The name may end in a tile, from 1001, or in a size in pixels. `others` are the names beside it:
    if one of them is surely a tile, so is 1024.

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
    """Split a name from the mark and the number at its end, which may be empty."""
    found = _NUMBER.match(name)
    assert found is not None  # it matches anything
    return found["name"], found["mark"] or "", found["number"] or ""


def _is_tile(number: str) -> bool:
    return len(number) == 4 and number[0] == "1" and number != "1000"


def source_maps(maps: Mapping[str, PathLike]) -> list[SourceMap]:
    """Return maps by their names, such as ``normal``, or ``normal:1002`` of a UDIM tile; sorted.

    Each channel of an ORM map is a map, unless a file of its own is given for that.
    """
    sources: dict[tuple[str, str], SourceMap] = {}
    for name, path in maps.items():
        kind, tile = kind_of(name, maps)
        if not kind:
            raise OptionError(
                f"{path}: {quoted(name)} is not the name of a map; use one such as normal"
            )
        _check_spelling(name, kind, path)
        if (kind, tile) in sources:
            other = sources[kind, tile].path
            raise OptionError(f"{kind}: both {other} and {path} are this map; give one of them")
        sources[kind, tile] = SourceMap(kind, tile, Path(path))
    for packed, tile in [key for key in sources if key[0] in PACKED]:
        whole = sources.pop((packed, tile))
        for channel, kind in enumerate(PACKED[packed]):
            sources.setdefault((kind, tile), replace(whole, kind=kind, channel=channel))
    return sorted(sources.values())


def _check_spelling(name: str, kind: str, path: PathLike) -> None:
    """Raise if a name is that of a map but for a slip; `color2` is another image on purpose."""
    if any(word in kind for word in KNOWN):
        return
    close = get_close_matches(kind, KNOWN, n=1, cutoff=_CLOSE)
    if close:
        raise OptionError(
            f"{path}: {quoted(name)} is not the name of a map; did you mean {quoted(close[0])}? "
            "An image that is to be copied as it is needs another name"
        )


def find_maps(folder: PathLike, named: Mapping[str, PathLike] | None = None) -> dict[str, PathLike]:
    """Return the images of a folder that are named after maps, and those that are given.

    ``normal.png``, ``rock_normal.png``, ``rock_normal_1002.png`` (a tile) and
    ``rock_normal_2048.png`` (a size) are normal maps. Other images are left out.
    """
    folder = Path(folder)
    if not is_folder(folder):
        raise FileError(f"{folder}: there is no such folder; give one that bake has written")
    found: dict[str, Path] = {}
    taken = {kind_of(name, named or ()) for name in named or {}}
    images = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    stems = [path.stem for path in images]
    for path in images:
        name, tile = kind_of(path.stem, stems)
        fits = [word for word in KNOWN if name == word or name.endswith(("_" + word, "." + word))]
        if not fits:
            continue
        kind, _ = kind_of(max(fits, key=len))
        if (kind, tile) in taken:
            continue
        key = f"{kind}:{tile}" if tile else kind
        if key in found:
            raise OptionError(
                f"{folder}: {found[key].name} and {path.name} are both {kind}; "
                f"name the one to use in `named_maps`, as {kind}=FILE"
            )
        found[key] = path
    if not found and not taken:
        raise OptionError(f"{folder}: no image in it is named after a map, such as normal.png")
    return {**found, **(named or {})}


def normal_vectors(image: Image, convention: str) -> npt.NDArray[np.float32]:
    """(H, W, 3) vectors of a tangent-space normal map, y up.

    The code for 0 is decoded as exactly 0, so that flat texels stay flat at any bit depth. Vectors
    are not normalized.
    """
    if image.pixels.shape[2] < 3:
        raise OptionError(f"{image.name}: a normal map has three channels; give another image")
    space = image.metadata.get(SPACE, "tangent")
    if space != "tangent":
        raise OptionError(
            f"{image.name}: it is in {space} space; materials need a map in tangent space"
        )
    vectors = image.pixels[..., :3] * np.float32(2.0) - np.float32(1.0)
    if not image.is_float:
        # The code just above the middle decodes to half a step.
        step = np.float32(1.5 / (2**image.bits - 1))
        vectors[(vectors > 0.0) & (vectors < step)] = 0.0
    if image.metadata.get(CONVENTION, convention) == "directx":
        vectors[..., 1] *= -1.0
    return vectors


def heights_of(image: Image) -> tuple[npt.NDArray[np.float32], str | None]:
    """(H, W) heights of a displacement map in model units, and a note on what was assumed."""
    levels = image.pixels[..., 0]
    mid, scale = image.metadata.get(DISPLACEMENT_MID), image.metadata.get(DISPLACEMENT_SCALE)
    if isinstance(mid, int | float) and isinstance(scale, int | float):
        return ((levels.astype(np.float64) - mid) * scale).astype(np.float32), None
    if image.is_float:
        return levels, None
    return levels - np.float32(0.5), (
        f"{image.name}: its metadata does not define its heights; black to white is assumed to be "
        "1 unit, with the surface at the middle"
    )
