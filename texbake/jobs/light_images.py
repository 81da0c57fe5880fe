"""Images of a lightened model, each encoded at a side and a quality of its own.

Without a quality, an image gets the lowest one that leaves 40 dB in its colors and in its alpha
each, and a file that is smaller than the new one stays as it is. A color counts by its alpha in
images whose alpha is that of every material that shows them. A normal map gets the lowest quality
that hardly turns its normals: reflections turn twice as far. WebP halves the resolution of chroma,
in which normals have as much detail as in luma; JPEG in 4:4:4 follows where that is too coarse. An
image is lossless where that takes fewer bytes, or not many more and no quality is close to it.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import field, replace
from functools import cache
from pathlib import Path

import numpy as np

from texbake.core import core
from texbake.errors import require_library
from texbake.mesh.files.conversion import media_type
from texbake.mesh.materials import CHANNELS, ChannelImage, Materials
from texbake.mesh.mesh import ByteArray, Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.compare_models import psnr_db
from texbake.texture.encoding import decode_srgb, quantize_srgb, quantize_unsigned
from texbake.texture.image_files import ENCODINGS, encode_image, encoding_of, lossless_webp
from texbake.texture.material_images import image_codes
from texbake.texture.mipmaps import averaged
from texbake.texture.pack import resized

LEAST_DB = 40.0
# So far from it, the next quality that the search would try is on the same side: no image of the
# tests changed by more between neighbors of the search.
_SURE_DB = 5.0
_QUALITIES = (30, 45, 60, 70, 80, 85, 90)
_JPEG_QUALITIES = (85, 90, 93, 95, 97, 98)  # of normal maps, in 4:4:4
# The cosine of 1.5 degrees, and squares of 4 x 4 texels whose mean normal may turn farther, as a
# share of all: renderers show no single texels, but means of four or more. Shorter means have no
# direction.
_LEAST_COSINE, _MOST_TURNED, _LEAST_LENGTH = 0.999657, 0.01, 0.5
_BAND = 64  # rows
# Bytes of a lossless image over those of the highest quality if that is not close; photographs
# take more.
_MOST_OF_LOSSY = 2.5
# Media types that programs read where they read the encoding.
_READ_WITH = {
    "webp": ("image/webp", "image/jpeg", "image/png"),
    "jpeg": ("image/jpeg", "image/png"),
    "png": ("image/jpeg", "image/png"),
}


@dataclass(frozen=True, eq=False)
class Picture:
    """An image of a model before it is encoded."""

    name: str  # as in `ChannelImage`
    codes: ByteArray  # (H, W, 3 or 4)
    is_color: bool  # whether red, green and blue are coded in sRGB
    file: bytes = field(default=b"", repr=False)  # that it comes from, if it comes from one
    is_cut: bool = False  # whether alpha hides colors wherever the image is shown
    is_normal: bool = False  # whether red, green and blue are the components of normals
    _smaller: dict[int, ByteArray] = field(default_factory=dict, repr=False)

    @property
    def side(self) -> int:
        """The longer side in pixels."""
        return int(max(self.codes.shape[:2]))

    def at_side(self, side: int) -> ByteArray:
        """Return the codes with a longer side of at most `side` pixels."""
        if side >= self.side:
            return self.codes
        if side not in self._smaller:
            height, width = (max(1, n * side // self.side) for n in self.codes.shape[:2])
            values = self.codes.astype(np.float32) / np.float32(255.0)
            if self.is_color:
                values[..., :3] = _linear_values()[self.codes[..., :3]]
                small = quantize_srgb(averaged(values, width, height, threads=1), 8, n_colors=3)
            else:
                small = quantize_unsigned(averaged(values, width, height, threads=1), 8)
            self._smaller[side] = np.asarray(small, np.uint8)
        return self._smaller[side]


@cache
def _linear_values() -> Float32Array:
    """(256,) linear values of sRGB codes."""
    return decode_srgb(np.arange(256, dtype=np.float32) / np.float32(255.0)).astype(np.float32)


def squared_errors(one: ByteArray, other: ByteArray, *, is_cut: bool) -> tuple[float, float]:
    """Mean squared differences of colors, by the alpha of `other` if it `is_cut`, and of alpha.

    A smaller picture `one` is enlarged. Kernel: `core/code_errors.c`.
    """
    height, width, n_channels = other.shape
    one, other = np.ascontiguousarray(one), np.ascontiguousarray(other)
    sums, unit = np.zeros(2, np.int64), 1
    if one.shape[:2] == (height, width):
        rows = (each.reshape(-1, n_channels) for each in (one, other))
        core.sum_code_errors(*rows, is_cut, sums)
    elif (2 * one.shape[0], 2 * one.shape[1]) == (height, width):
        core.sum_enlarged_errors(one, other, is_cut, sums)
        unit = 16 * 16
    else:
        made = resized(one.astype(np.float32), width, height)
        return squared_errors(quantize_unsigned(made / 255.0, 8), other, is_cut=is_cut)
    weight = 3 * (int(other[..., 3].sum(dtype=np.int64)) if is_cut else height * width)
    return float(sums[0]) / unit / (weight or 1), float(sums[1]) / unit / (height * width)


def psnr(one: ByteArray, other: ByteArray, *, is_cut: bool = False) -> float:
    """PSNR of 8-bit codes in dB, of colors or of alpha, whichever is less; infinite for equal."""
    return psnr_db(max(squared_errors(one, other, is_cut=is_cut)), 1)


def decoded(data: bytes, n_components: int) -> ByteArray:
    """(H, W, n) codes of an image file that `encode_image` wrote."""
    image = require_library("PIL.Image", "images")
    with image.open(io.BytesIO(data)) as opened:
        return np.asarray(opened.convert("RGBA" if n_components == 4 else "RGB"), np.uint8)


def turned_share(one: ByteArray, other: ByteArray) -> float:
    """Share of squares of 4 x 4 texels whose mean normal differs by over 1.5 degrees."""
    squares = [0, 0]
    for start in range(0, len(other), _BAND):
        a, b = (_of_squares(each[start : start + _BAND, :, :3]) for each in (one, other))
        dots, lengths_a, lengths_b = ((x * y).sum(axis=-1) for x, y in ((a, b), (a, a), (b, b)))
        has_direction = lengths_b >= (16 * _LEAST_LENGTH * 255) ** 2
        is_turned = dots < _LEAST_COSINE * np.sqrt(lengths_a.astype(np.float64) * lengths_b)
        squares[0] += dots.size
        squares[1] += int((has_direction & is_turned).sum())
    return squares[1] / squares[0]


def _of_squares(codes: ByteArray) -> IntArray:
    """(h / 4, w / 4, 3) sums of the normals in squares of 4 x 4 texels."""
    values = 2 * codes.astype(np.int32) - 255
    for axis in (0, 1):
        values = np.add.reduceat(values, range(0, values.shape[axis], 4), axis=axis)
    return values


def coded(picture: Picture, encoding: str, *, quality: int | None, side: int) -> bytes:
    """Bytes of a picture at a side; of the lowest quality that is close to it if there is none."""
    codes = picture.at_side(side)
    if quality is not None or encoding_of(codes, encoding) == "png":
        data = smaller_file(
            codes, encoding, quality=quality or _QUALITIES[-1], is_color=picture.is_color
        )
    else:
        data = _of_least_quality(picture, codes, encoding)
    is_kept = side >= picture.side and media_type(picture.file) in _READ_WITH[encoding]
    return picture.file if is_kept and len(picture.file) <= len(data) else data


def smaller_file(
    codes: ByteArray, encoding: str, *, quality: int, is_color: bool, most: float = 1.0
) -> bytes:
    """Bytes of an image file of a quality; of a lossless one with less than `most` times those."""
    data = encode_image(codes, encoding, quality=quality, is_color=is_color)
    return _lossless_or(data, codes, encoding, most)


def _of_least_quality(picture: Picture, codes: ByteArray, encoding: str) -> bytes:
    qualities = (*_QUALITIES, *(_JPEG_QUALITIES if picture.is_normal else ()))
    first, last = 0, len(qualities) - 1
    found: dict[int, bytes] = {}

    def encode(i: int) -> bytes:
        form = "jpeg" if i >= len(_QUALITIES) else encoding
        return encode_image(codes, form, quality=qualities[i], is_color=picture.is_color)

    while first < last:
        middle = (first + last) // 2
        found[middle] = encode(middle)
        surplus = _surplus(picture, codes, found[middle])
        if surplus >= 0.0:
            last = middle if surplus < _SURE_DB else (first + middle) // 2
        else:
            first = middle + 1 if surplus >= -_SURE_DB else last
    data = found[last] if last in found else encode(last)
    is_close = last < len(qualities) - 1 or _surplus(picture, codes, data) >= 0.0
    return _lossless_or(data, codes, encoding, 1.0 if is_close else _MOST_OF_LOSSY)


def _surplus(picture: Picture, codes: ByteArray, data: bytes) -> float:
    """Surplus in dB of the file of a picture; of a normal map, only its sign counts."""
    made = decoded(data, codes.shape[2])
    if picture.is_normal and turned_share(made, codes) > _MOST_TURNED:
        return -1.0
    if picture.is_normal:
        return 0.0
    return psnr(made, codes, is_cut=picture.is_cut) - LEAST_DB


def _lossless_or(data: bytes, codes: ByteArray, encoding: str, most: float) -> bytes:
    """Return a lossless WebP file with less than `most` times the bytes of another, or that."""
    lossless = lossless_webp(codes, int(most * len(data))) if encoding == "webp" else None
    return data if lossless is None else lossless


def pictures_of(
    materials: Materials, known: dict[Hashable, Picture], *, threads: int | None = None
) -> tuple[Picture, ...]:
    """Return the images of materials, arranged as glTF reads them, each once, and keep them."""
    found: dict[str, Picture] = {}
    cut = _cut_images(materials)
    for material in materials.materials:
        shown = [(name, source.image) for name, source in material.channels.items()]
        for properties in material.extensions.values():
            shown += properties.items()
        for channel, image in shown:
            if not isinstance(image, ChannelImage) or image.name in found:
                continue
            kind = CHANNELS.get(channel)
            is_color = "Color" in channel if kind is None else kind.is_color
            is_color = is_color or channel == "alpha"
            key = image.name, image.data, is_color, channel == "normal", image.name in cut
            if key in known:
                found[image.name] = known[key]
                continue
            pixels, _ = image_codes(image, is_color=is_color, threads=threads)
            codes = quantize_unsigned(_with_colors(pixels), 8, threads=threads)
            found[image.name] = known[key] = Picture(
                image.name,
                np.asarray(codes, np.uint8),
                is_color,
                image.data,
                is_normal=channel == "normal",
                is_cut=image.name in cut and codes.shape[2] == 4,
            )
    return tuple(found.values())


def _cut_images(materials: Materials) -> set[str]:
    """Names of images whose alpha is that of every material that shows them."""
    cut: set[str] = set()
    shown: set[str] = set()
    for material in materials.materials:
        names = {image.name for image in material.images}
        alpha = material.channels.get("alpha")
        own = alpha.image if alpha is not None and material.alpha_mode != "opaque" else None
        cut |= {own.name} if own else set()
        shown |= names - ({own.name} if own else set())
    return cut - shown


def _with_colors(pixels: Float32Array) -> Float32Array:
    """(H, W, 3 or 4): the pixels of a gray image in all colors; alpha only where any is not 1."""
    n = pixels.shape[2]
    if n < 3:
        alpha = pixels[..., 1:]
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=2), alpha], axis=2)
    return pixels[..., :3] if pixels.shape[2] == 4 and pixels[..., 3].min() == 1.0 else pixels


def coded_pictures(
    pictures: Iterable[Picture], code: Callable[[Picture], bytes], *, threads: int | None = None
) -> dict[str, bytes]:
    """Code pictures, several at a time; return the files by the names of the images."""
    pictures = list(pictures)
    files = [b""] * len(pictures)

    def work(start: int, stop: int) -> None:
        for i in range(start, stop):
            files[i] = code(pictures[i])

    run_bands(work, len(pictures), band=1, threads=threads)
    return {picture.name: data for picture, data in zip(pictures, files, strict=True)}


def with_files(materials: Materials, files: Mapping[str, bytes]) -> Materials:
    """Return materials whose images have other files, by the names of the images."""
    names: dict[str, str] = {}
    for old, data in files.items():
        path = Path(old)
        stem = path.stem if path.suffix in _KNOWN else old
        suffix = _SUFFIXES.get(media_type(data), "")
        name, n = f"{stem}{suffix}", 1
        while name in names.values():
            n += 1
            name = f"{stem}_{n}{suffix}"
        names[old] = name

    def changed(image: ChannelImage) -> ChannelImage:
        if image.name not in files:
            return image
        return replace(image, data=files[image.name], name=names[image.name])

    items = []
    for material in materials.materials:
        channels = {
            name: replace(source, image=changed(source.image)) if source.image else source
            for name, source in material.channels.items()
        }
        extensions = {
            name: {
                key: changed(value) if isinstance(value, ChannelImage) else value
                for key, value in properties.items()
            }
            for name, properties in material.extensions.items()
        }
        items.append(replace(material, channels=channels, extensions=extensions))
    return replace(materials, materials=tuple(items))


_SUFFIXES: dict[str | None, str] = {
    "image/webp": ".webp", "image/jpeg": ".jpg", "image/png": ".png",
}  # fmt: skip
_KNOWN = (*ENCODINGS.values(), ".jpeg")
