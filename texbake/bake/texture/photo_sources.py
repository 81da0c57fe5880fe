"""Where a photograph shows each point of a mesh, and how much it is to count there.

Two kinds of photographs answer that: those cast by a projector, whose weight falls with the angle
between the surface and the direction to it, and is 0 for what is turned away or hidden; and those
that have texture coordinates of their own, as faces captured from several sides have. There is no
direction to go by then: a face counts as much as it takes of the photograph for its size, which for
a picture taken from far away is the cosine of that same angle.

Based on: Debevec, Taylor, Malik, "Modeling and rendering architecture from photographs", SIGGRAPH
1996 (photographs weighted by direction and feathered at their borders).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.bake.texels import SampleGrid
from texbake.bake.texture.coverage import sample_steps
from texbake.bake.texture.options import PhotoOptions
from texbake.bake.texture.visibility import Visibility
from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mapping.classical.projector import _local_matrix, _seen_from
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands

# Slope, depth over distance across the view, of a surface that is still one: that of 83 degrees.
# What is steeper between a point and the pixels about it stands before it.
_MARGIN_SLOPE = 8.0


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a mesh.

    Attributes
    ----------
    faces : (n,) int32
    barycentrics : (n, 2) float64
        Weights of the second and third corner.
    places, normals : (n, 3) float64
        In the local frame; normals are smooth unit vectors, or zero.
    """

    faces: IntArray
    barycentrics: FloatArray
    places: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class Views:
    """How points look in one photograph.

    Attributes
    ----------
    ids : (m,) int64
        Which of the points the photograph shows, ascending.
    coordinates : (m, 2) float64
        In the photograph, v up.
    derivatives : (m, 4) float32
        du/dx, dv/dx, du/dy, dv/dy with x and y in samples of the baked texture.
    weights : (m,) float64
        Above 0, up to 1.
    """

    ids: npt.NDArray[np.int64]
    coordinates: FloatArray
    derivatives: npt.NDArray[np.float32]
    weights: FloatArray


class PhotoSource(Protocol):
    """Tells how points look in one photograph."""

    def views(self, points: SurfacePoints) -> Views:
        """How the points look that it shows."""


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
        local = _local_matrix(mesh, given, frame)
        self._seen_from = _seen_from(local)
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

        run_bands(project, n, band=1 << 15, threads=self._options.threads)
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


@kernel
def border_weight(u, v, feather):  # type: ignore[no-untyped-def]
    """0 outside the unit square and on its border, 1 from `feather` inwards, smoothly between."""
    if not (0.0 < u < 1.0 and 0.0 < v < 1.0):
        return 0.0
    inside = min(min(u, 1.0 - u), min(v, 1.0 - v))
    if inside >= feather:
        return 1.0
    share = inside / feather
    return share * share * (3.0 - 2.0 * share)


class MappedSource:
    """A photograph with texture coordinates of its own.

    Parameters
    ----------
    mesh : Mesh
        That is baked.
    mapped : Mesh
        With the same faces; its texture coordinates are places in the photograph.

    Raises
    ------
    UvError
        `mapped` has no texture coordinates.
    OptionError
        It has other faces, or is mapped without any area.
    """

    def __init__(self, mesh: Mesh, mapped: Mesh, grid: SampleGrid, options: PhotoOptions) -> None:
        if mapped.n_faces != mesh.n_faces:
            raise OptionError(
                f"{mapped.name}: it has {mapped.n_faces:,} faces where {mesh.name} has "
                f"{mesh.n_faces:,}; the coordinates of a photograph are those of the same faces"
            )
        self._corners = mapped.corner_uvs()
        self._steps = sample_steps(mesh, self._corners, grid)
        self._facing = _facing_by_area(mesh, mapped)
        self._faces = mesh.faces
        self._options = options

    def views(self, points: SurfacePoints) -> Views:
        """Look points up; those outside the photograph or without area in it are left out."""
        n = len(points.faces)
        coordinates, weights = np.empty((n, 2)), np.empty(n)

        def look_up(start: int, stop: int) -> None:
            band = slice(start, stop)
            _look_up_kernel(
                (points.faces[band], points.barycentrics[band]),
                (self._corners, self._facing),
                (self._options.falloff, self._options.feather),
                coordinates[band],
                weights[band],
            )

        run_bands(look_up, n, band=1 << 15, threads=self._options.threads)
        seen = np.flatnonzero(weights)
        changes = self._steps[points.faces[seen]].transpose(0, 2, 1).reshape(-1, 4)
        return Views(seen, coordinates[seen], changes.astype(np.float32), weights[seen])


@kernel
def _look_up_kernel(points, photograph, shape, coordinates, weights):  # type: ignore[no-untyped-def]
    faces, barycentrics = points
    corners, facing = photograph
    falloff, feather = shape
    for i in range(len(faces)):
        b, c = barycentrics[i, 0], barycentrics[i, 1]
        a = 1.0 - b - c
        corner = corners[faces[i]]
        u = a * corner[0, 0] + b * corner[1, 0] + c * corner[2, 0]
        v = a * corner[0, 1] + b * corner[1, 1] + c * corner[2, 1]
        turned = facing[faces[i]]
        share = min(a * turned[0] + b * turned[1] + c * turned[2], 1.0)
        coordinates[i, 0], coordinates[i, 1] = u, v
        weights[i] = border_weight(u, v, feather) * share**falloff if share > 0.0 else 0.0


def _pixel_steps(
    matrix: FloatArray, seen_from: FloatArray, margins: tuple[float, float]
) -> FloatArray:
    """(3, 2) float64: how a point at depth 1 moves, across the view, by each margin."""
    rows = np.stack(
        [matrix[0, :3], matrix[1, :3], matrix[2, :3] if seen_from[3] else seen_from[:3]]
    )
    return np.asarray(np.linalg.inv(rows)[:, :2] * margins)


def _facing_by_area(mesh: Mesh, mapped: Mesh) -> FloatArray:
    """(F, 3) float64: share of the greatest area that faces take of a photograph for their size.

    Means over the faces about each position, weighted by area, so that they change smoothly; 0 at
    the corners of faces that take none. The greatest is that which 1 % of the surface exceeds.
    """
    surface = surface_areas(mesh.positions[mesh.faces])
    taken = np.abs(signed_areas(mapped.corner_uvs()))
    used = (taken > 0.0) & (surface > 0.0)
    if not used.any():
        raise OptionError(f"{mapped.name}: its coordinates take no area of the photograph")
    density = np.where(used, taken / np.where(surface > 0.0, surface, 1.0), 0.0)
    order = np.argsort(density, kind="stable")
    covered = np.cumsum(surface[order])
    greatest = density[order[np.searchsorted(covered, 0.99 * covered[-1])]]
    shares = np.minimum(density / (greatest or density.max()), 1.0)
    vertices = weld_rows(mesh.positions)[mesh.faces]
    weights = np.where(used, surface, 0.0)
    totals = np.bincount(vertices.ravel(), np.repeat(weights, 3), minlength=mesh.n_vertices)
    sums = np.bincount(vertices.ravel(), np.repeat(weights * shares, 3), minlength=mesh.n_vertices)
    means = sums / np.where(totals > 0.0, totals, 1.0)
    return np.where(used[:, None], means[vertices], 0.0)
