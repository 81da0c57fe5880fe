"""Meshes of parametric surfaces, which carry their own (u, v) as texture coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from texbake.mesh.mesh import Mesh
from texbake.mesh.parametric.bezier import make_bezier
from texbake.mesh.parametric.flat import make_height_field, make_plane
from texbake.mesh.parametric.mobius import make_mobius
from texbake.mesh.parametric.options import MakeOptions
from texbake.mesh.parametric.patches import patches_of
from texbake.mesh.parametric.profile import profile_of
from texbake.mesh.parametric.revolution import (
    make_cone,
    make_cylinder,
    make_revolution,
    make_sphere,
    make_torus,
)

_MAKERS: dict[str, Callable[..., Mesh]] = {
    "plane": make_plane,
    "cylinder": make_cylinder,
    "cone": make_cone,
    "sphere": make_sphere,
    "torus": make_torus,
    "mobius": make_mobius,
    "revolution": make_revolution,
    "bezier": make_bezier,
    "height-field": make_height_field,
}


def make(shape: str, options: MakeOptions | None = None, **changes: Any) -> Mesh:
    """Make a mesh of a parametric surface.

    Parameters
    ----------
    shape
        `plane` and `height-field` face +z. `cylinder`, `cone`, `sphere`, `torus`, `mobius` and
        `revolution` go around the y axis, with u = 1/2 at the front, +z, and the seam at the back;
        u grows counter-clockwise seen from above, and v upwards on the outside. `bezier` has the
        coordinates of its patches.
    options
        Choices that differ from the defaults; `MakeOptions` says which there are.
    **changes
        Fields of `MakeOptions` to change.

    Returns
    -------
    Mesh
        Texture coordinates are (u, v) in the unit square; a part more (a cap, a patch) has a tile
        of its own. Faces are counter-clockwise seen from outside. Vertices are shared across seams
        and at poles, where each face takes the middle u of its own. All but height fields have the
        normals of the surface.

    Raises
    ------
    OptionError
        There is no such shape, or an option is out of range, missing, or not read by the shape.
    FileError, FileFormatError
        A profile or patch file cannot be read.
    MeshError
        The surface has no area.

    Examples
    --------
    >>> make("sphere", resolution=(8, 4)).n_faces
    48
    >>> make("cylinder", sides=6, caps=True).group_names
    ('side', 'bottom', 'top')
    """
    options = replace(options or MakeOptions(), **changes)
    settings = options.settings(shape)
    for name, read in ("profile", profile_of), ("patches", patches_of):
        if name in settings:
            settings[name] = read(settings[name])
    return _MAKERS[shape](**settings)
