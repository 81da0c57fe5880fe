"""Compute the mip levels of an image, down to one texel, and write them.

Each level has half the width and height of the one above it, rounded down. If those are odd, a
texel shares texels of the level above with its neighbors, with weights that vary over the image, so
that every level has the mean of the image.

Values must be linear; sRGB values would give levels that are too dark.

Based on: Williams, "Pyramidal Parametrics", 1983; Guthe and Heckbert, "Non-Power-of-Two Mipmap
Creation", NVIDIA, 2005, for the box filter of odd sizes; Toksvig, "Mipmapping Normal Maps", 2005,
for the length of the mean normal. The Kaiser window is the one of NVIDIA Texture Tools: six lobes
of the sinc and a parameter of 4; Banerjee et al., "Clustering on the Unit Hypersphere using von
Mises-Fisher Distributions", 2005, for the spread of directions from the length of their mean.
Kernel: `core/mip_levels.c`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, require_known
from texbake.files import PathLike, check_folder, check_writable, is_folder
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Int64Array
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.encoding import decode_normals, encode_normals, unit_normals
from texbake.texture.image import Image, read_image
from texbake.texture.image_files import bits_for, suffix_like, write_images
from texbake.texture.image_formats import check_image_format, holds_floats
from texbake.texture.lookup import MIRROR, REPEAT, Wrap, require_image, wrap_code, wrap_pair
from texbake.texture.options import MipOptions

KINDS = ("color", "data", "normal")
MIP_FILTERS = ("box", "kaiser")
_KAISER_RADIUS = 3.0  # texels of the smaller level
_KAISER_ALPHA = 4.0

# Values per band: a few milliseconds of work.
_BAND_VALUES = 1 << 20


@dataclass(frozen=True, eq=False)
class MipChain:
    """An image and its mip levels, finest first."""

    # (N, C) float32: all levels one after another, rows from top to bottom. Read-only.
    texels: Float32Array
    offsets: Int64Array  # (L,) int64: index of the first texel of each level
    sizes: Int64Array  # (L, 2) int64: height and width of each level

    def __post_init__(self) -> None:
        for name in "texels", "offsets", "sizes":
            array = getattr(self, name).view()
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def n_levels(self) -> int:
        """Number of levels."""
        return len(self.offsets)

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return int(self.texels.shape[1])

    @property
    def width(self) -> int:
        """Width of the finest level in texels."""
        return int(self.sizes[0, 1])

    @property
    def height(self) -> int:
        """Height of the finest level in texels."""
        return int(self.sizes[0, 0])

    def level(self, index: int) -> Float32Array:
        """Return the (H, W, C) values of one level, a view of the chain's memory."""
        height, width = (int(size) for size in self.sizes[index])
        first = int(self.offsets[index])
        return self.texels[first : first + height * width].reshape(height, width, -1)


def single_level(image: AnyArray) -> MipChain:
    """Chain of one level; it shares the memory of a contiguous (H, W, C) float32 image."""
    image = require_image(image)
    height, width, n_channels = image.shape
    return MipChain(
        image.reshape(-1, n_channels), np.zeros(1, np.int64), np.array([[height, width]], np.int64)
    )


def mip_chain(
    image: AnyArray,
    *,
    kind: str = "color",
    wrap: Wrap = "repeat",
    filter: str = "box",  # noqa: A002  # what the field calls it
    roughness: bool = False,
    threads: int | None = None,
) -> MipChain:
    """Mip levels of a linear image (H, W, C) down to 1 x 1; of kind color, data or normal."""
    image = require_image(image)
    along_u, along_v = map(wrap_code, wrap_pair(wrap))
    require_known("kind", kind, KINDS)
    require_known("filter", filter, MIP_FILTERS)
    if roughness and kind != "normal":
        raise OptionError(f"roughness: only normal maps have it, not {kind}; give kind='normal'")
    if kind == "normal":
        image = _unit_vectors(image, threads)
    sizes = _level_sizes(*image.shape[:2])
    ends = np.cumsum(sizes.prod(axis=1))
    n_channels = image.shape[2]
    texels = np.empty((int(ends[-1]), n_channels + roughness), np.float32)
    texels[: ends[0], :n_channels] = image.reshape(-1, n_channels)
    if roughness:
        texels[: ends[0], n_channels] = pm.norm(texels[: ends[0], :n_channels], axis=1)
    chain = MipChain(texels, ends - sizes.prod(axis=1), sizes)
    for index in range(1, len(sizes)):
        smaller = texels[ends[index - 1] : ends[index]]
        _reduce(
            chain.level(index - 1),
            smaller.reshape(*sizes[index], -1),
            filter,
            (along_u, along_v),
            threads,
        )
        if roughness:
            # The length of the mean vector, not the mean of the lengths.
            smaller[:, n_channels] = pm.norm(smaller[:, :n_channels], axis=1)
    return chain


