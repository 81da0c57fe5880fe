"""The maps of an asset to export: which file is which map, and how each program reads it.

Green channels, heights, packed channels and formats are converted.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from texbake.baking.maps import MAP_NAMES
from texbake.errors import FileError, OptionError, quoted, similar
from texbake.files import PathLike, is_folder, replacing
from texbake.jobs.export.programs import KINDS, ExportedMap, ExportOptions
from texbake.mesh.mesh import Float32Array
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.targets import PROGRAMS, Target
from texbake.texture.dds import write_dds
from texbake.texture.image import Image, read_image, write_image
from texbake.texture.image_files import write_heights, write_normals
from texbake.texture.material_images import check_gray

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
_LEVEL = re.compile(r"_lod([1-9]\d*)(?:_|$)")
# Numbers after `_` or `.` that are a size in pixels; 1024 is also a UDIM tile.
_SIZES = ("512", "1024", "2048", "4096", "8192")


@dataclass(frozen=True, order=True)
class SourceMap:
    """A map: its kind, UDIM tile or none, file, and channel in that or the whole."""

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
    """Return the kind and the UDIM tile of a map's name; 1024 is a size unless `others` have tiles.

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
    """Maps by names such as ``normal`` or ``normal:1002``, with the channels of ORM; sorted."""
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
    question = similar(kind, KNOWN, _CLOSE)
    if question:
        raise OptionError(
            f"{path}: {quoted(name)} is not the name of a map; {question} "
            "An image that is to be copied as it is needs another name"
        )


def find_maps(
    folder: PathLike, named: Mapping[str, PathLike] | None = None, *, mesh: PathLike = ""
) -> dict[str, PathLike]:
    """Return the images of a folder that are named after maps of a mesh, and those given."""
    folder = Path(folder)
    if not is_folder(folder):
        raise FileError(f"{folder}: there is no such folder; give one that bake has written")
    found: dict[str, Path] = {}
    user_kinds = {kind_of(name, named or ()) for name in named or {}}
    images = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    level = _level_of(Path(mesh).stem)
    images = [path for path in images if _level_of(path.stem) == level] or images
    stems = [path.stem for path in images]
    for path in images:
        name, tile = kind_of(path.stem, stems)
        fits = [word for word in KNOWN if name == word or name.endswith(("_" + word, "." + word))]
        if not fits:
            continue
        kind, _ = kind_of(max(fits, key=len))
        if (kind, tile) in user_kinds:
            continue
        key = f"{kind}:{tile}" if tile else kind
        if key in found:
            raise OptionError(
                f"{folder}: {found[key].name} and {path.name} are both {kind}; "
                f"name the one to use in `named_maps`, as {kind}=FILE"
            )
        found[key] = path
    if not found and not user_kinds:
        raise OptionError(f"{folder}: no image in it is named after a map, such as normal.png")
    return {**found, **(named or {})}


def _level_of(stem: str) -> str:
    """Return the level of detail in a file's name, such as `1`; empty for the finest."""
    found = _LEVEL.search(stem)
    return found[1] if found else ""


def normal_vectors(image: Image, convention: str) -> Float32Array:
    """(H, W, 3) vectors of a tangent-space map, y up, not normalized; flat ones are exact."""
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


def heights_of(image: Image) -> tuple[Float32Array, str | None]:
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


# Channels of packed maps: kind, value if that map is missing, and whether it is inverted.
PACKINGS: dict[str, tuple[tuple[str | None, float, bool], ...]] = {
    "orm": (("ao", 1.0, False), ("roughness", 0.5, False), ("metalness", 0.0, False)),
    # The third channel masks detail maps; the last is smoothness, inverted roughness.
    "mask-map": (
        ("metalness", 0.0, False),
        ("ao", 1.0, False),
        (None, 1.0, False),
        ("roughness", 0.5, True),
    ),
}


