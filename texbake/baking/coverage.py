"""How much of each texel the light mesh covers, and which face owns any point of the texture.

Texels are wholly covered, or not at all, but for those that the outline of a chart passes through.
Of these each of `FINE` x `FINE` sub-squares is looked at. A point asks the few faces that reach
into its neighborhood, in their order, so that owners are those of `rasterize_uv` on any grid.

Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988, as `texels` is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import (
    NO_FACE,
    UNIT,
    SampleGrid,
    snap_uvs,
)
from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import run_bands

FINE = 8  # sub-squares a texel side
FULL = FINE * FINE
TEXEL = FINE * UNIT  # units of the fixed-point grid in a texel
_BIN = 8  # texels a side that share a list of faces
_SLACK = 2  # units that a line is widened by, against rounding


@dataclass(frozen=True, eq=False)
class FaceBins:
    """Faces of the light mesh by the squares of texels that they reach into.

    Attributes
    ----------
    corners : (F, 3, 2) int64
        x to the right and y down, `TEXEL` to a texel.
    firsts : (bins + 1,) int64
        Where the faces of each bin begin.
    faces : (n,) int32
        In their order within each bin.
    n_columns : int
        Bins in a row of bins.
    """

    corners: npt.NDArray[np.int64]
    firsts: npt.NDArray[np.int64]
    faces: IntArray
    n_columns: int

    @classmethod
    def of(cls, low: Mesh, width: int, height: int) -> FaceBins:
        """Sort the faces of a light mesh into the bins of a map.

        Raises
        ------
        UvError
            As `snap_uvs`.
        """
        corners = snap_uvs(low, SampleGrid(width, height, FINE)).corners
        n_rows, n_columns = -(-height // _BIN), -(-width // _BIN)
        firsts = np.zeros(n_rows * n_columns + 1, dtype=np.int64)
        faces = np.empty(0, dtype=np.int32)
        _bin_kernel(corners, (n_rows, n_columns, False), firsts, faces)
        firsts = np.concatenate([[0], np.cumsum(firsts[:-1])])
        faces = np.empty(int(firsts[-1]), dtype=np.int32)
        _bin_kernel(corners, (n_rows, n_columns, True), firsts.copy(), faces)
        return cls(corners, firsts, faces, n_columns)

    @property
    def arrays(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], IntArray, int]:
        """What kernels take."""
        return self.corners, self.firsts, self.faces, self.n_columns


@dataclass(frozen=True, eq=False)
class Coverage:
    """How much of each texel (n,) is covered.

    Attributes
    ----------
    counts : uint8
        Covered sub-squares, of `FULL`. A texel with a covered center counts one at least.
    masks : int64
        Of texels that are covered in part, which sub-squares are, row by row from bit 0.
    """

    counts: npt.NDArray[np.uint8]
    masks: npt.NDArray[np.int64]

    @classmethod
    def none(cls, n_texels: int) -> Coverage:
        """Nothing is covered yet."""
        return cls(np.zeros(n_texels, dtype=np.uint8), np.zeros(n_texels, dtype=np.int64))

    def see(
        self, bins: FaceBins, owners: IntArray, outlined: npt.NDArray[np.bool_], rows: range,
        threads: int | None,
    ) -> None:  # fmt: skip
        """Look at some rows of texels, of which the owners of the centers (rows, width) are known.

        `outlined` are the texels (height, width) that outlines pass through.
        """
        width = owners.shape[1]
        band = slice(rows.start * width, rows.stop * width)
        counts, masks = self.counts[band], self.masks[band]
        flat = owners.reshape(-1)
        np.multiply(flat != NO_FACE, np.uint8(FULL), out=counts)
        texels = np.flatnonzero(outlined[rows.start : rows.stop])

        def look(start: int, stop: int) -> None:
            _masks_kernel(bins.arrays, (rows.start, width), texels[start:stop], flat, counts, masks)

        run_bands(look, len(texels), band=1 << 12, threads=threads)


def outlined_texels(bins: FaceBins, width: int, height: int) -> npt.NDArray[np.bool_]:
    """(height, width) texels that an edge with no face on its other side passes through, or near.

    What no such edge passes through is covered as its center is.
    """
    found = np.zeros((height, width), dtype=np.bool_)
    _outline_kernel(_outlines(bins.corners), found)
    return found


def _outlines(corners: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """(E, 2, 2) edges that no face with area has in the other direction."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    oriented = np.where((doubled < 0)[:, np.newaxis, np.newaxis], corners[:, ::-1], corners)
    oriented = oriented[doubled != 0]
    # Corners are within 2^29 of the origin, so that the two of a point fit into one number.
    keys = (oriented[..., 0] << 31) + oriented[..., 1]
    points, ids = np.unique(keys, return_inverse=True)
    ids = ids.reshape(-1, 3).astype(np.int64)
    ends = np.roll(ids, -1, axis=1)
    n = len(points)
    is_outline = ~np.isin(ids * n + ends, ends * n + ids)
    edges = np.stack([oriented, np.roll(oriented, -1, axis=1)], axis=2)
    return np.ascontiguousarray(edges[is_outline])


