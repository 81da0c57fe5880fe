"""What a bake returns: maps as values, which are encoded when written, the hits, and the report."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.codings import FLOAT, EncodedMap, encode_map, file_bits
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.report import BakeReport
from texbake.errors import OptionError, UvError
from texbake.files import PathLike, make_folder
from texbake.mapping.corner_uvs import surface_areas
from texbake.mesh.mesh import (
    AnyArray,
    BoolArray,
    ByteArray,
    Float32Array,
    FloatArray,
    IntArray,
    Mesh,
)
from texbake.metadata import Value
from texbake.records import dataclass
from texbake.texture.encoding import channel_ranges
from texbake.texture.image import Image, image_as_read, read_image, write_image
from texbake.texture.image_formats import holds_floats
from texbake.texture.png_files import picture_png

# Colors of texels that are not covered, that have data, and that lack it.
_CLASS_COLORS = np.array([[24, 24, 28], [70, 110, 70], [255, 40, 60]], dtype=np.uint8)

# Share of a mesh's area; less than this is in slivers, which nobody sees.
MOST_WITHOUT_TEXEL = 0.01


@dataclass(frozen=True)
class WrittenMap:
    """What `BakedMap.write` wrote."""

    path: Path
    bits: int  # bits per channel
    # metadata of the file: space, convention, mid level and scale, names of ids
    metadata: dict[str, Value] = field(default_factory=dict)
    # values out of range of the given mid level and scale; 0 if these were measured
    n_clipped: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class BakedMap:
    """A map of a bake: its values, encoded when written; for `np.asarray` and notebooks as well."""

    kind: MapKind
    # (H, W, C) float32: unit vectors, lengths in model units, colors or ids, depending on the kind;
    # the neutral value where nothing was baked
    values: Float32Array
    # (H, W) bool: texels with a hit; the range of heights is measured over them
    has_data: BoolArray
    # gives the space, and the convention, bits, mid and scale that are not given to `write`
    options: BakeOptions
    # (2, 3) float64: for positions: the least and the greatest that integer files can hold
    bounds: FloatArray | None = None
    legend: tuple[str, ...] = ()  # for ids: the names of ids 1, 2, 3 and so on

    def __repr__(self) -> str:
        height, width = self.has_data.shape
        return f"<BakedMap {self.kind.name}: {width} x {height}, {self.has_data.mean():.0%} filled>"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> AnyArray:
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)

    def _repr_png_(self) -> bytes:
        is_id = self.kind.coding == "id"
        is_color = is_id or self.kind.coding == "color"
        return picture_png(encode_map(self, 8).pixels, is_color=is_color, is_averaged=not is_id)

    def write(
        self,
        path: PathLike,
        *,
        bits: int | None = None,
        convention: str | None = None,
        mid: float | None = None,
        scale: float | None = None,
    ) -> WrittenMap:
        """Write the map in the format of the file's suffix."""
        changes: dict[str, Any] = {
            "bits": bits,
            "convention": convention,
            "mid": mid,
            "scale": scale,
        }
        changes = {name: value for name, value in changes.items() if value is not None}
        bits, coded, rest = replace(self, options=replace(self.options, **changes))._coded(path)
        write_image(coded.pixels, path, **rest)
        return WrittenMap(Path(path), bits, coded.metadata, coded.n_clipped)

    def as_read(self, path: PathLike) -> Image:
        """Return what `read_image` reads, as data, from the file that `write` writes."""
        _, coded, rest = self._coded(path)
        return image_as_read(coded.pixels, path, **rest)

    def _coded(self, path: PathLike) -> tuple[int, EncodedMap, dict[str, Any]]:
        """Return the map encoded for a file, with its bits, and other arguments to write it."""
        bits = file_bits(self.kind, path, self.options.bits, len(self.legend))
        coded = encode_map(self, FLOAT if holds_floats(path, bits) else bits)
        rest = {
            "color": self.kind.coding == "color",
            "bits": bits,
            "metadata": coded.metadata,
            "threads": self.options.threads,
        }
        return bits, coded, rest


