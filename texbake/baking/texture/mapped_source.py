"""A photograph with texture coordinates of its own, as faces captured from several sides have.

There is no direction to go by: a face counts as much as it takes of the photograph for its size,
which for a picture taken from far away is the cosine of the angle at which it was seen.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.texels import SampleGrid
from texbake.baking.texture.coverage import sample_steps
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo_sources import (
    BAND,
    SurfacePoints,
    Views,
    border_weight,
)
from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.mapping.areas import measurable_uvs, signed_areas, surface_areas
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands


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

        run_bands(look_up, n, band=BAND, threads=self._options.threads)
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


def _facing_by_area(mesh: Mesh, mapped: Mesh) -> FloatArray:
    """(F, 3) float64: share of the greatest area that faces take of a photograph for their size.

    Means over the faces about each position, weighted by area, so that they change smoothly; 0 at
    the corners of faces that take none. The greatest is that which 1 % of the surface exceeds.
    """
    surface = surface_areas(mesh.positions[mesh.faces])
    taken = np.abs(signed_areas(measurable_uvs(mapped)))
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
