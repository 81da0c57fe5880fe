"""A mesh reduced to a number of faces, by the first attempt that gives up least for it.

`fast` keeps a subset of the vertices, bit for bit. `best` puts vertices where the quadric error is
least; it is compared with `fast` by measured distance, and the closer of the two is returned.

Based on: Michael Garland, Paul Heckbert, "Surface simplification using quadric error metrics",
SIGGRAPH 1997.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from texbake.errors import MeshError
from texbake.mesh.decals import Decals
from texbake.mesh.decimate import (
    VertexStream,
    boundary_fits,
    collapse_stream,
    gather,
    move_and_collapse,
    weld_corners,
    with_surfaces_apart,
    with_three_places,
)
from texbake.mesh.deformation import Deformation, Morph
from texbake.mesh.distance import SurfaceDistance, distance_to
from texbake.mesh.hard_edges import is_flat_shaded
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.objects import has_borders, object_by_object, without_borders
from texbake.mesh.options import SimplifyOptions
from texbake.mesh.piecewise import bring_down
from texbake.mesh.refit import refitted, split_vertices
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import (
    with_nearest_attributes,
    with_nearest_groups,
    with_nearest_motion,
)
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

_DROPPED = "separate parts were dropped"
# A result this much under the count is tried again, this often at most.
SLACK = 0.01
_TRIES = 6

_COMPARED = 20_000  # samples; the RMS distance is good to about a hundredth
_NO_DISTANCE = 1e-12  # share of the diagonal; smaller distances are rounding errors

# Share of the requested faces that an attempt must leave, or else further attempts are made.
_ENOUGH = 0.75

# An attempt that gives up less is taken up to this multiple of the least RMS distance of any.
_ABOUT_AS_CLOSE = 1.5

# Where more than these parts of the vertices lie at hard edges or at seams of texture coordinates,
# these may go before the count needs it, texture coordinates if the surface is much closer without.
_MANY_HARD, _MANY_SEAMS = 0.25, 0.7
_MUCH_CLOSER = 4.0

# Parts that cannot all stay may take up these parts of the faces.
_PARTS_SHARES = (0.25, 0.5, 1.0)

_COLLAPSES = "collapsed edges"

# Notes on what becomes of edges of three or more faces where they are in the way.
APART = "surfaces that touch were taken apart"
CUT = "the topology was given up: surfaces were cut through at necks and tunnels"


@dataclass(frozen=True)
class Reduction:
    """A mesh with fewer faces, how it was made, and what was given up for that."""

    mesh: Mesh
    start: VertexStream | None  # what the last step began with
    method: str
    notes: tuple[str, ...] = ()
    distance: SurfaceDistance | None = None  # where it was measured


def reduced(
    mesh: Mesh,
    n_faces: int,
    options: SimplifyOptions,
    threads: int | None,
    *,
    shades: float = 0.0,
    importance: FloatArray | None = None,
    gives_up: bool = True,
    lifts: bool = True,
) -> Reduction:
    """Return a mesh reduced to a number of faces, or to as few as are possible.

    If it `gives_up`, seams and parts may go; if it `lifts`, decals stay above what they lie on.
    With `shades`, a length, changes of normals count, a radian as much as it; vertices keep their
    places and no part is dropped. Errors at vertices count by their `importance` (V,) float64.
    """
    again = partial(
        reduced, n_faces=n_faces, options=options, threads=threads,
        shades=shades, importance=importance, gives_up=gives_up, lifts=lifts,
    )  # fmt: skip
    if options.seams == "drop" and mesh.uvs is not None:
        mesh = mesh.replace(uvs=None, uv_faces=None)
    if is_flat_shaded(mesh, threads=threads):
        bare = mesh.replace(normals=None, normal_faces=None)
        return noted(again(bare), "the normals are those of the facets, so no edge counts as hard")
    stream = weld_corners(mesh, shades=shades, importance=importance, threads=threads)
    start = bring_down(stream, n_faces, threads=threads)
    if gather(mesh, start, start.faces) is None:
        raise MeshError(
            f"{mesh.name}: none of its faces has three distinct corners; repair it first"
        )
    attempts = _attempts(
        mesh, start, n_faces, options.seams, threads, importance,
        drops=not shades, gives_up=gives_up,
    )  # fmt: skip
    result = _fast(mesh, attempts, n_faces, threads, gives_up=gives_up)
    if options.quality == "best" and start.normals is None:
        result = _best(mesh, result, n_faces, threads)
    note = _why_not(result, n_faces)
    if note is not None:
        result = noted(result, note)
    reduced_mesh = Decals(mesh, threads).raised(result.mesh) if lifts else result.mesh
    if has_borders(mesh):
        reduced_mesh = with_nearest_groups(reduced_mesh, mesh, threads)
    return replace(
        result, mesh=object_by_object(with_nearest_attributes(reduced_mesh, mesh, threads))
    )


def _why_not(result: Reduction, n_faces: int) -> str | None:
    """Why a result has more faces than requested, or fewer; None where it has as many."""
    n_left = result.mesh.n_faces
    if n_left > n_faces and result.mesh.uvs is not None:
        return f"texture coordinates and topology do not allow fewer than {n_left} faces"
    if n_left > n_faces:
        return f"the topology does not allow fewer than {n_left} faces: holes and tunnels stay"
    if n_left >= (1.0 - SLACK) * n_faces:
        return None
    reason = "faces that came to lie on one another were dropped"
    return f"{n_left} of the {n_faces} requested faces are left: {reason}"


def _fast(
    mesh: Mesh, attempts: Iterator[_Attempt], n_faces: int, threads: int | None, *, gives_up: bool
) -> Reduction:
    """The first attempt that reaches the count and, by measure, lies about as close as any."""
    results: list[Reduction] = []
    given_up: tuple[str, ...] = ()  # without need
    for stream, reduce, method, notes in attempts:
        if given_up and stream.has_hard_edges:
            continue
        low = _brought_to(n_faces, partial(_gathered, mesh, stream, reduce))
        if low is None:
            continue
        notes += _lost_parts(mesh, stream, low) if CUT in notes else ()
        results.append(Reduction(low, stream, method, notes))
        if not _ENOUGH * n_faces <= low.n_faces <= n_faces:
            continue
        if not gives_up:
            break
        sides = (low.uv_faces, low.normal_faces)
        at_seams, at_hard = (len(split_vertices(low, ids)) / low.n_vertices for ids in sides)
        if at_seams > _MANY_SEAMS:
            continue
        if at_hard > _MANY_HARD and not notes and stream.normals is None:
            given_up = (_too_few_for(["hard edges"]),)
        elif (notes == given_up and not stream.has_bad_edges) or notes == (*given_up, APART):
            break
    reached = [result for result in results if result.mesh.n_faces <= n_faces]
    if len(reached) < 2:
        return min(results, key=lambda result: result.mesh.n_faces)
    distances = [list(_distance_bounds(mesh, low.mesh, threads))[-1][0] for low in reached]
    is_whole = not any(_DROPPED in note for note in reached[0].notes)
    for place, result in enumerate(reached):
        if is_whole and reached[0].mesh.uvs is not None and result.mesh.uvs is None:
            distances[place] *= _MUCH_CLOSER / _ABOUT_AS_CLOSE
    good = _ABOUT_AS_CLOSE * min(distances)
    return next(
        result for result, distance in zip(reached, distances, strict=True) if distance <= good
    )


def _lost_parts(mesh: Mesh, stream: VertexStream, low: Mesh) -> tuple[str, ...]:
    """Note the separate parts of a stream that have no vertex in a mesh, which keeps some."""
    corners = stream.position_ids[stream.faces]
    parts, n_parts = face_components(corners, mesh.n_vertices)
    places = weld_rows(np.concatenate([mesh.positions, low.positions]))
    is_left = np.isin(places[corners], places[mesh.n_vertices :]).any(axis=1)
    return _dropped(n_parts - len(np.unique(parts[is_left])), n_parts)


def _dropped(n_dropped: int, n_parts: int) -> tuple[str, ...]:
    return (f"{n_dropped:,} of {n_parts:,} {_DROPPED}",) if n_dropped else ()


def _gathered(
    mesh: Mesh, stream: VertexStream, reduce: Callable[[int], IntArray], n_faces: int
) -> Mesh | None:
    return gather(mesh, stream, reduce(n_faces))


def _distance_bounds(mesh: Mesh, low: Mesh, threads: int | None) -> Iterator[tuple[float, float]]:
    """Yield ever closer lower bounds of the RMS and the greatest distance between two meshes.

    At rest and in the poses of the first; the last bounds are the distances.
    """
    poses, most = _in_poses(mesh, mesh, threads), 0.0
    squares = [0.0] * len(poses)
    for place, ends in enumerate(zip(poses, _in_poses(low, mesh, threads), strict=True)):
        for one, other in (ends, ends[::-1]):
            side = distance_to(one, other, n_samples=_COMPARED, threads=threads)
            squares[place], most = max(squares[place], side.rms * side.rms), max(most, side.max)
            yield math.sqrt(math.fsum(squares) / len(squares)), most


def _in_poses(mesh: Mesh, source: Mesh, threads: int | None) -> list[Mesh]:
    """A mesh as it is, and moved as the closest points of `source` move to their poses."""
    rest = mesh.replace(deformation=None)
    if source.deformation is None or not len(source.deformation.poses):
        return [rest]
    moves = tuple(Morph.of_rows(pose - source.positions) for pose in source.deformation.poses)
    still = Deformation(source.deformation.joints, source.deformation.weights, moves)
    found = with_nearest_motion(rest, source.replace(deformation=still), threads).deformation
    assert found is not None
    moved = (rest.positions + morph.rows(rest.n_vertices) for morph in found.morphs)
    return [rest, *(rest.replace(positions=positions) for positions in moved)]


def noted(result: Reduction, note: str) -> Reduction:
    """Return a reduction with one more note."""
    return replace(result, notes=(*result.notes, note))


# A stream, what reduces it to a number of faces, the name of that, and notes.
_Attempt = tuple[VertexStream, Callable[[int], IntArray], str, tuple[str, ...]]


def _attempts(
    mesh: Mesh,
    stream: VertexStream,
    n_faces: int,
    seams: str,
    threads: int | None,
    importance: FloatArray | None,
    *,
    drops: bool,
    gives_up: bool,
) -> Iterator[_Attempt]:
    """Yield attempts to reach the count, each giving up more than the one before, if it may."""
    notes: tuple[str, ...] = ()
    given_up: list[str] = []
    while True:
        if stream.has_bad_edges:
            stream = stream.without_copies()
        if boundary_fits(stream, n_faces):
            yield stream, partial(collapse_stream, stream, lock_boundary=True), _COLLAPSES, notes
        collapse = cache(partial(collapse_stream, stream))
        yield stream, collapse, _COLLAPSES, notes
        if not gives_up:
            break
        apart = with_surfaces_apart(stream) if stream.has_bad_edges else stream
        if apart is not stream:
            yield apart, partial(collapse_stream, apart), _COLLAPSES, (*notes, APART)
        for large, note in _without_small_parts(stream, n_faces, collapse) if drops else ():
            yield large, partial(collapse_stream, large), _COLLAPSES, notes + note
        seams_of, mesh = _without_next_seams(mesh, stream, seams)
        if not seams_of:
            break
        given_up += seams_of
        notes = (_too_few_for(given_up),)
        stream = weld_corners(mesh, importance=importance, threads=threads)
        stream = bring_down(stream, n_faces, threads=threads)
    if gives_up and drops and stream.has_bad_edges:
        cut = replace(with_surfaces_apart(stream, opens=True), keeps_topology=False)
        yield cut, partial(collapse_stream, cut), _COLLAPSES, (*notes, CUT)
    yield stream, lambda _: stream.faces, _COLLAPSES, notes


def _without_next_seams(mesh: Mesh, stream: VertexStream, seams: str) -> tuple[list[str], Mesh]:
    """What seams of its stream a mesh gives up next, and the mesh without: hard edges first."""
    mesh = mesh.replace(normals=None, normal_faces=None)
    if stream.has_hard_edges:
        return ["hard edges"], mesh
    given_up = []
    if stream.uv_ids is not None and seams != "keep":
        given_up.append("texture coordinates")
        mesh = mesh.replace(uvs=None, uv_faces=None)
    if stream.group_ids is not None:
        given_up.append("borders of groups or materials")
        mesh = without_borders(mesh)
    return given_up, mesh


def _too_few_for(seams: list[str]) -> str:
    *others, last = seams
    return f"too few faces to keep the {', '.join(others)}{' and ' if others else ''}{last}"


def _without_small_parts(
    stream: VertexStream, n_faces: int, collapse: Callable[[int], IntArray]
) -> Iterator[tuple[VertexStream, tuple[str, ...]]]:
    """Yield the stream without its smallest parts, with ever more of them, and notes."""
    corners = stream.vertices[0][stream.faces]
    parts, n_parts = face_components(corners, int(corners.max()) + 1)
    if n_parts == 1:
        return
    part_of = np.zeros(len(stream.points), dtype=np.intp)
    part_of[stream.faces] = parts[:, None]
    has_edges = n_parts < len(stream.faces)  # between faces; of loose triangles none can collapse
    least = collapse(n_faces) if has_edges else with_three_places(stream, stream.faces)
    least = collapse(0) if has_edges and len(least) <= n_faces else least
    fewest = np.bincount(part_of[least[:, 0]], minlength=n_parts)
    low, high = np.full((n_parts, 3), np.inf), np.full((n_parts, 3), -np.inf)
    corner_points = stream.points[stream.faces.ravel()]
    np.minimum.at(low, np.repeat(parts, 3), corner_points)
    np.maximum.at(high, np.repeat(parts, 3), corner_points)
    order = np.argsort(-(high - low).max(axis=1), kind="stable")
    sums = np.cumsum(fewest[order])
    n_before = 0
    for share in _PARTS_SHARES:
        n_kept = int(np.searchsorted(sums, share * n_faces, side="right"))
        if n_before < n_kept < n_parts:
            kept = stream.faces[np.isin(parts, order[:n_kept])]
            yield stream.restricted(kept), _dropped(n_parts - n_kept, n_parts)
        n_before = n_kept


def _brought_to(n_faces: int, make: Callable[[int], Mesh | None]) -> Mesh | None:
    """Return what `make` makes of the count, or of more where that leaves fewer."""
    nearest: Mesh | None = None
    n_asked = n_faces
    for _ in range(_TRIES):
        low = make(n_asked)
        n_left = 0 if low is None else low.n_faces
        if low is not None and (nearest is None or nearest.n_faces < n_left <= n_faces):
            nearest = low
        if n_left >= (1.0 - SLACK) * n_faces:
            break
        n_asked += n_faces - n_left
    return nearest


def _moved(mesh: Mesh, start: VertexStream, n_faces: int, threads: int | None) -> Mesh | None:
    """The mesh with vertices moved to where the error is least."""
    if start.uv_ids is None and start.normal_ids is None and not start.is_apart:
        # Borders of groups do not hinder here: a face gets its group back from the nearest point.
        start = start.of_positions()
    locks = boundary_fits(start, n_faces)
    return _brought_to(n_faces, partial(move_and_collapse, mesh, start, lock_boundary=locks))


def _best(mesh: Mesh, fast: Reduction, n_faces: int, threads: int | None) -> Reduction:
    """Of the results the one that reaches the count, or else the closest."""
    start = fast.start
    assert start is not None
    low = _moved(mesh, start, n_faces, threads)
    if low is None:
        return fast
    moved_result = replace(fast, mesh=low, method="moved vertices")
    results = (fast, moved_result, replace(moved_result, mesh=refitted(mesh, low, threads)))

    fewest = min(max(result.mesh.n_faces, n_faces) for result in results)
    closest, least = fast, math.inf
    for result in reversed(results):  # the last is mostly the closest
        if max(result.mesh.n_faces, n_faces) > fewest:
            continue
        # Where surfaces were cut, halves that stay where they are touch along edges.
        touching = _ABOUT_AS_CLOSE if CUT in result.notes and result is fast else 1.0
        cost = 0.0
        for bounds in _distance_bounds(mesh, result.mesh, threads):
            rms, most = (max(bound, _NO_DISTANCE * mesh.diagonal) for bound in bounds)
            cost = touching * rms * rms * most
            if cost > least:
                break
        else:
            closest, least = result, cost
    return closest
