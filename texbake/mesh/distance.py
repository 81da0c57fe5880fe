"""How far two surfaces lie apart, measured both ways at sampled points.

Based on: Paolo Cignoni, Claudio Rocchini, Roberto Scopigno, "Metro: measuring error on simplified
surfaces", Computer Graphics Forum 17(2), 1998 (sampling one surface, closest points on the other,
the worse of both ways); Martin Roberts, "The unreasonable effectiveness of quasirandom sequences",
2018 (the points within a face).

Departs from Metro in taking one sample in each of many equal steps of area, so that no face is
forgotten and each sample represents the same area.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands
from texbake.records import dataclass

_DEFAULT_SAMPLES = 100_000
REPORTED_SAMPLES = 10_000  # where a distance is only reported
# Boxes that the searches of one surface may look at; at a point this many are always allowed. Where
# triangles lie across one another by the ten thousand, so that each search looks at most of them,
# fewer samples are taken.
_BOXES_ALLOWED, _BOXES_AT_A_POINT = 4e7, 400.0

# The distance peaks at edges that bridge a valley, up to a tenth above the samples nearby. Of the
# faces with the farthest samples, this many get this many more points on each edge.
_FARTHEST, _FACES_OF_PEAKS, _POINTS_ON_AN_EDGE = 4096, 256, 15

# 1 / g and 1 / g² for g³ = g + 1: Roberts's sequence in two dimensions.
_STEPS_2D = (0.7548776662466927, 0.5698402909980532)


@dataclass(frozen=True, kw_only=True)
class OneSidedDistance:
    """From the points of one surface to the closest points of another, in model units.

    `mean`, `rms` and `p99` are over samples of equal area, `max` also over vertices and edges.
    `n_left_out` would each have taken too long. `rms` is within `rms_error` in 19 of 20 cases.
    """

    max: float
    p99: float
    rms: float
    rms_error: float
    mean: float
    n_samples: int
    n_left_out: int

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        if not self.n_left_out:
            return ()
        return (
            f"the distance was measured at {self.n_samples:,} points of the surface instead of "
            f"{self.n_samples + self.n_left_out:,}, because too many triangles lie across one "
            "another; it may be greater in between",
        )


@dataclass(frozen=True, kw_only=True)
class SurfaceDistance:
    """Distance between two surfaces; each figure is the worse of both ways, in model units."""

    a_to_b: OneSidedDistance
    b_to_a: OneSidedDistance
    diagonal: float  # of the joint bounding box; what the `_relative` figures are relative to

    @property
    def max(self) -> float:
        """Greatest distance found: the Hausdorff distance, seen through the samples."""
        return max(self.a_to_b.max, self.b_to_a.max)

    @property
    def rms(self) -> float:
        """Root mean square distance."""
        return max(self.a_to_b.rms, self.b_to_a.rms)

    @property
    def rms_error(self) -> float:
        """Sampling error of `rms`; see `OneSidedDistance`."""
        return max(self.a_to_b, self.b_to_a, key=lambda side: side.rms).rms_error

    @property
    def mean(self) -> float:
        """Mean distance."""
        return max(self.a_to_b.mean, self.b_to_a.mean)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        return min(self.a_to_b, self.b_to_a, key=lambda side: side.n_samples).notes

    @property
    def max_relative(self) -> float:
        """`max` as a fraction of the diagonal."""
        return self._relative(self.max)

    @property
    def rms_relative(self) -> float:
        """`rms` as a fraction of the diagonal."""
        return self._relative(self.rms)

    @property
    def mean_relative(self) -> float:
        """`mean` as a fraction of the diagonal."""
        return self._relative(self.mean)

    def _relative(self, length: float) -> float:
        return length / self.diagonal if self.diagonal > 0.0 else 0.0


def surface_distance(
    a: MeshLike,
    b: MeshLike,
    *,
    n_samples: int = _DEFAULT_SAMPLES,
    seed: int = 0,
    threads: int | None = None,
) -> SurfaceDistance:
    """Measure how far two surfaces lie apart, both ways.

    Parameters
    ----------
    a, b
        In one space.
    n_samples
        Points on each surface, at equal steps of area, for the mean. For the maximum as many of its
        vertices are added, at equal steps of their list where it has more. Fewer where so many
        triangles lie across one another that each search would look at thousands of them; the
        notes of the result say so.
    seed
        Moves the samples.
    threads
        None for every processor. The result does not depend on it.

    Raises
    ------
    OptionError
        `n_samples` is below 1.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> low = plane()
    >>> high = low.replace(positions=low.positions + [0.0, 0.0, 0.25])
    >>> surface_distance(low, high).max
    0.25
    """
    a, b = as_mesh(a), as_mesh(b)
    if n_samples < 1:
        raise OptionError(f"n_samples: {n_samples} is too few; it must be at least 1")
    frame = LocalFrame.around(a, b)
    bounds = np.stack([a.bounds, b.bounds])
    diagonal = pm.norm(frame.length_to_local(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))
    places = frame.to_local(a.positions), frame.to_local(b.positions)
    return SurfaceDistance(
        a_to_b=_one_sided(frame, (a, b), places, n_samples, seed, threads),
        b_to_a=_one_sided(frame, (b, a), places[::-1], n_samples, seed, threads),
        diagonal=float(frame.length_to_model(diagonal)),
    )


def distance_to(
    mesh: Mesh, target: Mesh, *, n_samples: int = REPORTED_SAMPLES, threads: int | None = None
) -> OneSidedDistance:
    """Measure how far the points of a mesh lie from another, one way."""
    frame = LocalFrame.around(mesh, target)
    places = frame.to_local(mesh.positions), frame.to_local(target.positions)
    return _one_sided(frame, (mesh, target), places, n_samples, 0, threads)


def _one_sided(
    frame: LocalFrame,
    meshes: tuple[Mesh, Mesh],
    places: tuple[FloatArray, FloatArray],
    n_samples: int,
    seed: int,
    threads: int | None,
) -> OneSidedDistance:
    """From the first mesh to the second, whose positions in the frame are `places`."""
    (positions, to_positions), faces = places, meshes[0].faces
    tree = TriangleTree.for_points(n_samples, to_positions, meshes[1].faces, threads=threads)
    n = samples_allowed(tree, n_samples)
    face_ids, barycentrics = spread_samples(positions, faces, n, seed, threads)
    samples = _points_on(positions, faces, face_ids, barycentrics)
    of_samples = tree.closest_points(samples, threads=threads)[0]
    farthest = np.argsort(-of_samples, kind="stable")[:_FARTHEST]
    n_peaks = _FACES_OF_PEAKS
    if n < n_samples:  # the search is bounded
        n_peaks = min(n_peaks, max(n // (3 * _POINTS_ON_AN_EDGE), 1))
    firsts = np.sort(np.unique(face_ids[farthest], return_index=True)[1])[:n_peaks]
    peaks = _points_on_edges(positions, faces[face_ids[farthest[firsts]]])
    most = of_samples.max()
    for points in (peaks, _some_vertices(positions, faces, n)):
        most = max(most, tree.closest_points(points, enough=most, threads=threads)[0].max())
    squares = np.square(of_samples)
    rms = np.sqrt(squares.mean())
    figures = {
        "max": most,
        "p99": np.quantile(of_samples, 0.99),
        "rms": rms,
        # Two standard errors of independent samples; those of equal steps of area lie closer.
        "rms_error": squares.std() / (np.sqrt(n) * rms) if rms > 0.0 else 0.0,
        "mean": of_samples.mean(),
    }
    lengths = {name: float(frame.length_to_model(figure)) for name, figure in figures.items()}
    return OneSidedDistance(**lengths, n_samples=n, n_left_out=n_samples - n)


def samples_allowed(tree: TriangleTree, n_samples: int) -> int:
    """How many samples may look for their closest points in a tree, at most those wanted."""
    boxes = max(_BOXES_ALLOWED, _BOXES_AT_A_POINT * n_samples)
    return min(n_samples, max(int(boxes / tree.boxes_at_a_point()), 1))


def sample_surface(
    mesh: Mesh, n: int, seed: int = 0, *, threads: int | None = None
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Points in equal steps of area, in order of faces, with face ids and barycentrics."""
    if n < 1:
        raise OptionError(f"n: {n} is too few; it must be at least 1")
    local = LocalFrame.around(mesh).to_local(mesh.positions)
    face_ids, barycentrics = spread_samples(local, mesh.faces, n, seed, threads)
    return _points_on(mesh.positions, mesh.faces, face_ids, barycentrics), face_ids, barycentrics


