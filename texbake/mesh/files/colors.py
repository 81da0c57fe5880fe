"""Vertex colors of text files, which go up to 1 or to 255 without saying which."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.mesh import FloatArray


def unit_colors(path: PathLike, colors: FloatArray) -> npt.NDArray[np.float32]:
    """Colors in [0, 1].

    Colors that are all whole numbers with one above 1 are taken to go up to 255; others are left
    as they are.

    Raises
    ------
    MeshError
        A color is not finite.
    """
    if not np.isfinite(colors).all():
        raise MeshError(f"{path}: a vertex color is not finite")
    if colors.max(initial=0.0) > 1.0 and (colors == np.round(colors)).all():
        colors = colors / 255.0
    return colors.astype(np.float32)
