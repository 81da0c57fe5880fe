"""Box mapping: each face is projected onto that of six planes which it looks to.

Based on: Bier, Sloan, "Two-part texture mappings", 1986 (the box, reached by the object's normal).
It departs in choosing the plane by face, not by point, so that no face is torn, and in smoothing
the choice; see `box_sides`. How the six pictures lie in the texture, see `side_pictures`.
"""

from __future__ import annotations

import numpy as np

from texbake.mapping.classical.box_sides import box_sides
from texbake.mapping.classical.frames import center_of, points_about
from texbake.mapping.classical.side_pictures import side_pictures
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.projected import Projected
from texbake.mesh.mesh import Mesh


def box(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh onto the six sides of a box about its center.

    Parameters
    ----------
    mesh : Mesh
    options : UnwrapOptions
        Of which `center`, `size`, `padding` and `overlap` are read.

    Returns
    -------
    Projected
        Each side in its own cell, the center of the box in the middle of it and `padding` texels
        around it; with `overlap`, each in the whole square. The scale, one for all, is the
        greatest for which everything fits. Parts of a concave mesh that one side sees behind each
        other overlap. Tallied are faces that follow their neighbors to another side than that
        nearest to their normal, and faces without area.

    Raises
    ------
    OptionError
        The padding leaves nothing of the texture.

    Examples
    --------
    >>> from texbake.mesh.shapes import cube
    >>> corners = box(cube(), UnwrapOptions(method="box", size=(300, 200), padding=0)).corners
    >>> float(corners.min()), float(corners.max())
    (0.0, 1.0)
    """
    found = box_sides(mesh)
    local = points_about(mesh, center_of(mesh, options.center), np.eye(3))
    points = local.points[mesh.faces]
    reach = np.array([np.abs(points[:, :, i]).max() for i in range(3)])
    reach[reach <= local.rounding] = 0.0
    counts = {
        "faces joined to the side of their neighbors": found.n_joined,
        "faces without area": found.n_without_normal,
    }
    return Projected(
        corners=side_pictures(points, found.sides, reach, options),
        tallies=counts,
    )
