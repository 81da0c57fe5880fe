"""Volumes from files: a NumPy array, or a stack of images.

Slice k of a stack holds the values at r from k / depth to (k + 1) / depth; see `lookup`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from texbake.arrays import DAMAGE, read_array_file
from texbake.errors import FileFormatError, one_line
from texbake.files import PathLike, require_file
from texbake.texture.image import read_image


def read_volume(source: PathLike | Sequence[PathLike]) -> npt.NDArray[np.float32]:
    """Read a volume.

    Returns (D, H, W, 1 or 3) float32.
    """
    if not isinstance(source, str | os.PathLike):
        slices = [read_image(path, color=False).pixels[:, :, :1] for path in source]
        for path, layer in zip(source, slices, strict=True):
            if layer.shape != slices[0].shape:
                height, width = slices[0].shape[:2]
                raise FileFormatError(
                    f"{path}: it is {layer.shape[1]} x {layer.shape[0]} texels, and the first "
                    f"slice {width} x {height}"
                )
        return np.stack(slices).astype(np.float32)
    require_file(source)
    try:
        array = read_array_file(source)
    except (OSError, *DAMAGE) as error:
        raise FileFormatError(f"{source}: it is not a .npy file: {one_line(error, 120)}") from error
    if array.dtype.kind not in "uif":
        raise FileFormatError(f"{source}: it is not one array of numbers")
    if array.ndim == 3:
        array = array[..., None]
    if array.ndim != 4 or array.shape[3] not in (1, 3) or array.size == 0:
        raise FileFormatError(
            f"{source}: the shape {array.shape} is not (depth, height, width), nor that with 3 "
            "channels"
        )
    divisor = np.iinfo(array.dtype).max if array.dtype.kind in "ui" else 1
    volume: npt.NDArray[np.float32] = (array / divisor).astype(np.float32)
    if not np.isfinite(volume).all():
        raise FileFormatError(f"{source}: a value is not finite")
    return volume