@kernel
def owner_at(bins, x, y):  # type: ignore[no-untyped-def]
    """First face that covers a point of the map, `NO_FACE` for none; x and y in units."""
    corners, firsts, faces, n_columns = bins
    place = (y // (_BIN * TEXEL)) * n_columns + x // (_BIN * TEXEL)
    for i in range(firsts[place], firsts[place + 1]):
        if covers(corners, faces[i], x, y):
            return faces[i]
    return NO_FACE


@kernel
def covers(corners, face, x, y):  # type: ignore[no-untyped-def]
    """Whether a face with area covers a point, by the top-left rule."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0], corners[face, 1, 1]
    cx, cy = corners[face, 2, 0], corners[face, 2, 1]
    if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
        bx, by, cx, cy = cx, cy, bx, by
    return (
        _side(ax, ay, bx, by, x, y) > 0
        and _side(bx, by, cx, cy, x, y) > 0
        and _side(cx, cy, ax, ay, x, y) > 0
    )


@kernel
def _side(px, py, qx, qy, x, y):  # type: ignore[no-untyped-def]
    """Positive for a point on the inner side of an edge, by the top-left rule."""
    dx, dy = qx - px, qy - py
    is_owned = dy < 0 or (dy == 0 and dx > 0)
    return dx * (y - py) - dy * (x - px) + (1 if is_owned else 0)


@kernel
def _bin_kernel(corners, size, firsts, faces):  # type: ignore[no-untyped-def]
    """Count the faces of each bin in `firsts`, or list them from there on."""
    n_rows, n_columns, is_list = size
    side = _BIN * TEXEL
    for face in range(len(corners)):
        ax, ay = corners[face, 0, 0], corners[face, 0, 1]
        bx, by = corners[face, 1, 0], corners[face, 1, 1]
        cx, cy = corners[face, 2, 0], corners[face, 2, 1]
        doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if doubled == 0:
            continue
        if doubled < 0:
            bx, by, cx, cy = cx, cy, bx, by
        top, bottom = max(min(ay, by, cy) // side, 0), min(max(ay, by, cy) // side, n_rows - 1)
        left, right = max(min(ax, bx, cx) // side, 0), min(max(ax, bx, cx) // side, n_columns - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                x, y = column * side, row * side
                if (
                    _beyond(ax, ay, bx, by, x, y, side)
                    or _beyond(bx, by, cx, cy, x, y, side)
                    or _beyond(cx, cy, ax, ay, x, y, side)
                ):
                    continue
                place = row * n_columns + column
                if is_list:
                    faces[firsts[place]] = face
                firsts[place] += 1


@kernel
def _beyond(px, py, qx, qy, x, y, side):  # type: ignore[no-untyped-def]
    """Whether a whole square lies on the outer side of an edge."""
    dx, dy = qx - px, qy - py
    innermost_x = x if dy > 0 else x + side
    innermost_y = y + side if dx > 0 else y
    return dx * (innermost_y - py) - dy * (innermost_x - px) < 0


@kernel
def _masks_kernel(bins, size, texels, owners, counts, masks):  # type: ignore[no-untyped-def]
    corners, firsts, faces, n_columns = bins
    first_row, width = size
    for texel in texels:
        column, row = texel % width, first_row + texel // width
        place = (row // _BIN) * n_columns + column // _BIN
        mask = 0
        for i in range(firsts[place], firsts[place + 1]):
            mask |= _covered_mask(corners, faces[i], column * TEXEL, row * TEXEL)
        n = 0
        for bit in range(FULL):
            n += (mask >> bit) & 1
        counts[texel] = n if n > 0 or owners[texel] == NO_FACE else 1
        masks[texel] = mask


@kernel
def _covered_mask(corners, face, left, top):  # type: ignore[no-untyped-def]
    """Sub-squares of a texel whose centers a face covers, by the top-left rule."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0], corners[face, 1, 1]
    cx, cy = corners[face, 2, 0], corners[face, 2, 1]
    if max(ax, bx, cx) < left or min(ax, bx, cx) > left + TEXEL:
        return 0
    if max(ay, by, cy) < top or min(ay, by, cy) > top + TEXEL:
        return 0
    if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
        bx, by, cx, cy = cx, cy, bx, by
    x, y = left + UNIT // 2, top + UNIT // 2
    a, b, c = _side(ax, ay, bx, by, x, y), _side(bx, by, cx, cy, x, y), _side(cx, cy, ax, ay, x, y)
    mask = 0
    for row in range(FINE):
        for column in range(FINE):
            # each is positive on the inner side
            across, down = column * UNIT, row * UNIT
            if (
                a + (bx - ax) * down - (by - ay) * across > 0
                and b + (cx - bx) * down - (cy - by) * across > 0
                and c + (ax - cx) * down - (ay - cy) * across > 0
            ):
                mask |= 1 << (FINE * row + column)
    return mask


@kernel
def _outline_kernel(edges, found):  # type: ignore[no-untyped-def]
    """Mark the texels that lines pass through."""
    height, width = found.shape
    for i in range(len(edges)):
        ax, ay, bx, by = edges[i, 0, 0], edges[i, 0, 1], edges[i, 1, 0], edges[i, 1, 1]
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        first = max((ay - _SLACK) // TEXEL, 0)
        last = min((by + _SLACK) // TEXEL, height - 1)
        for row in range(first, last + 1):
            # x where the line enters and leaves the row
            left, right = min(ax, bx), max(ax, bx)
            if by > ay:
                slope = (bx - ax) / (by - ay)
                enters = ax + slope * (max(row * TEXEL, ay) - ay)
                leaves = ax + slope * (min((row + 1) * TEXEL, by) - ay)
                left = max(left, int(np.floor(min(enters, leaves))))
                right = min(right, int(np.ceil(max(enters, leaves))))
            begin = max((left - _SLACK) // TEXEL, 0)
            end = min((right + _SLACK) // TEXEL, width - 1)
            for column in range(begin, end + 1):
                found[row, column] = True