def sample_points(
    positions: FloatArray, faces: IntArray, n: int, *, threads: int | None = None
) -> FloatArray:
    """(n, 3) float64: points in equal steps of the area of faces, of about unit size."""
    face_ids, barycentrics = spread_samples(positions, faces, n, 0, threads)
    return _points_on(positions, faces, face_ids, barycentrics)


def spread_samples(
    positions: FloatArray, faces: IntArray, n: int, seed: int, threads: int | None
) -> tuple[IntArray, FloatArray]:
    """Face and barycentrics of each sample, by `core/pcg64.c`; positions of about unit size."""
    random = np.empty(n + 2)
    core.draw_uniform(seed, random)
    steps = np.arange(n)
    sums = np.cumsum(face_areas(positions, faces, threads=threads))
    if sums[-1] > 0.0:
        # A face takes the samples from the sum before it up to, not including, its own; so a
        # face without area takes none.
        face_ids = np.searchsorted(sums, (steps + random[:n]) * (sums[-1] / n), side="right")
        last = np.searchsorted(sums, sums[-1])  # rounding may carry a sample past the last area
        face_ids = np.minimum(face_ids, last)
    else:
        face_ids = steps * len(faces) // n
    s, t = ((start + steps * step) % 1.0 for start, step in zip(random[n:], _STEPS_2D, strict=True))
    folded = s + t > 1.0  # the unit square's upper half onto the lower
    s[folded], t[folded] = 1.0 - s[folded], 1.0 - t[folded]
    # 1 - s - t may round to just below 0.
    barycentrics = np.stack([np.clip(1.0 - s - t, 0.0, None), s, t], axis=1)
    return face_ids.astype(np.int32), barycentrics


