"""Rasterizing triangles with integer edge functions: the kernels of `texbake.baking.texels`.

Based on: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988. Departs from it by solving
each edge function for its span of a row, exactly, instead of testing every sample.
"""

from __future__ import annotations

from texbake.kernels import kernel

FRACTION_BITS = 11  # a sample is 2048 units wide
UNIT = 1 << FRACTION_BITS
TILE = 8  # rows and columns of samples cast together; a multiple of the samples per texel side
NO_FACE = -1


@kernel
def rasterize_kernel(corners, first_rows, last_rows, start, stop, owners, overlapped):  # type: ignore[no-untyped-def]
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
                # Inside where dx (y - py) - dy (x - px) > 0, or = 0 on a top or left edge.
                limit = 0 if (dy < 0 or (dy == 0 and dx > 0)) else 1
                rest = dx * (y - py) + dy * (px - half) - limit
                # rest - dy * UNIT * column >= 0, solved for the column.
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


@kernel
def list_tiles_kernel(  # type: ignore[no-untyped-def]
    owners, corners, first_line, first_row, per_side, n, texel_ids, faces, barycentrics
):
    """List one row of tiles, which begins at line `first_line` of `owners`, from row n on."""
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
    """Write the weights of the second and third corner of a face at a point in `UNIT`s."""
    ax, ay = corners[face, 0, 0], corners[face, 0, 1]
    bx, by = corners[face, 1, 0] - ax, corners[face, 1, 1] - ay
    cx, cy = corners[face, 2, 0] - ax, corners[face, 2, 1] - ay
    px, py = x - ax, y - ay
    area = float(bx * cy - by * cx)
    weights[0] = (px * cy - py * cx) / area
    weights[1] = (bx * py - by * px) / area
