"""How long edges of a surface that is to be displaced are in a picture.

What is told is how long an edge would be if it were seen from the side, so that what stands up from
a surface that is seen edge-on is not lost:

    f |ab| max(1/cos a, 1/cos b) / min(z_a, z_b)

with z the depth, f the distance of the picture in pixels and a and b the angles of sight off its
axis. That is no less than the distance of the points in the picture, because depth is linear along
an edge and the cone of directions within an angle is convex. It is asked for the edge on the
surface and for the edge where the map moves it, and the larger counts. Of triangles no part of
which can be moved into the picture nothing is asked.

Based on: Cantlay, "DirectX 11 terrain tessellation", NVIDIA, 2011, for a length that does not
depend on how an edge is turned.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.rendering.camera import Camera
from texbake.rendering.displaced import Displaced, texel_lengths
from texbake.rendering.options import RenderOptions

# Vertices or edges a band.
_BAND = 1 << 15


class EdgeView:
    """A camera and a picture, as they look at the edges of a surface.

    Parameters
    ----------
    camera
        Where the picture is taken from.
    options
        `width` and `height` are taken from them.
    edge_px
        Longest edge that is short enough, in pixels.
    reach
        Farthest that a point is moved, in world space.
    """

    def __init__(
        self, camera: Camera, options: RenderOptions, edge_px: float, reach: float
    ) -> None:
        tall = math.tan(camera.fov / 2)
        wide = tall * options.width / options.height
        x, y, z, w = camera.clip_from_world(options.width / options.height)
        self._camera = camera
        self._edge_px = edge_px
        self._focal = options.height / (2.0 * tall)
        # Greater than 0 inside the picture, by as much as is to its left, right, bottom, top, and
        # between it and the eye.
        self._sides = np.stack([w + x, w - x, w + y, w - y, w - z])
        # How far outside of a side a point must be that is not moved into the picture.
        self._margins = reach * np.linalg.norm(self._sides[:, :3], axis=1)
        # 1 over the cosine of the angle of sight of the picture's corners.
        self._steepest = math.sqrt(1.0 + wide * wide + tall * tall)

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): world length, at points, of the shortest pieces: half of `edge_px` pixels."""
        depths = (self._camera.eye - points) @ self._camera.axes[2]
        nearest = np.maximum(depths, self._camera.near)
        return np.asarray(nearest * (0.5 * self._edge_px / self._focal))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """How many times longer edges are than they may be.

        Parameters
        ----------
        now
            A surface, as finely as it has been cut.
        texels : (F, 3, 2) float64, optional
            As in `texel_lengths`.
        threads
            None for every processor.

        Returns
        -------
        (E,) float64
            0 where an edge needs no cut, because it spans at most a texel or is not seen.
        """
        n = len(now.points)
        outside, nearest, slants = np.empty(n, np.uint8), np.empty(n), np.empty(n)

        def look(start: int, stop: int) -> None:
            _view_kernel(
                now.points, now.positions, self._camera.eye, self._camera.axes[2],
                self._camera.near, self._steepest, self._sides, self._margins,
                outside, nearest, slants, start, stop,
            )  # fmt: skip

        run_bands(look, n, band=_BAND, threads=threads)
        spans = texel_lengths(now.pieces, texels, outside)
        out = np.empty(len(spans))

        def measure(start: int, stop: int) -> None:
            _excess_kernel(
                now.pieces.ends, now.points, now.positions, nearest, slants, spans,
                self._focal / self._edge_px, out, start, stop,
            )  # fmt: skip

        run_bands(measure, len(out), band=_BAND, threads=threads)
        return out


@kernel
def _view_kernel(  # type: ignore[no-untyped-def]
    points, positions, eye, back, near, steepest, sides, margins, outside, nearest, slants,
    start, stop,
):  # fmt: skip
    for i in range(start, stop):
        code = 0
        for side in range(5):
            inside = sides[side, 3]
            for k in range(3):
                inside += sides[side, k] * points[i, k]
            if inside < -margins[side]:
                code |= 1 << side
        outside[i] = code
        nearest[i], slants[i] = np.inf, 1.0
        for place in (points[i], positions[i]):
            depth, squared = 0.0, 0.0
            for k in range(3):
                offset = eye[k] - place[k]
                depth += offset * back[k]
                squared += offset * offset
            if depth > near:
                nearest[i] = min(nearest[i], depth)
                slants[i] = max(slants[i], min(math.sqrt(squared) / depth, steepest))
            else:
                nearest[i], slants[i] = near, steepest


@kernel
def _excess_kernel(ends, points, positions, nearest, slants, texels, scale, out, start, stop):  # type: ignore[no-untyped-def]
    for edge in range(start, stop):
        out[edge] = 0.0
        if not texels[edge] > 1.0:
            continue
        a, b = ends[edge, 0], ends[edge, 1]
        along, moved = 0.0, 0.0
        for k in range(3):
            along += (points[a, k] - points[b, k]) ** 2
            moved += (positions[a, k] - positions[b, k]) ** 2
        length = math.sqrt(max(along, moved))
        out[edge] = scale * length * max(slants[a], slants[b]) / min(nearest[a], nearest[b])


class MapView:
    """How long edges may be from wherever they are seen: a texel of the map."""

    def widths(self, points: FloatArray) -> FloatArray:
        """(n,): 0, so that maps are read as finely as they are."""
        return np.zeros(len(points))

    def excess(
        self, now: Displaced, texels: FloatArray | None, *, threads: int | None = None
    ) -> FloatArray:
        """(E,): how many texels each edge spans."""
        return texel_lengths(now.pieces, texels, np.zeros(len(now.points), np.uint8))
