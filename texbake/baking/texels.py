"""Which face of the light mesh owns each sample of the texture: where a texel becomes a ray.

Texture coordinates are snapped to a fixed-point grid and coverage is decided with 64-bit integer
edge functions and the top-left rule, so that two faces that share an edge own each sample of it
exactly once, whatever the size or the number of threads.

Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988. Departs from it by solving
each edge function for its span of a row, exactly, instead of testing every sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.errors import UvError
from texbake.kernels import kernel
from texbake.mesh.mesh import Mesh
from texbake.parallel import run_bands
from texbake.raycast.rays import Rows
from texbake.texture.lookup import texel_coordinates

FRACTION_BITS = 11  # a sample is 2048 units wide
UNIT = 1 << FRACTION_BITS
# 2^18 samples from the origin; a product of two differences is then at most 2^60.
REACH = 1 << (18 + FRACTION_BITS)
TILE = 8  # rows and columns of samples that are cast together; a multiple of samples a texel side
NO_FACE = -1


@dataclass(frozen=True)
class SampleGrid:
    """A texture of `width` x `height` texels, each a square of `per_side` x `per_side` samples."""

    width: int
    height: int
    per_side: int

    @property
    def n_columns(self) -> int:
        """Samples in a row of samples."""
        return self.width * self.per_side

    @property
    def n_rows(self) -> int:
        """Rows of samples."""
        return self.height * self.per_side


@dataclass(frozen=True)
class SnappedFaces:
    """A light mesh's faces on the fixed-point grid of a `SampleGrid`.

    Attributes
    ----------
    corners : (F, 3, 2) int64
        x to the right and y down, `UNIT` to a sample.
    first_rows, last_rows : (F,) int32
        Rows of samples whose centers a face can own; last below first where it can own none.
    n_outside_tile : int
        Faces with a corner outside the unit square; what lies outside is not baked.
    n_zero_area : int
        Faces without area on the grid; they own nothing.
    """

    corners: npt.NDArray[np.int64]
    first_rows: npt.NDArray[np.int32]
    last_rows: npt.NDArray[np.int32]
    n_outside_tile: int
    n_zero_area: int


@dataclass(frozen=True, eq=False)
class Samples(Rows):
    """Owned samples, in the order in which they are cast.

    Attributes
    ----------
    texel_ids : (n,) int32
        Row times width plus column of the texel, row 0 at the top.
    faces : (n,) int32
        Face of the light mesh.
    barycentrics : (n, 2) float64
        Weights of the face's second and third corner at the sample.
    """

    texel_ids: npt.NDArray[np.int32]
    faces: npt.NDArray[np.int32]
    barycentrics: npt.NDArray[np.float64]


def snap_uvs(mesh: Mesh, grid: SampleGrid) -> SnappedFaces:
    """Put a mesh's texture coordinates onto the fixed-point grid.

    A face that reaches farther than 2^18 samples from the origin is left out and counts as outside.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or all of its faces have no area or lie outside.
    """
    uvs = mesh.corner_uvs()
    snapped = np.rint(texel_coordinates(uvs, grid.n_columns, grid.n_rows) * UNIT)
    too_far = np.asarray((np.abs(snapped) > REACH).any(axis=(1, 2)))
    snapped[too_far] = 0.0
    corners = snapped.astype(np.int64)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    zero_area = (a[:, 0] * b[:, 1] == a[:, 1] * b[:, 0]) & ~too_far
    # A sample's center lies half a unit into it: the first center at or below the top corner.
    first = -((UNIT // 2 - corners[:, :, 1].min(axis=1)) // UNIT)
    last = (corners[:, :, 1].max(axis=1) - UNIT // 2) // UNIT
    first = np.maximum(first, 0)
    last = np.minimum(last, grid.n_rows - 1)
    last[zero_area | too_far] = -1
    # What float32 files leave of coordinates on the border is no reason to warn.
    outside = np.asarray((np.abs(uvs - 0.5) > 0.5 + 1e-6).any(axis=(1, 2)))
    if not (first <= last).any():
        raise UvError(_uncovered_message(mesh, zero_area, outside))
    return SnappedFaces(
        corners=corners,
        first_rows=first.astype(np.int32),
        last_rows=last.astype(np.int32),
        n_outside_tile=int(outside.sum()),
        n_zero_area=int(zero_area.sum()),
    )


def _uncovered_message(
    mesh: Mesh, zero_area: npt.NDArray[np.bool_], outside: npt.NDArray[np.bool_]
) -> str:
    why = "all of them have no area" if zero_area.all() else "none of them lies in the unit square"
    if not zero_area.all() and not outside.any():
        why = "they are smaller than any texel"
    return (
        f"{mesh.name}: its texture coordinates cover nothing: {why}; "
        f"make new ones with: texbake unwrap {mesh.name} -o OUT"
    )


def rasterize_uv(
    faces: SnappedFaces,
    grid: SampleGrid,
    rows: range | None = None,
    *,
    threads: int | None = None,
) -> tuple[npt.NDArray[np.int32], int]:
    """Owner of every sample in some rows of texels: the first face that covers its center.

    Parameters
    ----------
    rows : range, optional
        Rows of texels, all of them for None.

    Returns
    -------
    owners : (len(rows) * per_side, width * per_side) int32
        Face ids, `NO_FACE` where there is none.
    n_overlaps : int
        Samples that more than one face covers.
    """
    rows = range(grid.height) if rows is None else rows
    first = rows.start * grid.per_side
    n_rows = len(rows) * grid.per_side
    owners = np.full((n_rows, grid.n_columns), NO_FACE, dtype=np.int32)
    overlapped = np.zeros((n_rows, grid.n_columns), dtype=np.bool_)

    def rasterize(start: int, stop: int) -> None:
        _rasterize_kernel(
            faces.corners,
            faces.first_rows,
            faces.last_rows,
            first + start,
            first + stop,
            owners[start:stop],
            overlapped[start:stop],
        )

    run_bands(rasterize, n_rows, band=64, threads=threads)
    return owners, int(np.count_nonzero(overlapped))


@kernel
def _rasterize_kernel(corners, first_rows, last_rows, start, stop, owners, overlapped):  # type: ignore[no-untyped-def]
    """Fill rows start to stop of the grid; `owners` and `overlapped` begin at row start."""
    n_columns = owners.shape[1]
    half = UNIT // 2
    for face in range(len(corners)):
        first = max(first_rows[face], start)
        last = min(last_rows[face], stop - 1)
        if last < first:
            continue
        ax, ay = corners[face, 0, 0], corners[face, 0, 1]
        bx, by = corners[face, 1, 0], corners[face, 1, 1]
        cx, cy = corners[face, 2, 0], corners[face, 2, 1]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
            bx, by, cx, cy = cx, cy, bx, by
        for row in range(first, last + 1):
            y = row * UNIT + half
            left, right = 0, n_columns - 1
            for edge in range(3):
                if edge == 0:
                    px, py, qx, qy = ax, ay, bx, by
                elif edge == 1:
                    px, py, qx, qy = bx, by, cx, cy
                else:
                    px, py, qx, qy = cx, cy, ax, ay
                dx, dy = qx - px, qy - py
                # inside where dx (y - py) - dy (x - px) > 0, or = 0 on a top or left edge
                limit = 0 if (dy < 0 or (dy == 0 and dx > 0)) else 1
                rest = dx * (y - py) + dy * (px - half) - limit
                # rest - dy * UNIT * column >= 0, solved for the column
                if dy == 0:
                    if rest < 0:
                        right = -1
                elif dy > 0:
                    right = min(right, rest // (dy * UNIT))
                else:
                    left = max(left, -(rest // (-dy * UNIT)))
            line = row - start
            for column in range(left, right + 1):
                if owners[line, column] == NO_FACE:
                    owners[line, column] = face
                else:
                    overlapped[line, column] = True


def owned_samples(
    owners: npt.NDArray[np.int32],
    faces: SnappedFaces,
    grid: SampleGrid,
    first_texel_row: int,
    *,
    threads: int | None = None,
) -> Samples:
    """List the owned samples of `rasterize_uv` tile by tile, with their barycentrics.

    Rays of one tile start close together and go the same way, which is what makes casting them
    fast; a texel's samples always lie in one row of tiles.
    """
    n_bands = -(-len(owners) // TILE)
    counts = np.array(
        [np.count_nonzero(owners[i * TILE : (i + 1) * TILE] != NO_FACE) for i in range(n_bands)],
        dtype=np.int64,
    )
    offsets = np.concatenate([[0], np.cumsum(counts)])
    n_samples = int(offsets[-1])
    texel_ids = np.empty(n_samples, dtype=np.int32)
    sample_faces = np.empty(n_samples, dtype=np.int32)
    barycentrics = np.empty((n_samples, 2), dtype=np.float64)

    def list_tiles(start: int, stop: int) -> None:
        for band in range(start, stop):
            _list_tiles_kernel(
                owners,
                faces.corners,
                band * TILE,
                first_texel_row * grid.per_side,
                grid.per_side,
                offsets[band],
                texel_ids,
                sample_faces,
                barycentrics,
            )

    run_bands(list_tiles, n_bands, band=8, threads=threads)
    return Samples(texel_ids, sample_faces, barycentrics)


@kernel
def _list_tiles_kernel(  # type: ignore[no-untyped-def]
    owners, corners, first_line, first_row, per_side, n, texel_ids, faces, barycentrics
):
    """List one row of tiles, beginning at line `first_line` of `owners`, from place n on."""
    n_lines, n_columns = owners.shape
    width = n_columns // per_side
    for tile in range(0, n_columns, TILE):
        for line in range(first_line, min(first_line + TILE, n_lines)):
            row = first_row + line
            for column in range(tile, min(tile + TILE, n_columns)):
                face = owners[line, column]
                if face == NO_FACE:
                    continue
                texel_ids[n] = (row // per_side) * width + column // per_side
                faces[n] = face
                x, y = column * UNIT + UNIT // 2, row * UNIT + UNIT // 2
                write_weights(corners, face, x, y, barycentrics[n])
                n += 1


@kernel
def write_weights(corners, face, x, y, weights):  # type: ignore[no-untyped-def]
    """Write the weights of a face's second and third corner at a point in units."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0] - ax, corners[face, 1, 1] - ay
    cx, cy = corners[face, 2, 0] - ax, corners[face, 2, 1] - ay
    px, py = x - ax, y - ay
    area = float(bx * cy - by * cx)
    weights[0] = (px * cy - py * cx) / area
    weights[1] = (bx * py - by * px) / area