def face_areas(positions: FloatArray, faces: IntArray, *, threads: int | None = None) -> FloatArray:
    """(F,) areas of triangles. Kernel: `core/triangle_tree.c`."""
    areas = np.empty(len(faces))
    positions = np.ascontiguousarray(positions, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int32)

    def work(start: int, stop: int) -> None:
        core.measure_areas(positions, faces, start, stop, areas)

    run_bands(work, len(faces), band=1 << 16, threads=threads)
    return areas


def area_vectors(positions: FloatArray, faces: IntArray) -> FloatArray:
    """(..., 3) normals of triangles (..., 3), twice as long as their areas."""
    a, b, c = (positions[faces[..., corner]] for corner in range(3))
    return np.cross(b - a, c - a)


def unit_normals(positions: FloatArray, faces: IntArray) -> FloatArray:
    """(F, 3) normals of triangles, 0 without area."""
    crosses = area_vectors(positions, faces)
    return np.asarray(crosses / np.maximum(pm.norm(crosses, axis=1, keepdims=True), 1e-300))


def _points_on(
    positions: FloatArray, faces: IntArray, face_ids: IntArray, barycentrics: FloatArray
) -> FloatArray:
    return np.asarray(pm.vecmat(barycentrics, positions[faces[face_ids]]))


def _points_on_edges(positions: FloatArray, faces: IntArray) -> FloatArray:
    """Points at even steps within each edge of some faces."""
    corners = positions[faces]
    steps = np.arange(1, _POINTS_ON_AN_EDGE + 1) / (_POINTS_ON_AN_EDGE + 1)
    steps = steps[:, np.newaxis, np.newaxis, np.newaxis]
    return ((1.0 - steps) * corners + steps * np.roll(corners, -1, axis=1)).reshape(-1, 3)


def _some_vertices(positions: FloatArray, faces: IntArray, at_most: int) -> FloatArray:
    """Positions that faces use, at even steps if there are more than `at_most`."""
    used = np.zeros(len(positions), dtype=bool)
    used[faces.ravel()] = True
    ids = np.flatnonzero(used)
    if len(ids) > at_most:
        ids = ids[np.arange(at_most) * len(ids) // at_most]
    return positions[ids]
