"""A photograph cast by a projector: its weight falls with the angle at which the surface is seen.

What is turned away weighs nothing, nor what other parts of the mesh hide, nor what lies so near
their outline in the photograph that its pixels show some of both.

Based on: Debevec, Taylor, Malik, "Modeling and rendering architecture from photographs", SIGGRAPH
1996 (photographs weighted by direction and feathered at their borders).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import SampleGrid
from texbake.baking.texture.coverage import sample_steps
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo_sources import (
    BAND,
    SurfacePoints,
    Views,
    border_weight,
)
from texbake.baking.texture.visibility import Visibility
from texbake.kernels import kernel
from texbake.mapping.classical.projector import projector_matrix, seen_from_of
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.parallel import run_bands

# Slope, depth over distance across the view, of a surface that is still one: that of 83 degrees.
# What is steeper between a point and the pixels about it stands before it.
_MARGIN_SLOPE = 8.0


class ProjectedSource:
    """A photograph cast by a projector.

    Parameters
    ----------
    mesh : Mesh
    matrix : (4, 4) float64
        Model space to (s, t, r, q).
    frame : LocalFrame
        Of the mesh.
    visibility : Visibility, optional
        None: nothing hides anything.
    margins : (float, float)
        Width and height, in the unit square of the photograph, about what stands before others,
        within which those are taken for hidden too: its pixels show some of both.

    Raises
    ------
    OptionError
        The matrix flattens the picture to a line or a point.
    """

    def __init__(
        self,
        mesh: Mesh,
        matrix: FloatArray,
        frame: LocalFrame,
        grid: SampleGrid,
        options: PhotoOptions,
        visibility: Visibility | None,
        margins: tuple[float, float],
    ) -> None:
        a, b, c, d = (tuple(float(value) for value in row) for row in matrix)
        given = UnwrapOptions(method="projector", matrix=(a, b, c, d))  # type: ignore[arg-type]
        local = projector_matrix(mesh, given, frame)
        self._seen_from = seen_from_of(local)
        self._matrix = np.ascontiguousarray(local[[0, 1, 3]])
        corners = frame.to_local(mesh.positions)[mesh.faces]
        self._aside = _pixel_steps(self._matrix, self._seen_from, margins)
        self._steps = self._matrix[:, :3] @ sample_steps(mesh, corners, grid)
        self._face_normals = face_normals(mesh)
        self._least_cosine = math.cos(math.radians(options.max_angle))
        self._options = options
        self._visibility = visibility

    def views(self, points: SurfacePoints) -> Views:
        """Project points; those that are behind, outside, turned away or hidden are left out."""
        n = len(points.faces)
        coordinates, weights = np.empty((n, 2)), np.empty(n)
        derivatives = np.empty((n, 4), np.float32)
        shape = (self._least_cosine, self._options.falloff, self._options.feather)

        def project(start: int, stop: int) -> None:
            band = slice(start, stop)
            _project_kernel(
                (points.faces[band], points.places[band], points.normals[band]),
                (self._matrix, self._seen_from),
                (self._face_normals, self._steps),
                shape,
                coordinates[band],
                derivatives[band],
                weights[band],
            )

        run_bands(project, n, band=BAND, threads=self._options.threads)
        seen = self._unhidden(points, np.flatnonzero(weights))
        return Views(seen, coordinates[seen], derivatives[seen], weights[seen])

    def _unhidden(
        self, points: SurfacePoints, seen: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.int64]:
        """Those of some points before which nothing stands, nor before the pixels about them."""
        if self._visibility is None:
            return seen
        hidden = self._visibility.hidden
        seen = seen[~hidden(points.places[seen], points.faces[seen], self._seen_from)]
        for across, up in ((-1, -1), (1, -1), (-1, 1), (1, 1)) if self._aside.any() else ():
            places = points.places[seen]
            depths = places @ self._matrix[2, :3] + self._matrix[2, 3]
            aside = across * self._aside[:, 0] + up * self._aside[:, 1]
            slack = _MARGIN_SLOPE * np.linalg.norm(aside) * depths
            beside = places + depths[:, None] * aside
            seen = seen[~hidden(beside, points.faces[seen], self._seen_from, slack)]
        return seen


@kernel
def _project_kernel(points, projector, surface, shape, coordinates, derivatives, weights):  # type: ignore[no-untyped-def]
    """Weights of points, and where those that have one lie in the photograph."""
    faces, places, normals = points
    matrix, seen_from = projector
    face_normals, steps = surface
    least_cosine, falloff, feather = shape
    for i in range(len(faces)):
        weights[i] = 0.0
        x, y, z = places[i, 0], places[i, 1], places[i, 2]
        q = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not q > 0.0:
            continue
        u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / q
        v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / q
        border = border_weight(u, v, feather)
        if border == 0.0:
            continue
        square, smooth, flat = 0.0, 0.0, 0.0
        for axis in range(3):
            towards = seen_from[axis] - seen_from[3] * places[i, axis]
            square += towards * towards
            smooth += towards * normals[i, axis]
            flat += towards * face_normals[faces[i], axis]
        # Of the smooth normal, which blends best, where the face itself is seen.
        share = (smooth / np.sqrt(square) - least_cosine) / (1.0 - least_cosine)
        if not (flat > 0.0 and share > 0.0):
            continue
        weights[i] = border * min(share, 1.0) ** falloff
        coordinates[i, 0], coordinates[i, 1] = u, v
        step = steps[faces[i]]
        for way in range(2):
            derivatives[i, 2 * way] = (step[0, way] - u * step[2, way]) / q
            derivatives[i, 2 * way + 1] = (step[1, way] - v * step[2, way]) / q


def _pixel_steps(
    matrix: FloatArray, seen_from: FloatArray, margins: tuple[float, float]
) -> FloatArray:
    """(3, 2) float64: how a point at depth 1 moves, across the view, by each margin."""
    rows = np.stack(
        [matrix[0, :3], matrix[1, :3], matrix[2, :3] if seen_from[3] else seen_from[:3]]
    )
    return np.asarray(np.linalg.inv(rows)[:, :2] * margins)
