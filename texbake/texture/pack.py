"""Pack several images into one, and move the texture coordinates of their meshes along.

Texels are copied one to one if there is room for them, with padding around each image, so that a
lookup in the packed image reads the same texels with the same weights as in the original.

Based on: Huang, Korf, "Optimal rectangle packing: an absolute placement approach", 2013, for trying
several sizes of the bin; Jylänki, "A thousand ways to pack the bin", 2010, for maximal free
rectangles and the best-short-side rule.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texbake.errors import OptionError, UvError, counted, require_library
from texbake.mapping.options.shared import MAX_SIZE
from texbake.mesh.mesh import AnyArray, Float32Array, Mesh
from texbake.records import dataclass
from texbake.texture.options import PackOptions

# Rounding error of float32 files for coordinates on the border of the unit square.
_OUTSIDE = 1e-6

# Bisection steps for the scale of images that do not fit: to within 1 in 4000.
_SCALE_STEPS = 12
_NP_PAD = {"clamp": "edge", "repeat": "wrap"}


@dataclass(frozen=True)
class PlacedImage:
    """Upper left corner and size of a packed image, in texels, without padding."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class PackedTextures:
    """Several images in one."""

    pixels: Float32Array  # (H, W, C) float32: 0 outside the images and their padding
    places: tuple[PlacedImage, ...]  # the place of each image, in the order of the input
    scale: float  # factor by which all images were scaled down; 1 if texels are copied one to one

    @property
    def filled(self) -> float:
        """Share of the texels that images cover, without padding."""
        height, width = self.pixels.shape[:2]
        n_filled = sum(place.width * place.height for place in self.places)
        return n_filled / float(height * width)

    def remapped(self, mesh: Mesh, index: int) -> Mesh:
        """Return a mesh with its uvs, in the unit square, moved to the place of its image."""
        mesh.corner_uvs()  # raises if there are none
        assert mesh.uvs is not None and mesh.uv_faces is not None
        used = np.zeros(len(mesh.uvs), dtype=np.bool_)
        used[mesh.uv_faces.ravel()] = True
        outside = used & (np.abs(mesh.uvs - 0.5) > 0.5 + _OUTSIDE).any(axis=1)
        if outside.any():
            where = ", ".join(f"{value:g}" for value in mesh.uvs[outside.argmax()])
            raise UvError(
                f"{mesh.name}: {int(outside.sum()):,} of its texture coordinates lie outside the "
                f"unit square, such as ({where}); a packed image cannot tile: "
                f"make others with: texbake unwrap {mesh.name} -o OUT"
            )
        place = self.places[index]
        height, width = self.pixels.shape[:2]
        u, v = np.clip(mesh.uvs, 0.0, 1.0).T
        bottom = height - place.top - place.height
        uvs = np.stack(
            [(place.left + u * place.width) / width, (bottom + v * place.height) / height], axis=1
        )
        return mesh.replace(uvs=uvs)


def pack_textures(images: Sequence[AnyArray], options: PackOptions | None = None) -> PackedTextures:
    """Pack several linear images (H, W, C), with 1 to 4 channels each, into one."""
    options = options or PackOptions()
    if not images:
        raise OptionError("images: there is none to pack; give at least one")
    for number, image in enumerate(images, start=1):
        if image.ndim != 3 or image.size == 0 or image.shape[2] > 4:
            raise OptionError(f"image {number}: the shape {image.shape} is not (H, W, 1 to 4)")
    sizes = [(image.shape[1], image.shape[0]) for image in images]
    width, height, scale, corners = _layout(sizes, options)
    n_channels = _n_channels([image.shape[2] for image in images])
    pixels = np.zeros((height, width, n_channels), np.float32)
    pad = options.padding
    places = []
    for image, size, (left, top) in zip(images, sizes, corners, strict=True):
        w, h = _scaled(size, scale)
        texels = resized(_with_channels(image, n_channels), w, h)
        padded = np.pad(texels, ((pad, pad), (pad, pad), (0, 0)), _NP_PAD[options.edges])  # type: ignore[call-overload]
        pixels[top : top + h + 2 * pad, left : left + w + 2 * pad] = padded
        places.append(PlacedImage(left + pad, top + pad, w, h))
    return PackedTextures(pixels, tuple(places), scale)


def _layout(sizes: Sequence[Size], options: PackOptions) -> tuple[int, int, float, Sequence[Size]]:
    """Return width, height, scale and the upper left corners of the images with padding."""
    if options.sides is None:
        for width, height in _bins():
            corners = place_rectangles(_padded_sizes(sizes, 1.0, options.padding), width, height)
            if corners is not None:
                return width, height, 1.0, corners
        width = height = MAX_SIZE
    else:
        width, height = options.sides
    best, scale = None, 0.0
    too_large = 1.0
    corners = place_rectangles(_padded_sizes(sizes, 1.0, options.padding), width, height)
    if corners is not None:
        return width, height, 1.0, corners
    for _ in range(_SCALE_STEPS):
        middle = (scale + too_large) / 2.0
        corners = place_rectangles(_padded_sizes(sizes, middle, options.padding), width, height)
        if corners is None:
            too_large = middle
        else:
            best, scale = corners, middle
    if best is None:
        raise OptionError(
            f"size: {width} x {height} has no room for {counted(len(sizes), 'image')} "
            f"with a padding of {counted(options.padding, 'texel')}; use a larger size or less "
            "padding"
        )
    return width, height, scale, best