@dataclass(eq=False)
class Converter:
    """Writes maps for one target into one folder."""

    folder: Path
    asset: str
    options: ExportOptions
    # Real paths of the input files, which must not be overwritten.
    inputs: frozenset[str] = frozenset()
    # What was assumed or could not be done, a sentence each.
    notes: list[str] = field(default_factory=list)

    @property
    def target(self) -> Target:
        """What the program expects."""
        return PROGRAMS[self.options.to]

    def write(self, sources: Sequence[SourceMap]) -> list[ExportedMap]:
        """Convert and write all maps, packed ones at the end."""
        packing = self.target.packing
        packed = [source for source in sources if packing and source.kind in PACKED["orm"]]
        written = [self._write_one(source) for source in sources if source not in packed]
        for tile in sorted({source.tile for source in packed}):
            parts = {source.kind: source for source in packed if source.tile == tile}
            path = self._file(str(packing), tile, self._texture_suffix())
            self.write_packed(parts, str(packing), path)
            missing = [kind for kind in PACKED["orm"] if kind not in parts]
            if missing:
                words = " and no ".join(missing)
                self.notes.append(f"{path.name}: no {words} was given; the channel is constant")
            written.append(ExportedMap(kind=str(packing), tile=tile, path=path))
        return written

    def place(self, name: str) -> Path:
        """Path of a file in the folder."""
        path = self.folder / name
        if os.path.realpath(path) in self.inputs:
            raise OptionError(f"{path}: it is also an input; give the output another folder")
        return path

    def write_packed(self, parts: Mapping[str, SourceMap], packing: str, path: Path) -> None:
        """Write occlusion, roughness and metalness as the channels of one image."""
        columns = {kind: self._data(source) for kind, source in parts.items()}
        sizes = {column.shape for column in columns.values()}
        if len(sizes) > 1:
            words = ", ".join(
                f"{kind} {column.shape[1]} x {column.shape[0]}" for kind, column in columns.items()
            )
            raise OptionError(f"{path}: maps to be packed differ in size ({words}); scale them")
        (size,) = sizes
        pixels = np.empty((*size, len(PACKINGS[packing])), np.float32)
        for i, (kind, default, is_turned) in enumerate(PACKINGS[packing]):
            values = np.float32(default) if kind not in columns else columns[kind]
            pixels[..., i] = 1.0 - values if is_turned else values
        self._write_texture(pixels, path, "data", "bc7")

    def write_normals_8(self, source: SourceMap, path: Path) -> None:
        """Write a normal map as glTF requires it: 8-bit, +Y."""
        write_normals(self._normals(source)[0], path, bits=8, threads=self.options.threads)

    def write_color_8(self, source: SourceMap, path: Path) -> None:
        """Write a color map as 8-bit sRGB PNG."""
        image = read_image(source.path, color=True, threads=self.options.threads)
        write_image(image.pixels, path, color=True, bits=8, threads=self.options.threads)

    def _write_one(self, source: SourceMap) -> ExportedMap:
        kind, tile = source.kind, source.tile
        if tile and not self.target.tile_mark:
            title = self.target.title
            self.notes.append(f"{source.path.name}: {title} does not support UDIM tiles")
        if kind == "displacement":
            return self._write_heights(source)
        if kind not in KINDS:
            path = self._file(kind, tile, source.path.suffix.lower())
            with replacing(path) as temporary:
                shutil.copyfile(source.path, temporary)
            return ExportedMap(kind=kind, tile=tile, path=path)
        path = self._file(kind, tile, self._texture_suffix())
        if kind in ("normal", "bent-normal"):
            self._write_normals(source, path)
        elif kind in COLORS:
            image = read_image(source.path, color=True, threads=self.options.threads)
            self._write_texture(image.pixels, path, "color", "bc7")
        else:
            self._write_texture(self._data(source)[..., None], path, "data", "bc4")
        return ExportedMap(kind=kind, tile=tile, path=path)

    def _write_heights(self, source: SourceMap) -> ExportedMap:
        image = read_image(source.path, color=False, threads=self.options.threads)
        check_gray(image, source.kind)
        heights, note = heights_of(image)
        if note:
            self.notes.append(note)
        heights = heights * np.float32(self.options.meters_per_unit)
        path = self._file(
            source.kind, source.tile, ".exr" if self.target.heights == "float" else ".png"
        )
        mid, scale = write_heights(heights, path, threads=self.options.threads)
        return ExportedMap(kind=source.kind, tile=source.tile, path=path, mid=mid, scale=scale)

    def _write_normals(self, source: SourceMap, path: Path) -> None:
        vectors, bits = self._normals(source)
        convention = self.target.convention
        if path.suffix == ".dds":
            write_dds(
                vectors, path, block_format="bc5", kind="normal", convention=convention,
                threads=self.options.threads,
            )  # fmt: skip
            return
        write_normals(
            vectors,
            path,
            convention=convention,
            bits=min(self.target.normal_bits, bits),
            threads=self.options.threads,
        )

    def _write_texture(self, pixels: Float32Array, path: Path, kind: str, blocks: str) -> None:
        threads = self.options.threads
        if path.suffix == ".dds":
            write_dds(pixels, path, block_format=blocks, kind=kind, threads=threads)
        else:
            write_image(pixels, path, color=kind == "color", bits=8, threads=threads)

    def _normals(self, source: SourceMap) -> tuple[Float32Array, int]:
        """Return the vectors, and the bits per channel that a PNG file needs for them."""
        image = read_image(source.path, color=False, threads=self.options.threads)
        return normal_vectors(image, self.options.convention), 8 if image.bits == 8 else 16

    def _data(self, source: SourceMap) -> Float32Array:
        """(H, W) values in [0, 1] of a map of one channel."""
        image = read_image(source.path, color=False, threads=self.options.threads)
        if source.channel is None:
            check_gray(image, source.kind)
        return np.clip(source.of_channel(image).pixels[..., 0], 0.0, 1.0)

    def _texture_suffix(self) -> str:
        return f".{self.options.textures}"

    def _file(self, kind: str, tile: str, suffix: str) -> Path:
        return self.place(self.target.map_stem(self.asset, kind, tile) + suffix)
