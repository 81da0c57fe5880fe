"""The Möbius strip, and strips of any number of half turns.

The middle of the strip is a circle about y through +z, where u is 1/2. There the strip stands
upright; away from it, it turns about that circle, by pi for each twist in a whole round.

With an odd number of twists the ends are glued upside down: vertex (u = 1, v) is (u = 0, 1 - v).
Faces wind counter-clockwise in (u, v), and normals are those of (u, v): both are continuous
everywhere but at the seam, across which they jump to the other side. The surface has one side, so
that any winding must have such a seam; its edges are the misoriented edges that `texbake info`
counts. Seen from behind, a face shows its back: preview it with `--back-faces show`.

Based on: do Carmo, "Differential Geometry of Curves and Surfaces", 1976, section 2-6, example 3.
"""

from __future__ import annotations

import numpy as np

from texbake.mesh.mesh import Mesh
from texbake.mesh.parametric.circle import circle_points
from texbake.mesh.parametric.grid import (
    closed_lines,
    grid_mesh,
    make_grid,
    open_lines,
)


def make_mobius(*, resolution: tuple[int, int], radius: float, width: float, twists: int) -> Mesh:
    """Closed strip whose cross section turns by half a turn for each of `twists`.

    With angle a = 2 pi (u - 1/2), turn b = pi twists (u - 1/2) and s = width (v - 1/2), the point
    is (r sin a, s cos b, r cos a), r = radius + s sin b.

    Returns
    -------
    Mesh
        2 n_u n_v triangles on n_u (n_v + 1) vertices, with analytic normals. Euler characteristic
        0, with one boundary loop where `twists` is odd, else two.
    """
    n_u, n_v = resolution
    grid = make_grid(closed_lines(n_u), open_lines(n_v), twisted=twists % 2 == 1)
    column, row = grid.nodes.astype(np.int64).T  # in half steps
    cos_a, sin_a = circle_points(2 * n_u)[(column + n_u) % (2 * n_u)].T
    # b is twists (column - n_u) of 4 n_u parts of a turn.
    cos_b, sin_b = circle_points(4 * n_u)[twists % (4 * n_u) * (column - n_u) % (4 * n_u)].T
    s = (row - n_v) * (width / (2 * n_v))
    r = radius + s * sin_b
    # Along u the point moves by 2 pi r around the axis and by pi twists s across the strip; the
    # normal, at a right angle to that and to the strip's direction, is a mix of two unit vectors.
    around, across = 2.0 * r, twists * s
    normals = np.stack(
        [
            around * cos_b * sin_a - across * cos_a,
            -around * sin_b,
            around * cos_b * cos_a + across * sin_a,
        ],
        axis=-1,
    )
    return grid_mesh(
        grid,
        name="mobius",
        positions=np.stack([r * sin_a, s * cos_b, r * cos_a], axis=-1),
        uvs=np.stack([column / (2 * n_u), row / (2 * n_v)], axis=-1),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
    )
