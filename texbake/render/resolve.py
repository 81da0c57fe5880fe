"""Samples to pixels: the mean of each pixel's samples, over the background."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.files import PathLike
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.render.shade import Shading
from texbake.render.surface import FloatImage
from texbake.render.visibility import Visibility
from texbake.texture.image import write_image

# Rows of pixels a band.
_BAND = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """A picture and what it shows; row 0 at the top.

    Attributes
    ----------
    color : (H, W, 4) float32
        Linear light and opacity. Over a background the opacity is 1; without one it is the
        coverage, and the color is not multiplied by it.
    normals : (H, W, 3) float32
        Mean of the samples' unit shading normals in world space, normalized; 0 where there is no
        mesh.
    coverage : (H, W) float32
        Share of the pixel's samples that see the mesh.
    face_ids : (H, W) int32
        Index of the nearest triangle in the pixel, of the mesh as it was drawn; -1 where there is
        none.
    depths : (H, W) float32
        Distance of it along the view in model units; infinite where there is none.
    """

    color: FloatImage
    normals: FloatImage
    coverage: FloatImage
    face_ids: IntArray
    depths: FloatImage

    @property
    def height(self) -> int:
        """Number of rows."""
        return len(self.color)

    @property
    def width(self) -> int:
        """Pixels in a row."""
        return len(self.color[0])

    def write(self, path: PathLike, *, threads: int | None = None) -> None:
        """Write the color to an image file, with opacity only where not all of it is opaque.

        Raises as `texbake.texture.image.write_image` does.
        """
        opaque = bool((self.color[..., 3] == 1.0).all())
        write_image(
            self.color[..., :3] if opaque else self.color, path, color=True, threads=threads
        )


@kernel
def _resolve_kernel(  # type: ignore[no-untyped-def]
    face_ids,
    depths,
    color,
    normals,
    background,
    near,
    n_side,
    color_out,
    normals_out,
    coverage_out,
    ids_out,
    depths_out,
    start,
    stop,
):
    n_samples = n_side * n_side
    for row in range(start, stop):
        for column in range(color_out.shape[1]):
            n_covered = 0
            red = green = blue = 0.0
            nx = ny = nz = 0.0
            nearest = np.float32(0.0)
            for j in range(row * n_side, (row + 1) * n_side):
                for i in range(column * n_side, (column + 1) * n_side):
                    if face_ids[j, i] < 0:
                        continue
                    n_covered += 1
                    red += color[j, i, 0]
                    green += color[j, i, 1]
                    blue += color[j, i, 2]
                    nx += normals[j, i, 0]
                    ny += normals[j, i, 1]
                    nz += normals[j, i, 2]
                    if depths[j, i] > nearest:
                        nearest = depths[j, i]
                        ids_out[row, column] = face_ids[j, i]
            coverage = n_covered / n_samples
            coverage_out[row, column] = coverage
            opaque = background[3]
            behind = opaque * (1.0 - coverage)
            # Without a background the color stays that of the mesh, however little there is of it.
            n_mixed = n_samples
            if opaque == 0.0:
                n_mixed = max(n_covered, 1)
            color_out[row, column, 0] = red / n_mixed + behind * background[0]
            color_out[row, column, 1] = green / n_mixed + behind * background[1]
            color_out[row, column, 2] = blue / n_mixed + behind * background[2]
            color_out[row, column, 3] = max(coverage, opaque)
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0.0:
                normals_out[row, column, 0] = nx / length
                normals_out[row, column, 1] = ny / length
                normals_out[row, column, 2] = nz / length
            if nearest > 0.0:
                depths_out[row, column] = near / nearest


def resolve(
    visibility: Visibility,
    shading: Shading,
    *,
    supersampling: int,
    background: tuple[float, float, float] | None,
    near: float,
    threads: int | None = None,
) -> Frame:
    """Make pixels of n x n samples each.

    Parameters
    ----------
    visibility, shading
        Of the samples; both sides of the screen are multiples of `supersampling`.
    supersampling
        n.
    background : (r, g, b) linear, optional
        None: transparent.
    near
        Distance of the camera's near plane, which turns depths into distances.
    threads
        None for every processor.
    """
    n_rows, n_columns = (side // supersampling for side in visibility.face_ids.shape)
    behind = np.array((0.0,) * 4 if background is None else (*background, 1.0))
    color = np.empty((n_rows, n_columns, 4), np.float32)
    normals = np.zeros((n_rows, n_columns, 3), np.float32)
    coverage = np.empty((n_rows, n_columns), np.float32)
    face_ids = np.full((n_rows, n_columns), -1, np.int32)
    depths = np.full((n_rows, n_columns), np.inf, np.float32)

    def work(start: int, stop: int) -> None:
        _resolve_kernel(
            visibility.face_ids, visibility.depths, shading.color, shading.normals, behind, near,
            supersampling, color, normals, coverage, face_ids, depths, start, stop,
        )  # fmt: skip

    run_bands(work, n_rows, band=_BAND, threads=threads)
    return Frame(color=color, normals=normals, coverage=coverage, face_ids=face_ids, depths=depths)