def _bins() -> list[Size]:
    """Return bin sizes by area: powers of two, of which one is at most twice the other."""
    powers = [1 << i for i in range(MAX_SIZE.bit_length())]
    pairs = [(a, b) for a in powers for b in powers if a <= 2 * b and b <= 2 * a]
    return sorted(pairs, key=lambda pair: (pair[0] * pair[1], pair[1]))


def _scaled(size: Size, scale: float) -> Size:
    return max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)


def _padded_sizes(sizes: Sequence[Size], scale: float, padding: int) -> list[Size]:
    return [(w + 2 * padding, h + 2 * padding) for w, h in (_scaled(size, scale) for size in sizes)]


def _n_channels(counts: Sequence[int]) -> int:
    """Return the number of channels that fits all images: gray or RGB, with or without alpha."""
    colors = 3 if max(counts) > 2 else 1
    return colors + int(any(count in (2, 4) for count in counts))


def _with_channels(image: AnyArray, n_channels: int) -> Float32Array:
    n_colors = 3 if n_channels > 2 else 1
    own_colors = 1 if image.shape[2] < 3 else 3
    full = np.ones((*image.shape[:2], n_channels), np.float32)
    full[..., :n_colors] = image[..., :own_colors]
    if image.shape[2] > own_colors:
        full[..., n_colors] = image[..., own_colors]
    return full


def resized(image: Float32Array, width: int, height: int) -> Float32Array:
    """Scale an image with a triangle filter, which never rings."""
    if image.shape[:2] == (height, width):
        return image
    oiio = require_library("OpenImageIO", "resizing images")

    source = oiio.ImageBuf(np.ascontiguousarray(image))
    roi = oiio.ROI(0, width, 0, height, 0, 1, 0, image.shape[2])
    if height >= image.shape[0] and width >= image.shape[1]:
        made = oiio.ImageBufAlgo.resample(source, interpolate=True, roi=roi)  # the same, faster
    else:
        made = oiio.ImageBufAlgo.resize(source, filtername="triangle", roi=roi)
    return np.asarray(made.get_pixels(oiio.FLOAT), np.float32).reshape(height, width, -1)


Size = tuple[int, int]

# Left, top, right and bottom.
_Free = tuple[int, int, int, int]


def place_rectangles(sizes: Sequence[Size], width: int, height: int) -> list[Size] | None:
    """(left, top) of rectangles in a bin, large ones first, by best fit; None if one is left."""
    if sum(w * h for w, h in sizes) > width * height:
        return None
    keys = (
        lambda i: (-max(sizes[i]), -min(sizes[i]), i),
        lambda i: (-sizes[i][1], -sizes[i][0], i),
        lambda i: (-sizes[i][0], -sizes[i][1], i),
        lambda i: (-sizes[i][0] * sizes[i][1], i),
    )
    for key in keys:
        places = _placed_in_order(sizes, sorted(range(len(sizes)), key=key), width, height)
        if places is not None:
            return places
    return None


def _placed_in_order(
    sizes: Sequence[Size], order: Sequence[int], width: int, height: int
) -> list[Size] | None:
    free: list[_Free] = [(0, 0, width, height)]
    places: list[Size] = [(0, 0)] * len(sizes)
    for i in order:
        w, h = sizes[i]
        fits = [
            (min(right - left - w, bottom - top - h), top, left)
            for left, top, right, bottom in free
            if right - left >= w and bottom - top >= h
        ]
        if not fits:
            return None
        _, top, left = min(fits)
        places[i] = left, top
        free = _without(free, (left, top, left + w, top + h))
    return places


def _without(free: list[_Free], taken: _Free) -> list[_Free]:
    """Return the maximal free rectangles that remain when one is taken."""
    left, top, right, bottom = taken
    rest: list[_Free] = []
    for one in free:
        if left >= one[2] or right <= one[0] or top >= one[3] or bottom <= one[1]:
            rest.append(one)
            continue
        parts = (
            (one[0], one[1], left, one[3]),
            (right, one[1], one[2], one[3]),
            (one[0], one[1], one[2], top),
            (one[0], bottom, one[2], one[3]),
        )
        rest += [part for part in parts if part[0] < part[2] and part[1] < part[3]]
    rest = list(dict.fromkeys(rest))
    return [one for one in rest if not any(_holds(other, one) for other in rest if other != one)]


def _holds(outer: _Free, inner: _Free) -> bool:
    return (
        outer[0] <= inner[0]
        and outer[1] <= inner[1]
        and outer[2] >= inner[2]
        and outer[3] >= inner[3]
    )
