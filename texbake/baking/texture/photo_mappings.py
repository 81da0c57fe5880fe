"""Where points of a mesh appear in a photograph, and how much the photograph counts there.

A camera shows what faces it, what lies inside its frame and what no other part of the mesh hides.
A mesh with texture coordinates in the photograph gives no direction: there a face counts by the
area it takes of the photograph, relative to its size on the surface. In a photograph taken from far
away that is the cosine of the viewing angle.

Kernel: `core/projected_pictures.c`.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.baking.texels import SampleGrid, Samples
from texbake.baking.texture.canvas import sample_steps
from texbake.baking.texture.options import PhotoOptions
from texbake.core import core, portable_math as pm
from texbake.errors import OptionError
from texbake.mapping.classical.projector import seen_from_of
from texbake.mapping.corner_uvs import measurable_uvs, signed_areas, surface_areas
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene
from texbake.records import dataclass

# Points per band: some milliseconds of work.
_BAND = 1 << 15

# Occlusion rays towards a camera farther away than this start here, just outside the mesh, since
# float32 rays from far away have few digits left where they arrive. Local units.
_OUTSIDE = 2.0

# Surfaces nearer to a point than this do not hide it. Local units: 100 times the error of a float32
# ray two units long, so that a surface does not hide itself at the angles at which photographs
# count.
_CONTACT = 2.0**-16

# Depth over distance across the view of the steepest surface that counts as continuous: 83 degrees.
# Anything steeper between a point and the pixels around it is an occluder in front of it.
_MARGIN_SLOPE = 8.0


@dataclass(frozen=True, eq=False)
class PhotoLookups:
    """Where some of the samples of a mesh appear in one photograph."""

    # (m,) int64; indices of the samples that the photograph shows, ascending.
    ids: Int64Array
    coordinates: FloatArray  # (m, 2) float64; UV coordinates in the photograph, v up
    # (m, 4) float32; du/dx, dv/dx, du/dy, dv/dy with x and y in samples of the baked texture.
    derivatives: Float32Array
    weights: FloatArray  # (m,) float64; above 0, up to 1


def hidden_points(
    scene: RayScene,
    points: FloatArray,
    faces: IntArray,
    seen_from: FloatArray,
    slack: FloatArray | float = 0.0,
) -> BoolArray:
    """Find the points of a mesh that have its own surface between them and the camera.

    `points` (n, 3) float64, in local units; `faces` (n,) int32: those that the points lie on;
    `seen_from` (4,): a camera (x, y, z, 1) or direction (x, y, z, 0); `slack`: surfaces nearer to a
    point than this do not hide it.
    """
    towards = seen_from[:3] - seen_from[3] * points
    distances = np.sqrt(pm.vecdot(towards, towards))
    towards /= np.where(distances > 0.0, distances, 1.0)[:, None]
    lengths = np.minimum(distances, _OUTSIDE) if seen_from[3] else np.full(len(points), _OUTSIDE)
    rays = Rays(
        points + lengths[:, None] * towards,
        -towards,
        np.maximum(lengths - _CONTACT - slack, 0.0),
        lengths,
    )
    hit_faces = scene.cast(rays, cull_back_faces=False).faces
    return np.asarray((hit_faces != NO_HIT) & (hit_faces != faces))


class CameraMapping:
    """Projects points into a photograph through its camera, without those near outlines.

    `matrix` (4, 4): local space to (s, t, r, q); `occluders`: the mesh, or None; `margins` around
    what hides others: width and height in the unit square.
    """

    def __init__(
        self,
        mesh: Mesh,
        matrix: FloatArray,
        frame: LocalFrame,
        grid: SampleGrid,
        options: PhotoOptions,
        occluders: RayScene | None,
        margins: tuple[float, float],
    ) -> None:
        self._seen_from = seen_from_of(matrix)
        self._matrix = np.ascontiguousarray(matrix[[0, 1, 3]])
        corners = frame.to_local(mesh.positions)[mesh.faces]
        self._margin_steps = _margin_steps(self._matrix, self._seen_from, margins)
        self._steps = pm.matmul(self._matrix[:, :3], sample_steps(mesh, corners, grid))
        self._face_normals = face_normals(mesh)
        self._least_cosine = pm.cos(math.radians(options.max_angle))
        self._options = options
        self._occluders = occluders

    def look_up(self, samples: Samples, rays: Rays) -> PhotoLookups:
        """Project samples with their rays, but none behind, out of frame, turned away or hidden."""
        n, normals = len(samples), -rays.directions
        coordinates, weights = np.empty((n, 2)), np.empty(n)
        derivatives = np.empty((n, 4), np.float32)

        def project(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.weigh_by_camera(
                samples.faces[band], rays.origins[band], normals[band],
                self._matrix, self._seen_from, self._face_normals, self._steps,
                self._least_cosine, self._options.falloff, self._options.feather,
                coordinates[band], derivatives[band], weights[band],
            )  # fmt: skip

        run_bands(project, n, band=_BAND, threads=self._options.threads)
        ids = self._select_visible(samples.faces, rays.origins, np.flatnonzero(weights))
        return PhotoLookups(ids, coordinates[ids], derivatives[ids], weights[ids])

    def _select_visible(self, faces: IntArray, points: FloatArray, ids: Int64Array) -> Int64Array:
        """Those of some points that are visible, as are the four corners of the margin around."""
        scene, seen_from = self._occluders, self._seen_from
        if scene is None:
            return ids
        ids = ids[~hidden_points(scene, points[ids], faces[ids], seen_from)]
        if not self._margin_steps.any():
            return ids
        for across, up in (-1, -1), (1, -1), (-1, 1), (1, 1):
            positions = points[ids]
            depths = pm.matmul(positions, self._matrix[2, :3]) + self._matrix[2, 3]
            step = across * self._margin_steps[:, 0] + up * self._margin_steps[:, 1]
            slack = _MARGIN_SLOPE * pm.norm(step) * depths
            beside = positions + depths[:, None] * step
            ids = ids[~hidden_points(scene, beside, faces[ids], seen_from, slack)]
        return ids


def _margin_steps(
    matrix: FloatArray, seen_from: FloatArray, margins: tuple[float, float]
) -> FloatArray:
    """(3, 2) float64: how far a point at depth 1 moves across the view by each margin."""
    rows = np.stack(
        [matrix[0, :3], matrix[1, :3], matrix[2, :3] if seen_from[3] else seen_from[:3]]
    )
    return np.asarray(pm.inv(rows)[:, :2] * margins)


class UvMapping:
    """Looks points up in a photograph through the texture coordinates of another mesh."""

    def __init__(self, mesh: Mesh, mapped: Mesh, grid: SampleGrid, options: PhotoOptions) -> None:
        if mapped.n_faces != mesh.n_faces:
            raise OptionError(
                f"{mapped.name}: it has {mapped.n_faces:,} faces where {mesh.name} has "
                f"{mesh.n_faces:,}; give a mesh with the same faces in the same order"
            )
        self._corners = mapped.corner_uvs()
        self._steps = sample_steps(mesh, self._corners, grid)
        self._facing = _facing_by_area(mesh, mapped)
        self._options = options

    def look_up(self, samples: Samples, rays: Rays) -> PhotoLookups:
        """Look samples up; leave out those outside the photograph or without area in it."""
        n = len(samples)
        coordinates, weights = np.empty((n, 2)), np.empty(n)

        def look_up(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.weigh_by_area(
                samples.faces[band], samples.barycentrics[band], self._corners, self._facing,
                self._options.falloff, self._options.feather, coordinates[band], weights[band],
            )  # fmt: skip

        run_bands(look_up, n, band=_BAND, threads=self._options.threads)
        ids = np.flatnonzero(weights)
        derivatives = self._steps[samples.faces[ids]].transpose(0, 2, 1).reshape(-1, 4)
        return PhotoLookups(ids, coordinates[ids], derivatives.astype(np.float32), weights[ids])


def _facing_by_area(mesh: Mesh, mapped: Mesh) -> FloatArray:
    """(F, 3) float64: area in the photograph per surface area, smoothed, 1 for the densest."""
    scale = unit_scale(float(np.abs(mesh.bounds).max()))  # no area is beyond float64
    surface = surface_areas(mesh.positions[mesh.faces] * scale)
    taken = np.abs(signed_areas(measurable_uvs(mapped)))
    used = (taken > 0.0) & (surface > 0.0)
    if not used.any():
        raise OptionError(
            f"{mapped.name}: its texture coordinates cover no area of the photograph; give a mesh "
            "that is unwrapped onto it"
        )
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
