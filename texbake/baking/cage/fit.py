"""The cage itself: each vertex as near as the points over its faces let it.

All vertices start as far out as the highest point over any of their faces, which holds everything.
Then each goes in, halfway at a time, to where one of the points would come through a face, until
none can. A point is held by a face if it lies behind its plane, and that is linear in the distance
of each corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texbake.baking.cage.points import OuterPoints, outer_points
from texbake.baking.scenes import LEAST_EXTENT
from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.weld import weld_rows

_SWEEPS = 60
# Share of a point's weight under which a corner leaves it to the two others: their side holds it,
# and what this corner does there is rounding.
_LEAST_WEIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class Cage:
    """A cage and how it fits.

    Attributes
    ----------
    mesh : Mesh
        The light mesh's faces and texture coordinates with other positions.
    distances : (V,) float64
        How far each vertex was moved along its smooth normal, in model units.
    n_points : int
        Points of the dense surface, outside the light one, that it was fitted to.
    n_beside : int
        Points beside the border of an open light mesh, which no cage of it can hold.
    n_uncertain : int
        Points over folds of the light mesh: the corners there go as far out as the points do, but
        nothing says that these are inside.
    greatest_outside : float
        How far the farthest of the others lies outside the cage, in model units; 0 if none does.
    n_still : int
        Vertices that have no normal, as all faces around them are without area, and stay.
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
        """What the cage does not hold, one line each."""
        lines = []
        if self.greatest_outside > 0.0:
            lines.append(
                f"{self.mesh.name}: the dense surface comes out of it by up to "
                f"{self.greatest_outside:.3g}, where the light mesh is folded; mend it there, or "
                "give a --margin"
            )
        if self.n_beside:
            lines.append(
                f"{self.mesh.name}: {self.n_beside:,} points lie beside the border of the light "
                "mesh, where no cage of it reaches"
            )
        if self.n_still:
            lines.append(
                f"{self.mesh.name}: {self.n_still:,} of its vertices stay in their place, as "
                "no face around them has an area; mend the light mesh there"
            )
        return lines

    def table(self) -> list[tuple[str, str]]:
        """What a person wants to know: (what, figures)."""
        rows = [
            ("vertices", f"{len(self.distances):,}"),
            (
                "moved by",
                f"{np.median(self.distances):.4g} in the middle, {self.distances.min():.4g} to "
                f"{self.distances.max():.4g}",
            ),
            ("fitted to", f"{self.n_points:,} points of the dense mesh"),
        ]
        if self.n_uncertain:
            rows.append(("over folds", f"{self.n_uncertain:,} points, which may come through"))
        return rows


