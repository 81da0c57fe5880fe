"""A plane, and a height field over it; both face +z, with v along y.

A height field has one vertex at the center of each pixel, exactly as high as the pixel says, and
the texture coordinates of that center: an image of the same size, laid over it, fits pixel by
pixel, and its borders lie half a pixel outside of the surface.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.parametric.grid import (
    Grid,
    grid_mesh,
    half_steps,
    make_grid,
    open_lines,
)
from texbake.mesh.parametric.options import check_triangles


def make_plane(*, resolution: tuple[int, int], width: float, height: float) -> Mesh:
    """Rectangle about the origin in the plane z = 0, its normal +z."""
    grid, u, v = _laid_out(*resolution)
    # Of steps and not of u, so that opposite borders have opposite coordinates bit by bit.
    x, y = (
        (nodes - steps) * (length / (2 * steps))
        for nodes, steps, length in zip(grid.nodes.T, resolution, (width, height), strict=True)
    )
    flat = np.zeros(len(x))
    return grid_mesh(
        grid,
        name="plane",
        positions=np.stack([x, y, flat], axis=-1),
        uvs=np.stack([u, v], axis=-1),
        normals=np.broadcast_to([0.0, 0.0, 1.0], (len(x), 3)),
    )


def make_height_field(
    *,
    resolution: tuple[int, int] | None,
    image: npt.ArrayLike,
    width: float,
    height: float,
) -> Mesh:
    """Surface z = height · image over a rectangle about the origin.

    Parameters
    ----------
    resolution
        Squares along u and v; between pixels the image is bilinear. None: one less than pixels.
    image : (H, W) or (H, W, C)
        Row 0 at the top; see `MakeOptions`.
    width
        Along x, from border to border of the image, whose pixels are square: the surface, which
        ends at the centers of the outermost pixels, is one pixel narrower.
    height
        z where the image is 1.

    Returns
    -------
    Mesh
        Without normals: the smooth ones of its faces serve.

    Raises
    ------
    OptionError
        It is no image, has fewer than 2 x 2 pixels, or one that is not finite.
    """
    pixels = _gray(image)
    n_down, n_across = pixels.shape
    steps = (n_across - 1, n_down - 1) if resolution is None else resolution
    check_triangles(2 * steps[0] * steps[1])
    grid, along_u, along_v = _laid_out(*steps)
    # In pixels from the center of the lower left one.
    column, row = along_u * (n_across - 1), along_v * (n_down - 1)
    pixel = width / n_across
    positions = np.stack(
        [
            (column - 0.5 * (n_across - 1)) * pixel,
            (row - 0.5 * (n_down - 1)) * pixel,
            height * _bilinear(pixels[::-1], column, row),
        ],
        axis=-1,
    )
    uvs = np.stack([(column + 0.5) / n_across, (row + 0.5) / n_down], axis=-1)
    return grid_mesh(grid, name="height field", positions=positions, uvs=uvs)


def _laid_out(n_u: int, n_v: int) -> tuple[Grid, FloatArray, FloatArray]:
    """Grid over the unit square, with u and v of its nodes."""
    grid = make_grid(open_lines(n_u), open_lines(n_v))
    u, v = (half_steps(np.arange(steps + 1) / steps) for steps in (n_u, n_v))
    return grid, u[grid.nodes[:, 0]], v[grid.nodes[:, 1]]


def _gray(image: npt.ArrayLike) -> FloatArray:
    """(H, W) float64 of an image."""
    try:
        pixels = np.asarray(image, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OptionError("image: it is not an array of numbers; read a file first") from error
    if pixels.ndim == 3 and pixels.shape[2] > 0:
        # One or two channels are gray and alpha; three or four are colors and alpha.
        pixels = pixels[..., : 3 if pixels.shape[2] > 2 else 1].mean(axis=2)
    if pixels.ndim != 2:
        raise OptionError(f"image: an array of the shape {pixels.shape} is no image; give (H, W)")
    if min(pixels.shape) < 2:
        raise OptionError(
            f"image: it has {pixels.shape[1]} x {pixels.shape[0]} pixels; "
            "a height field needs at least 2 x 2"
        )
    bad = np.argwhere(~np.isfinite(pixels))
    if len(bad):
        raise OptionError(
            f"image: {len(bad)} of its pixels are not finite, "
            f"the first in row {bad[0][0]}, column {bad[0][1]}"
        )
    return pixels


def _bilinear(pixels: FloatArray, column: FloatArray, row: FloatArray) -> FloatArray:
    """Values between pixels; at a whole column and row exactly the pixel's."""
    left = np.minimum(column.astype(np.int64), pixels.shape[1] - 2)
    below = np.minimum(row.astype(np.int64), pixels.shape[0] - 2)
    across, up = column - left, row - below
    low = (1.0 - across) * pixels[below, left] + across * pixels[below, left + 1]
    high = (1.0 - across) * pixels[below + 1, left] + across * pixels[below + 1, left + 1]
    result: FloatArray = (1.0 - up) * low + up * high
    return result
