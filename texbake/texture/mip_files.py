"""Write the mip levels of an image, and the roughness that averaging normals loses.

Based on: Banerjee et al., "Clustering on the Unit Hypersphere using von Mises-Fisher
Distributions", 2005, for the spread of directions from the length of their mean; Toksvig,
"Mipmapping Normal Maps", 2005, for widening highlights by that spread.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.files import PathLike, check_folder, check_writable, is_folder
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.texture.encoding import decode_normals, encode_normals, unit_normals
from texbake.texture.image import Image, read_image
from texbake.texture.image_files import bits_for, suffix_like, write_images
from texbake.texture.image_formats import check_image_format, holds_floats
from texbake.texture.mipmaps import mip_chain
from texbake.texture.options import MipOptions


def levels_picture(levels: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
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


def roughness_of_lengths(lengths: npt.NDArray[Any]) -> Float32Array:
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
    levels: Sequence[npt.NDArray[Any]],
    target: Path,
    stem: str,
    source: Image,
    *,
    encoded: bool = False,
) -> tuple[dict[Path, npt.NDArray[Any]], int | None]:
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