@dataclass(frozen=True, eq=False, repr=False)
class BakeResult:
    """Everything that `bake` returns; a notebook shows its maps."""

    maps: dict[str, BakedMap]  # by the names in `BakeOptions.maps`
    report: BakeReport
    # if the bake ran with `BakeOptions.keep_hits`; `remap` makes other maps from them
    hits: Hits | None
    # (H, W) int32: face of the low-poly mesh that owns each texel, -1 for none
    texel_faces: IntArray
    has_data: BoolArray  # (H, W) bool: texels with a hit
    inputs: BakeInputs | None = None  # the meshes and options, if the hits were kept

    def __repr__(self) -> str:
        height, width = self.has_data.shape
        n_missed = int(np.count_nonzero(self.missed))
        return f"<BakeResult {', '.join(self.maps)}: {width} x {height}, {n_missed:,} missed>"

    def _repr_html_(self) -> str:
        figures = (
            f'<figure style="margin: 0; max-width: 320px"><img style="width: 100%" alt="{name}" '
            f'src="data:image/png;base64,{b64encode(baked._repr_png_()).decode()}">'
            f"<figcaption>{name}</figcaption></figure>"
            for name, baked in self.maps.items()
        )
        return f'<div style="display: flex; flex-wrap: wrap; gap: 8px">{"".join(figures)}</div>'

    @cached_property
    def missed(self) -> BoolArray:
        """(H, W) bool: texels that the low-poly mesh covers and whose rays all missed."""
        return (self.texel_faces >= 0) & ~self.has_data

    def miss_map(self) -> ByteArray:
        """(H, W, 3) uint8 image: gray outside the charts, green for hits, red for misses."""
        return classes_picture(self.texel_faces, self.missed)

    def write(self, path: PathLike, *, suffix: str = ".png") -> list[Path]:
        """Write one map to a file, or all maps into a folder as NAME + suffix."""
        target = Path(path)
        if target.suffix and not target.is_dir():
            if len(self.maps) != 1:
                raise OptionError(
                    f"{path}: one file cannot hold {len(self.maps)} maps; give a folder instead"
                )
            paths = [target]
        else:
            make_folder(target)
            paths = [target / f"{name}{suffix}" for name in self.maps]
        for map_path, baked in zip(paths, self.maps.values(), strict=True):
            baked.write(map_path)
        return paths


def classes_picture(texel_faces: IntArray, without_data: BoolArray) -> ByteArray:
    """(H, W, 3) uint8: gray outside the charts, green inside, red without data."""
    return _CLASS_COLORS[(texel_faces >= 0).astype(np.intp) + without_data]


def read_misses(path: PathLike) -> BoolArray:
    """Read a miss map; return an (H, W) array that is true where rays missed."""
    # Only the color of misses has much red.
    return np.asarray(read_image(path, color=False).pixels[..., 0] > 0.5, dtype=np.bool_)


def unseen_faces(n_faces: int, texel_faces: IntArray) -> BoolArray:
    """(F,) bool: faces that own no texel, from the face of each texel (H, W), -1 for none."""
    seen = np.zeros(n_faces + 1, dtype=np.bool_)
    texels = texel_faces.ravel()
    seen[texels[:1]] = True  # -1 marks the last entry, which is dropped
    seen[texels[1:][texels[1:] != texels[:-1]]] = True
    return ~seen[:-1]


def check_texels(low: Mesh, baked: BakeResult) -> None:
    """Raise an error if faces with more than a hundredth of a mesh's area own no texel."""
    areas = surface_areas(low.positions[low.faces])
    unseen = unseen_faces(low.n_faces, baked.texel_faces)
    share = float(areas[unseen].sum()) / (float(areas.sum()) or 1.0)
    if share > MOST_WITHOUT_TEXEL:
        options = baked.report.options
        less = " or less `padding`" if options.padding > 1 else ""
        raise UvError(
            f"{low.name}: {int(unseen.sum()):,} of {low.n_faces:,} faces, {100.0 * share:.1f} % of "
            f"the area, own no texel at {options.width_px} x {options.height_px} with a padding of "
            f"{options.padding}; use a larger `size`{less}"
        )


# Half a step of a 16-bit code: about the precision of normals and shares.
_ROUNDING = 0.5 / 65535.0


def redundant_maps(maps: Mapping[str, BakedMap], size: float) -> Iterator[str]:
    """Yield a sentence for each map that changes nothing or could be a factor."""
    for name, item in maps.items():
        ranges = channel_ranges(item.values, item.has_data, threads=item.options.threads)
        if not np.isfinite(ranges).all():  # no texel has data
            continue
        rounding = size * _ROUNDING if item.kind.coding in ("height", "vector") else _ROUNDING
        is_constant = float((ranges[:, 1] - ranges[:, 0]).max()) <= _ROUNDING
        plain = item.kind.plain
        if item.kind.coding == "normal" and item.options.space != "tangent":
            plain = None
        if plain is not None and float(np.abs(ranges.T - plain).max()) <= rounding:
            yield f"{name}: it has no effect at any texel; it can be left out"
        elif item.kind.coding in ("color", "mask") and plain is None and is_constant:
            first = np.unravel_index(int(item.has_data.argmax()), item.has_data.shape)
            shown = ", ".join(f"{value:.4g}" for value in item.values[first])
            yield f"{name}: every texel is {shown}; a factor of the material says the same"
