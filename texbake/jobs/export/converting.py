"""Converts maps for a program: green channel, heights, packed channels, formats."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.files import replacing
from texbake.jobs.export.options import KINDS, ExportOptions
from texbake.jobs.export.programs import PROGRAMS, ExportedMap, Target
from texbake.jobs.export.sources import COLORS, PACKED, SourceMap, heights_of, normal_vectors
from texbake.texture.dds import write_dds
from texbake.texture.image import read_image, write_image
from texbake.texture.image_files import write_heights, write_normals
from texbake.texture.material_images import check_gray

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

    def _write_texture(
        self, pixels: npt.NDArray[np.float32], path: Path, kind: str, blocks: str
    ) -> None:
        threads = self.options.threads
        if path.suffix == ".dds":
            write_dds(pixels, path, block_format=blocks, kind=kind, threads=threads)
        else:
            write_image(pixels, path, color=kind == "color", bits=8, threads=threads)

    def _normals(self, source: SourceMap) -> tuple[npt.NDArray[np.float32], int]:
        """Return the vectors, and the bits per channel that a PNG file needs for them."""
        image = read_image(source.path, color=False, threads=self.options.threads)
        return normal_vectors(image, self.options.convention), 8 if image.bits == 8 else 16

    def _data(self, source: SourceMap) -> npt.NDArray[np.float32]:
        """(H, W) values in [0, 1] of a map of one channel."""
        image = read_image(source.path, color=False, threads=self.options.threads)
        if source.channel is None:
            check_gray(image, source.kind)
        return np.clip(source.of_channel(image).pixels[..., 0], 0.0, 1.0)

    def _texture_suffix(self) -> str:
        return f".{self.options.textures}"

    def _file(self, kind: str, tile: str, suffix: str) -> Path:
        return self.place(self.target.map_stem(self.asset, kind, tile) + suffix)
