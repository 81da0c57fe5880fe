"""Meshes and mappings that meet where angles, roots and rays have no answer."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from catalog.case import Case
from catalog.geometry import mesh_of

from texbake import Mesh
from texbake.mesh.shapes import cube, icosphere, uv_sphere


@dataclass(frozen=True)
class Mapping:
    """A mesh, a method with its options, and the widest that a face may be along s and t."""

    mesh: Mesh
    options: dict[str, Any] = field(default_factory=dict)
    widest: tuple[float, float] = (np.inf, np.inf)


def _ball():
    return uv_sphere(8, 16).replace(uvs=None, uv_faces=None)


def _around_an_axis():
    """Faces with corners on the axis, at its middle, above one another."""
    points = [[0, -1, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]]
    return mesh_of(points, [[0, 1, 2], [0, 2, 3], [1, 3, 4], [2, 3, 4]])


def _near_the_pole():
    """A cap of 1e-9 about the pole of a sphere: the arc cosine of its heights is 0 or 1e-8."""
    angles = np.arange(6) * np.pi / 3.0
    rim = np.column_stack([1e-9 * np.cos(angles), np.ones(6), 1e-9 * np.sin(angles)])
    points = np.concatenate([rim, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    return mesh_of(points, [[(i + 1) % 6, i, 6] for i in range(6)] + [[0, 2, 7]])


def _rays_along(surface, via):
    """A cube, whose normals run along the plane, the mantle, the caps or the box."""
    return Mapping(cube(), {"method": "two-part", "surface": surface, "via": via})


_SIXTEENTH = 1.0 / 16.0 + 1e-12

MAPPINGS: tuple[Case[Mapping], ...] = (
    *(Case(name=f"points on the axis, {method}", wrong="the point has no angle: atan2(0, 0)",
           make=lambda method=method: Mapping(
               _around_an_axis(), {"method": method, "axis": "y", "center": (0, 0, 0)}))
      for method in ("cylindrical", "spherical")),
    Case(name="point in the center of the sphere", wrong="the direction is 0 / 0",
         make=lambda: Mapping(_around_an_axis(), {"method": "spherical", "center": (0, 0, 0)})),
    Case(name="arccos at its ends",
         wrong="the arc cosine of 1 + 2^-52 is NaN, and 1 - 1e-18 rounds to 1",
         make=lambda: Mapping(
             _near_the_pole(), {"method": "spherical", "axis": "y", "center": (0, 0, 0)})),
    *(Case(name=f"faces over the ±π seam, {method}",
           wrong="the face runs backwards over the whole texture",
           make=lambda method=method: Mapping(
               _ball(), {"method": method, "axis": "z"}, (_SIXTEENTH, np.inf)))
      for method in ("cylindrical", "spherical")),
    Case(name="pole within a face",
         wrong="the corners lie around the pole, up to half a turn apart",
         make=lambda: Mapping(icosphere(1), {"method": "spherical", "axis": (0.3, 0.5, 0.81)})),
    *(Case(name=f"rays parallel to the {surface}, {via}",
           wrong="the ray never meets the surface: 1 / 0",
           make=lambda surface=surface, via=via: _rays_along(surface, via))
      for surface, via in (("plane", "object-normal"), ("cylinder", "object-normal"),
                           ("plane", "centroid"), ("box", "object-normal"))),
)  # fmt: skip