def fit_cage(
    high: MeshLike, low: MeshLike, *, margin: float | None = None, threads: int | None = None
) -> Cage:
    """Make a cage: a light mesh blown up around a dense one, no farther than it must.

    No part of the dense surface lies outside it, and no vertex could be moved in by itself without
    that some did. Vertices move along smooth normals, those of one position together, so that the
    cage cannot tear.

    Parameters
    ----------
    margin
        Model units added everywhere. None: 1e-4 of the size of both meshes, above the rounding of
        float32 rays.

    Returns
    -------
    Cage

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
        raise OptionError(f"margin: {margin} is no distance; it must be 0 or more")
    frame = LocalFrame.around(high, low)
    firsts = weld_rows(low.positions)
    welded = low.replace(faces=firsts[low.faces], tangents=None)
    normals = smooth_normals(low)
    points = outer_points(high, welded, normals, frame, threads=threads)
    held = points.where(points.faces >= 0)
    positions = frame.to_local(low.positions)
    distances, outside = _fitted(positions, welded.faces, normals, held)
    added = LEAST_EXTENT if margin is None else float(frame.length_to_local(margin))
    moved = frame.length_to_model(distances[firsts] + added)
    has_normal = (normals != 0.0).any(axis=1)
    moved = np.where(has_normal, moved, 0.0)
    mesh = low.replace(
        positions=low.positions + moved[:, None] * normals,
        normals=None,
        normal_faces=None,
        tangents=None,
        name=f"cage of {low.name}",
    )
    left = max(float(frame.length_to_model(outside - added)), 0.0)
    n_uncertain = int(np.count_nonzero(~held.exact))
    n_still = len(np.unique(low.faces[~has_normal[low.faces]]))
    return Cage(mesh, moved, len(held), len(points) - len(held), n_uncertain, left, n_still)


def _fitted(
    positions: FloatArray, faces: IntArray, normals: FloatArray, points: OuterPoints
) -> tuple[FloatArray, float]:
    """Distance of each vertex, and how far a point still lies outside, in local units."""
    starts = np.zeros(len(positions))
    for corner in range(3):
        np.maximum.at(starts, faces[points.faces, corner], points.heights)
    floors = np.zeros(len(positions))
    vague = points.where(~points.exact)
    for corner in range(3):
        np.maximum.at(floors, faces[vague.faces, corner], vague.heights)
    exact = points.where(points.exact)
    by_face = np.argsort(exact.faces, kind="stable")
    first_points = np.searchsorted(exact.faces[by_face], np.arange(len(faces) + 1))
    order = np.argsort(faces.ravel(), kind="stable")
    first_corners = np.searchsorted(faces.ravel()[order], np.arange(len(positions) + 1))
    distances = starts.copy()
    outside = _fit_kernel(
        (positions, faces, normals),
        (exact.positions[by_face], first_points),
        (order, first_corners),
        (floors, 2.0 * starts),
        _SWEEPS,
        distances,
    )
    return distances, float(outside)


@kernel
def _fit_kernel(light, points, around, limits, n_sweeps, distances):  # type: ignore[no-untyped-def]
    positions, faces, normals = light
    order, first_corners = around
    floors, ceilings = limits
    corners = np.empty((3, 3))
    for sweep in range(n_sweeps):
        greatest = 0.0
        for vertex in range(len(distances)):
            bound = floors[vertex]
            for at in range(first_corners[vertex], first_corners[vertex + 1]):
                face, corner = order[at] // 3, order[at] % 3
                _corners_kernel(face, positions, faces, normals, distances, corners)
                needed = _needed_kernel(
                    face, corner, corners, normals[vertex], distances[vertex], points
                )
                bound = max(bound, needed)
            bound = min(bound, ceilings[vertex])
            change = bound - distances[vertex]
            if change < 0.0 and sweep < n_sweeps - 1:
                change *= 0.5
            distances[vertex] += change
            greatest = max(greatest, abs(change))
        if greatest < 1e-9:
            break
    return _outside_kernel(positions, faces, normals, distances, points, corners)


@kernel
def _corners_kernel(face, positions, faces, normals, distances, corners):  # type: ignore[no-untyped-def]
    for corner in range(3):
        vertex = faces[face, corner]
        for axis in range(3):
            moved = distances[vertex] * normals[vertex, axis]
            corners[corner, axis] = positions[vertex, axis] + moved


@kernel
def _area_vector_kernel(a, b, c):  # type: ignore[no-untyped-def]
    x0, y0, z0 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    x1, y1, z1 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1


@kernel
def _needed_kernel(face, corner, corners, normal, distance, points):  # type: ignore[no-untyped-def]
    """Distance of a corner at which the last point over its face comes through."""
    positions, first_points = points
    after, last = corners[(corner + 1) % 3], corners[(corner + 2) % 3]
    here = corners[corner]
    x, y, z = _area_vector_kernel(here, after, last)
    least_slope = _LEAST_WEIGHT * np.sqrt(x * x + y * y + z * z)
    needed = -np.inf
    for i in range(first_points[face], first_points[face + 1]):
        # Volume of the point and the two other corners, over which this corner's side lies.
        x, y, z = _area_vector_kernel(positions[i], after, last)
        slope = x * normal[0] + y * normal[1] + z * normal[2]
        volume = (
            x * (here[0] - positions[i, 0])
            + y * (here[1] - positions[i, 1])
            + z * (here[2] - positions[i, 2])
        )
        if slope > least_slope:
            needed = max(needed, distance - volume / slope)
    return needed


@kernel
def _outside_kernel(positions, faces, normals, distances, points, corners):  # type: ignore[no-untyped-def]
    """How far the farthest point lies in front of the face over it."""
    places, first_points = points
    farthest = 0.0
    for face in range(len(faces)):
        if first_points[face] == first_points[face + 1]:
            continue
        _corners_kernel(face, positions, faces, normals, distances, corners)
        x, y, z = _area_vector_kernel(corners[0], corners[1], corners[2])
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            continue
        for i in range(first_points[face], first_points[face + 1]):
            height = (
                x * (places[i, 0] - corners[0, 0])
                + y * (places[i, 1] - corners[0, 1])
                + z * (places[i, 2] - corners[0, 2])
            ) / length
            farthest = max(farthest, height)
    return farthest
