"""Fewer triangles by collapsing edges, as close to the surface as their number allows.

Down to a number of faces, as `reduction` does it, or to the fewest found whose distance from the
mesh, measured on each, stays within an error.

The distance of a simplified surface falls about as its number of faces grows, so the next number to
try is read off the line through two tries, in logarithms. It does not fall at every step: the
number found fits, and one a little smaller does not, but there may be smaller ones that fit again.

Both qualities keep what is a surface a surface, of the same topology. Seams and hard edges are kept
by their topology: a vertex for each side, which move together. Weights for the attributes
themselves changed neither distances nor texture coordinates measurably on real meshes, and are not
used.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from texbake.core import portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.distance import REPORTED_SAMPLES, SurfaceDistance, surface_distance
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.options import MIN_FACES, SimplifyOptions, error_limit
from texbake.mesh.reduction import CUT, SLACK, Reduction, noted, reduced
from texbake.mesh.streamed.reduction import ReducedMesh
from texbake.progress import Progress, Stages
from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.mesh.part_sizes import EnlargedParts

# Share of the diagonal. A point in the middle of a mesh is no further from any of it than this.
_MOST_ERROR = 0.5
_FIRST_FACES = 2_000  # what is tried first for an error
_FEW_FACES = "the mesh has no more faces than requested"


@dataclass(frozen=True, kw_only=True)
class SimplifyReport:
    """Figures of a run of `simplify`."""

    n_faces_before: int  # of the given mesh and of the result
    # `n_faces` is above it where no attempt came down to it, or where the error stopped it
    n_faces_asked: int | None
    # greatest distance allowed, in model units; `distance.max` is no greater
    error_asked: float | None
    n_faces: int
    n_vertices: int  # positions of the result
    quality: str  # as requested
    method: str  # how the result was made
    # what was given up to reach the count, or why it was not reached, and whether the distance was
    # measured at fewer points than usual
    notes: tuple[str, ...]
    distance: SurfaceDistance  # between the mesh given (a) and the result (b)
    seconds: float  # without measuring the distance

    @property
    def reached(self) -> bool:
        """Whether the result has at most the requested number of faces, if one was."""
        return self.n_faces_asked is None or self.n_faces <= self.n_faces_asked

    @property
    def is_close_to_count(self) -> bool:
        """Whether the result has at most 1 % more faces than requested, if a number was."""
        return self.n_faces_asked is None or self.n_faces <= (1.0 + SLACK) * self.n_faces_asked

    @property
    def is_whole(self) -> bool:
        """Whether the count was reached without cutting through surfaces."""
        return self.is_close_to_count and CUT not in self.notes

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        values = asdict(self)
        values["reached"] = self.reached
        values["notes"] = list(self.notes)
        for figure in ("max", "rms", "mean"):
            values["distance"][figure] = getattr(self.distance, figure)
            values["distance"][f"{figure}_relative"] = getattr(self.distance, f"{figure}_relative")
        return values


def simplify(
    mesh: MeshLike,
    n_faces: int | None = None,
    *,
    error: str | float | None = None,
    quality: str = SimplifyOptions.quality,
    seams: str = SimplifyOptions.seams,
    progress: Progress = None,
    threads: int | None = None,
) -> Mesh:
    """Reduce a mesh to few triangles that stay as close to its surface as possible.

    To at most `n_faces`, or to the fewest found whose distance from the mesh is at most `error`, or
    with both to whichever comes first.

    Boundaries, seams of texture coordinates, hard edges (where the mesh's own normals differ at one
    position) and borders between groups are kept, as long as the count can be reached with them.
    Where it cannot, they are given up in this order: a locked boundary, small separate parts, hard
    edges, seams with their attributes. Hard edges also go where over a quarter of the vertices lie
    at them and the surface lies over 1.5 times closer without, and small parts or texture
    coordinates where over 70 % of the vertices lie at seams and the surface lies over 1.5 times
    closer without these parts, or 4 times without these coordinates. Surfaces that meet at
    non-manifold edges are taken apart, and at last cut through at necks and tunnels, where small
    parts vanish. The first of these that brings the result about as close to the mesh as any does
    is taken, and the report of `simplify_with_report` says which. Another surface stays one,
    however its faces are wound: where its tunnels need more faces than `n_faces`, it keeps more.
    Texture coordinates where no face has an area are left out.

    Parameters
    ----------
    mesh
        Any mesh; vertices at bit-equal positions are joined, faces without three distinct
        positions and duplicate faces dropped.
    n_faces
        Number of triangles wanted, at least 4. A mesh with no more than that is returned
        unchanged.
    error
        Greatest distance of the two surfaces, either way: a length in model units, or a percentage
        of the diagonal such as `"0.5%"`. It is measured on the result, as `surface_distance` does
        at its default number of samples. For an error alone, nothing is given up of what is kept.
    quality
        `fast`: a subset of the vertices, bit-equal, with their texture coordinates, hard normals,
        groups and colors. `best`: moved vertices, closer to the surface, and slower. Texture
        coordinates and hard normals follow their vertices, and no face flips in texture
        space; colors, and groups without other seams, are those of the nearest point of the mesh
        given.
    seams
        Of texture coordinates: `auto` keeps them while the count can be reached with them, `keep`
        keeps them and more faces if need be, so that the result fits the same maps, and `drop`
        leaves texture coordinates out, so that no seam is in the way; unwrap the result again.
    progress
        True shows a bar for the running stage; a listener is called with each stage.
    threads
        None for every processor; the result does not depend on it.

    Returns
    -------
    Mesh
        Without tangents, and without normals if no hard edges are left: smooth normals are those
        of the surface that is left.

    Raises
    ------
    OptionError
        `n_faces`, `error`, `quality` or `seams` is not possible, or neither of the first two is
        given. An `error` above half the diagonal is not: it would leave nothing of the mesh.
    MeshError
        The mesh has no face with three distinct positions.

    Examples
    --------
    >>> from texbake.mesh.shapes import icosphere
    >>> simplify(icosphere(4), 500).n_faces
    500
    """
    mesh = as_mesh(mesh)
    options = SimplifyOptions(n_faces=n_faces, error=error, quality=quality, seams=seams)
    return _simplified(mesh, options, Stages(progress), threads).mesh


def simplify_with_report(
    mesh: MeshLike,
    n_faces: int | None = None,
    *,
    error: str | float | None = None,
    quality: str = SimplifyOptions.quality,
    seams: str = SimplifyOptions.seams,
    source: ReducedMesh | None = None,
    shades: float = 0.0,
    importance: FloatArray | None = None,
    parts: EnlargedParts | None = None,
    progress: Progress = None,
    threads: int | None = None,
) -> tuple[Mesh, SimplifyReport]:
    """Simplify, and report the method and the distance, from `source` if it was reduced.

    If it `shades`, the mesh's own normals count as well, and stay, as all its parts do. Errors
    at vertices count by their `importance` (V,) float64. A mesh of enlarged `parts` goes back to
    their size before the distance is measured.
    """
    mesh = as_mesh(mesh)
    stages = Stages(progress)
    start = time.perf_counter()
    options = SimplifyOptions(n_faces=n_faces, error=error, quality=quality, seams=seams)
    result = _simplified(mesh, options, stages, threads, shades, importance, lifts=parts is None)
    low, distance = result.mesh, result.distance
    if parts is not None:
        low, mesh, distance = parts.restored(low), parts.source, None
    seconds = time.perf_counter() - start
    if distance is None:
        with stages.stage("measure distance"):
            distance = measure_distance(source or mesh, low, threads=threads)
    report = SimplifyReport(
        n_faces_before=mesh.n_faces if source is None else source.source.n_faces,
        n_faces_asked=n_faces,
        error_asked=error_limit(error, mesh.diagonal),
        n_faces=low.n_faces,
        n_vertices=low.n_vertices,
        quality=quality,
        method=result.method,
        notes=(*(() if source is None else (source.note,)), *result.notes, *distance.notes),
        distance=distance,
        seconds=seconds,
    )
    return low, report


def measure_distance(
    mesh: Mesh | ReducedMesh, low: Mesh, *, threads: int | None
) -> SurfaceDistance:
    """Measure the distance between a mesh, or one that stays in its file, and what it became."""
    if isinstance(mesh, Mesh):
        return surface_distance(mesh, low, n_samples=REPORTED_SAMPLES, threads=threads)
    return mesh.distance(low, threads=threads)


def measured_to(
    report: SimplifyReport, mesh: Mesh | ReducedMesh, low: Mesh, *, threads: int | None = None
) -> SimplifyReport:
    """Change the report of a simplified wrap to one of the mesh that the wrap was made of."""
    distance = measure_distance(mesh, low, threads=threads)
    notes = tuple(note for note in report.notes if note not in report.distance.notes)
    whole = mesh if isinstance(mesh, Mesh) else mesh.source
    if isinstance(mesh, ReducedMesh):
        notes = (mesh.note, *notes)
    return replace(
        report, n_faces_before=whole.n_faces, notes=(*notes, *distance.notes), distance=distance
    )


def check_count(
    n_faces: int, n_asked: int | None, name: str, remedy: str, needs: str = "holes, tunnels"
) -> None:
    """Raise `MeshError` if more faces than requested are left, by over 1 %."""
    if n_asked is not None and n_faces > (1.0 + SLACK) * n_asked:
        raise MeshError(
            f"{name}: {n_asked:,} triangles cannot be reached, because its {needs} and "
            f"separate parts need {n_faces:,}; {remedy}"
        )


def _simplified(
    mesh: Mesh,
    options: SimplifyOptions,
    stages: Stages,
    threads: int | None,
    shades: float = 0.0,
    importance: FloatArray | None = None,
    *,
    lifts: bool = True,
) -> Reduction:
    """The simplified mesh, how it was made, and what was given up."""
    n_faces, limit = options.n_faces, error_limit(options.error, mesh.diagonal)
    if limit is not None and 0.0 < _MOST_ERROR * mesh.diagonal < limit:
        raise OptionError(
            f"error: {mesh.name} is {mesh.diagonal:.4g} model units across, so {limit:.4g} would "
            "leave nothing of it; give a smaller one, such as 0.5% of the diagonal"
        )
    if limit is None and n_faces is not None and n_faces >= mesh.n_faces:
        return _unchanged(mesh, _FEW_FACES)
    with stages.stage("simplify"):
        if limit is not None:
            return _simplify_within(mesh, limit, options, threads, importance)
        assert n_faces is not None
        return reduced(
            mesh, n_faces, options, threads, shades=shades, importance=importance, lifts=lifts
        )


def _unchanged(mesh: Mesh, note: str) -> Reduction:
    return Reduction(mesh, None, "unchanged", (note,))


def _simplify_within(
    mesh: Mesh,
    limit: float,
    options: SimplifyOptions,
    threads: int | None,
    importance: FloatArray | None,
) -> Reduction:
    """The result of fewest faces found, not below a number, that lies within a distance."""
    n_faces = options.n_faces
    if mesh.n_faces <= (n_faces or MIN_FACES):
        return _unchanged(mesh, _FEW_FACES)
    fitting = _unchanged(mesh, "fewer faces would lie further from the mesh than the error allows")

    def attempt(n_asked: int) -> Trial:
        nonlocal fitting
        result = reduced(
            mesh, n_asked, options, threads, importance=importance, gives_up=n_asked == n_faces
        )
        distance = surface_distance(mesh, result.mesh, threads=threads)
        n_left = result.mesh.n_faces
        if distance.max <= limit and n_left < fitting.mesh.n_faces:
            fitting = replace(result, distance=distance)
        return Trial(n_left, distance.max)

    first = n_faces or max(MIN_FACES, min(_FIRST_FACES, mesh.n_faces // 4))
    search_fewest(attempt, limit, n_faces or MIN_FACES, mesh.n_faces, first)
    n_left = fitting.mesh.n_faces
    if n_faces is None or n_left <= n_faces or fitting.start is None:
        return fitting
    return noted(fitting, f"fewer than {n_left} faces would lie further from it than allowed")


_CLOSE = 1.02  # factor between a number of faces that fits and one that does not, to stop at
_TRIES = 16
_STEP = 4.0  # factor from one try to the next while nothing is known on that side
_MIDDLE = (0.15, 0.85)  # part of the range, in logarithms, in which the next try lies


class Trial(NamedTuple):
    """How many faces were left, and how far their surface lies off: infinite for no surface."""

    n_faces: int
    error: float


def search_fewest(
    attempt: Callable[[int], Trial], limit: float, n_least: int, n_most: int, n_first: int
) -> int:
    """Try numbers of faces, and return the least that stays within a limit."""
    low, high = Trial(n_least - 1, math.inf), Trial(n_most, 0.0)
    n = n_first
    for _ in range(_TRIES):
        n = min(max(n, low.n_faces + 1), high.n_faces - 1)
        if n <= low.n_faces or high.n_faces <= _CLOSE * low.n_faces:
            break
        n_left, error = attempt(n)
        if error > limit:
            low = Trial(min(max(n, n_left), high.n_faces - 1), error)
        else:
            high = Trial(n, error)
            if n_left > _CLOSE * n:
                break
        n = _between(low, high, limit)
    return high.n_faces


def _between(low: Trial, high: Trial, limit: float) -> int:
    """What to try between a number of faces that does not fit and one that does."""
    ratio = high.n_faces / max(low.n_faces, 1)
    share = 0.5
    if high.error > 0.0 and low.error < math.inf:
        share = pm.log(low.error / limit) / pm.log(low.error / high.error)
        share = min(max(share, _MIDDLE[0]), _MIDDLE[1])
    elif ratio > _STEP**2:
        share = pm.log(_STEP) / pm.log(ratio)
        share = share if high.error == 0.0 else 1.0 - share
    return round(max(low.n_faces, 1) * pm.exp(share * pm.log(ratio)))
