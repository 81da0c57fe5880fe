"""Fitting a cage: each vertex as close to the low-poly mesh as the high-poly surface allows.

All vertices start as far out as the highest point over any of their faces, so that everything lies
inside. Then they move in, halfway at a time, until a point would come through one of their faces.

Kernel: `core/coordinate_descent.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.baking.cage.points import OuterPoints, find_outer_points
from texbake.baking.reach import LEAST_EXTENT
from texbake.core import core
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame, UnitGrid
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.weld import weld_rows

_SWEEPS = 60


@dataclass(frozen=True, eq=False)
class Cage:
    """A cage and how well it fits.

    Attributes
    ----------
    mesh : Mesh
        Faces and texture coordinates of the low-poly mesh, with the positions of the cage.
    distances : (V,) float64
        How far each vertex was moved along its smooth normal, in model units.
    n_points : int
        Points of the high-poly surface outside the low-poly mesh that the cage was fitted to.
    n_beside : int
        Points beside the border of an open low-poly mesh, which no cage of it can enclose.
    n_uncertain : int
        Points over folds of the low-poly mesh: the corners there move out as far as the points, but
        the points may still come through.
    greatest_outside : float
        How far the farthest of the other points lies outside the cage, in model units; 0 if all are
        inside.
    n_still : int
        Vertices that stay in place: no face around them has an area, so they have no normal.
    """

    mesh: Mesh
    distances: FloatArray
    n_points: int
    n_beside: int
    n_uncertain: int
    greatest_outside: float
    n_still: int = 0

    @property
    def warnings(self) -> list[str]:
        """Parts of the high-poly surface that the cage does not enclose, one sentence each."""
        lines = []
        if self.greatest_outside > 0.0:
            lines.append(
                f"{self.mesh.name}: the high-poly surface comes out of it by up to "
                f"{self.greatest_outside:.3g}, where the low-poly mesh is folded; repair it there, "
                "or give a `margin`"
            )
        if self.n_beside:
            lines.append(
                f"{self.mesh.name}: {self.n_beside:,} points lie beside the border of the "
                "low-poly mesh, where it has no cage; extend the low-poly mesh to bake them"
            )
        if self.n_still:
            lines.append(
                f"{self.mesh.name}: {self.n_still:,} of its vertices stay in place, because "
                "no face around them has an area; repair the low-poly mesh there"
            )
        return lines

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        rows = [
            ("vertices", f"{len(self.distances):,}"),
            (
                "moved by",
                f"{np.median(self.distances):.4g} (median), {self.distances.min():.4g} to "
                f"{self.distances.max():.4g}",
            ),
            ("fitted to", f"{self.n_points:,} points of the high-poly mesh"),
        ]
        if self.n_uncertain:
            rows.append(("over folds", f"{self.n_uncertain:,} points, which may come through"))
        return rows


def fit_cage(
    high: MeshLike, low: MeshLike, *, margin: float | None = None, threads: int | None = None
) -> Cage:
    """Fit a cage: the low-poly mesh inflated just enough to enclose the high-poly mesh.

    No part of the high-poly surface lies outside the cage, and no vertex could move farther in on
    its own without letting some of it through. Vertices move along smooth normals, those at one
    position together, so that the cage has no gaps. `Cage.warnings` names the exceptions: folds and
    open borders of the low-poly mesh.

    Parameters
    ----------
    high, low
        The meshes of a bake; the low-poly mesh needs no texture coordinates.
    margin
        Distance in model units that is added everywhere. None for 1e-4 of the size of both meshes,
        which is above the rounding of float32 rays.
    threads
        None for one per core.

    Returns
    -------
    Cage
        The same, byte for byte, for any number of threads.

    Raises
    ------
    OptionError
        The margin is below 0 or not finite.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> fit_cage(plane(), plane(), margin=0.5).distances.tolist()
    [0.5, 0.5, 0.5, 0.5]
    """
    high, low = as_mesh(high), as_mesh(low)
    if margin is not None and not 0.0 <= margin < np.inf:
        raise OptionError(f"margin: {margin} is not a distance; give 0 or more")
    grid = UnitGrid.around(high, low)
    snapped = low.replace(positions=grid.to_grid(low.positions))
    firsts = weld_rows(low.positions)
    welded = snapped.replace(faces=firsts[low.faces], tangents=None)
    fitted = smooth_normals(snapped)
    points = find_outer_points(
        high.replace(positions=grid.to_grid(high.positions)),
        welded,
        fitted,
        LocalFrame(np.zeros(3), 1.0),
        threads=threads,
    )
    held = points.where(points.faces >= 0)
    distances, outside = _fitted_distances(welded.positions, welded.faces, fitted, held)
    added = LEAST_EXTENT if margin is None else float(grid.length_to_grid(margin))
    moved = grid.length_to_model(distances[firsts] + added)
    normals = smooth_normals(low)
    has_normal = (normals != 0.0).any(axis=1)
    moved = np.where(has_normal, moved, 0.0)
    mesh = low.replace(
        positions=low.positions + moved[:, None] * normals,
        normals=None,
        normal_faces=None,
        tangents=None,
        name=f"cage of {low.name}",
    )
    left = max(float(grid.length_to_model(outside - added)), 0.0)
    n_uncertain = int(np.count_nonzero(~held.exact))
    n_still = len(np.unique(low.faces[~has_normal[low.faces]]))
    return Cage(mesh, moved, len(held), len(points) - len(held), n_uncertain, left, n_still)


def _fitted_distances(
    positions: FloatArray, faces: IntArray, normals: FloatArray, points: OuterPoints
) -> tuple[FloatArray, float]:
    """Distance of each vertex, and how far the farthest point lies outside, in local units."""
    starts = np.zeros(len(positions))
    for corner in range(3):
        np.maximum.at(starts, faces[points.faces, corner], points.heights)
    floors = np.zeros(len(positions))
    uncertain = points.where(~points.exact)
    for corner in range(3):
        np.maximum.at(floors, faces[uncertain.faces, corner], uncertain.heights)
    exact = points.where(points.exact)
    by_face = np.argsort(exact.faces, kind="stable")
    first_points = np.searchsorted(exact.faces[by_face], np.arange(len(faces) + 1))
    order = np.argsort(faces.ravel(), kind="stable")
    first_corners = np.searchsorted(faces.ravel()[order], np.arange(len(positions) + 1))
    distances = starts.copy()
    outside = core.fit_cage(
        positions, faces, normals, exact.positions[by_face], first_points, order, first_corners,
        floors, 2.0 * starts, _SWEEPS, distances,
    )  # fmt: skip
    return distances, float(outside)