def _unit_vectors(image: Float32Array, threads: int | None) -> Float32Array:
    if image.shape[2] != 3:
        raise OptionError(f"image: {image.shape[2]} channels are not a normal map; give 3")
    flat = np.ascontiguousarray(image).reshape(-1, 3)
    vectors = np.empty_like(flat)
    work = partial(core.normalize_vectors, flat, vectors)
    run_bands(work, len(flat), band=_BAND_VALUES // 3, threads=threads)
    return vectors.reshape(image.shape)


def _level_sizes(height: int, width: int) -> Int64Array:
    n_levels = max(height, width).bit_length()
    return np.array(
        [[max(height >> level, 1), max(width >> level, 1)] for level in range(n_levels)], np.int64
    )


def _taps(
    size: int,
    smaller: int,
    filter: str,  # noqa: A002
    wrap: int,
) -> tuple[Int64Array, Float32Array]:
    """(smaller, T) texels that each texel of a smaller level averages on an axis, and weights."""
    places = np.arange(smaller)[:, None]
    if filter == "box" or size == smaller:
        # Texel i covers [i size, (i + 1) size), in units of 1 / smaller of a texel of the larger
        # level.
        indices = places * size // smaller + np.arange(-(-size // smaller) + 1)
        covered = np.minimum((indices + 1) * smaller, (places + 1) * size)
        covered -= np.maximum(indices * smaller, places * size)
        weights = np.maximum(covered, 0) / size
        kept = weights.any(axis=0)
        return _packed(np.minimum(indices, size - 1)[:, kept], weights[:, kept])
    ratio = size / smaller
    centers = (places + 0.5) * ratio - 0.5
    reach = int(np.ceil(_KAISER_RADIUS * ratio))
    steps = np.arange(-reach, reach + 1)
    indices = np.floor(centers).astype(np.int64) + steps[np.argsort(abs(steps), kind="stable")]
    offsets = (indices - centers) / ratio
    inside = np.maximum(1.0 - (offsets / _KAISER_RADIUS) ** 2, 0.0)
    weights = _sinc(offsets) * _bessel_i0(_KAISER_ALPHA * np.sqrt(inside)) * (inside > 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    return _packed(_wrapped_indices(indices, size, wrap), weights)


def _sinc(x: FloatArray) -> FloatArray:
    """sin(pi x) / (pi x), 1 at 0."""
    turns = np.pi * np.where(x == 0.0, 1e-20, x)
    return np.asarray(pm.sin(turns) / turns)


def _bessel_i0(x: FloatArray) -> FloatArray:
    """Modified Bessel function of order 0, by its power series; exact to rounding up to x = 10."""
    term = total = np.ones_like(x)
    for k in range(1, 32):
        term = term * np.square(0.5 * x / k)
        total = total + term
    return total


def _packed(indices: Int64Array, weights: FloatArray) -> tuple[Int64Array, Float32Array]:
    return np.ascontiguousarray(indices), np.ascontiguousarray(weights, np.float32)


def _wrapped_indices(indices: Int64Array, size: int, wrap: int) -> Int64Array:
    if wrap == REPEAT:
        return indices % size
    if wrap == MIRROR:
        turned = indices % (2 * size)
        return np.minimum(turned, 2 * size - 1 - turned)
    return np.clip(indices, 0, size - 1)


def averaged(
    image: Float32Array, width: int, height: int, *, threads: int | None = None
) -> Float32Array:
    """Scale an image (H, W, C) down: each texel is the mean of what it covers."""
    out = np.empty((height, width, image.shape[2]), np.float32)
    _reduce(image, out, "box", (0, 0), threads)
    return out


def _reduce(
    level: Float32Array,
    out: Float32Array,
    filter: str,  # noqa: A002
    wraps: tuple[int, int],
    threads: int | None,
) -> None:
    """Fill `out` (h, w, C), the next smaller level of `level` (H, W, C)."""
    height, width, n_channels = level.shape
    values = level.reshape(height, width * n_channels)
    rows, row_weights = _taps(height, out.shape[0], filter, wraps[1])
    columns, column_weights = _taps(width, out.shape[1], filter, wraps[0])
    work = partial(core.fill_mip_level, values, rows, row_weights, columns, column_weights, out)
    run_bands(work, out.shape[0], band=max(1, _BAND_VALUES // values.shape[1]), threads=threads)


def levels_picture(levels: Sequence[AnyArray]) -> AnyArray:
    """Mip levels (H, W, C) in one picture: the finest on the left, the others on its right."""
    first, *others = levels
    height = max(first.shape[0], sum(level.shape[0] for level in others))
    width = first.shape[1] + max((level.shape[1] for level in others), default=0)
    picture = np.zeros((height, width, first.shape[2]), first.dtype)
    picture[: first.shape[0], : first.shape[1]] = first
    top = 0
    for level in others:
        bottom, right = top + level.shape[0], first.shape[1] + level.shape[1]
        picture[top:bottom, first.shape[1] : right] = level
        top = bottom
    return picture


def roughness_of_lengths(lengths: AnyArray) -> Float32Array:
    """Roughness (...) of a surface from the lengths of its averaged unit normals."""
    r = np.clip(np.asarray(lengths, np.float64), 0.0, 1.0)
    # 2 / kappa, which is unbounded at r = 0.
    alpha_squared = 2 * (1 - r**2) / np.maximum(3 * r - r**3, np.finfo(np.float64).tiny)
    roughness: FloatArray = np.sqrt(np.sqrt(np.minimum(alpha_squared, 1.0)))
    return roughness.astype(np.float32)


def write_mip_levels(
    source: PathLike,
    output: PathLike,
    options: MipOptions | None = None,
    *,
    roughness: PathLike | None = None,
    threads: int | None = None,
) -> tuple[Path, ...]:
    """Write all mip levels of an image, down to one texel."""
    options = options or MipOptions()
    source, targets = Path(source), [Path(output)] + ([Path(roughness)] if roughness else [])
    normals = options.kind == "normal"
    if roughness is not None and not normals:
        raise OptionError(f"roughness: only normals have one, and kind is {options.kind}")
    for target in targets:
        _check_target(target)
    color = options.kind == "color"
    image = read_image(source, color=color, threads=threads)
    if normals and image.pixels.shape[2] < 3:
        raise OptionError(f"kind: {source} has no three channels and so no normals; use data")
    chain = mip_chain(
        decode_normals(image.pixels) if normals else image.pixels,
        kind=options.kind,
        wrap=options.wrap,
        filter=options.filter,
        roughness=roughness is not None,
        threads=threads,
    )
    levels = [chain.level(index) for index in range(chain.n_levels)]
    images, bits = _images(levels, targets[0], source.stem, image, encoded=normals)
    write_images(images, color=color, bits=bits, threads=threads)
    written = list(images)
    if roughness is not None:
        rough = [roughness_of_lengths(level[..., 3:]) for level in levels]
        images, bits = _images(rough, targets[1], f"{source.stem}_roughness", image)
        write_images(images, color=False, bits=bits, threads=threads)
        written += images
    return tuple(written)


def _check_target(target: Path) -> None:
    if _is_folder(target):
        check_folder(target)
    else:
        check_image_format(target)
        check_writable(target)


def _is_folder(target: Path) -> bool:
    return is_folder(target) or not target.suffix


def _images(
    levels: Sequence[AnyArray], target: Path, stem: str, source: Image, *, encoded: bool = False
) -> tuple[dict[Path, AnyArray], int | None]:
    """Return images by file, and bits per channel; `encoded` encodes normals as colors."""
    folder = _is_folder(target)
    first = target / f"{stem}_0{suffix_like(source)}" if folder else target
    bits = bits_for(first, levels[0], source)
    if encoded:
        bits = bits or check_image_format(first, color=True)
        as_floats = 32 if holds_floats(first, bits) else bits
        levels = [encode_normals(unit_normals(level[..., :3]), bits=as_floats) for level in levels]
    if not folder:
        return {target: levels_picture(levels)}, bits
    files = [first.with_name(f"{stem}_{index}{first.suffix}") for index in range(len(levels))]
    return dict(zip(files, levels, strict=True)), bits
