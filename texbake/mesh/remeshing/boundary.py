"""The boundary of a surface: its loops, which of them are holes to fill, and whether it is open.

A loop of edges that have an odd number of faces passes no vertex twice, so that a boundary that
touches itself is several loops. The triangles that fill them are those of a polygon.

Just off the faces of a body with holes, winding numbers are 0 on one side and 1 on the other, but
for what is seen through its holes; those of a flat sheet are a half. Narrow sheets, those with
edges of three faces, and those with a single side are not open surfaces.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import MeshError, counted
from texbake.mesh.distance import face_areas, unit_normals
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.options import CLOSED, OPEN
from texbake.mesh.polygons import cut_polygons, next_corners
from texbake.mesh.remeshing.parts import winding_numbers
from texbake.mesh.repair import misoriented
from texbake.mesh.topology import (
    MeshEdges,
    edge_neighbors,
    euler_characteristic,
    face_components,
    find_edges,
    repeated_vertices,
    surface_side,
)
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass


@dataclass(frozen=True, eq=False)
class Loops:
    """The loops of a boundary."""

    vertices: IntArray  # (n,) int32; those of each loop in turn
    sizes: Int64Array  # (m,) int64
    # (m,) float64; twice the distance of the farthest vertex from the mean of all.
    widths: FloatArray
    lengths: FloatArray  # (m,) float64; along the edges
    # (m,) int32; the separate part of the surface that each bounds, as in `face_components`.
    parts: IntArray

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray, edges: MeshEdges | None = None) -> Loops:
        """Find the loops of faces (F, 3) at points (V, 3)."""
        edges = find_edges(faces) if edges is None else edges
        odd = edges.vertices[edges.n_faces % 2 == 1]
        loops = _traced(odd.tolist())
        if not loops:
            return NO_LOOPS
        sizes = np.array([len(loop) for loop in loops], dtype=np.int64)
        vertices = np.array([vertex for loop in loops for vertex in loop], dtype=np.int32)
        part_of = np.zeros(len(points), dtype=np.int32)
        part_of[faces] = face_components(faces, len(points))[0][:, None]
        starts = np.cumsum(sizes) - sizes
        corners = points[vertices]
        means = np.add.reduceat(corners, starts, axis=0) / sizes[:, None]
        offsets = corners - np.repeat(means, sizes, axis=0)
        reach = np.maximum.reduceat((offsets * offsets).sum(axis=1), starts)
        steps = corners[next_corners(sizes)] - corners
        lengths = np.add.reduceat(np.sqrt((steps * steps).sum(axis=1)), starts)
        return cls(vertices, sizes, 2.0 * np.sqrt(reach), lengths, part_of[vertices[starts]])

    @property
    def outer(self) -> BoolArray:
        """(m,) bool: the longest loop of each part."""
        order = np.lexsort((-self.lengths, self.parts))
        outer = np.zeros(len(order), dtype=np.bool_)
        outer[order[np.flatnonzero(np.diff(self.parts[order], prepend=-1))]] = True
        return outer

    @property
    def edges(self) -> IntArray:
        """(n, 2) int32: the edge from each vertex to the next of its loop."""
        return np.stack([self.vertices, self.vertices[next_corners(self.sizes)]], axis=1)

    def filled(self, points: FloatArray, chosen: BoolArray) -> tuple[IntArray, Int64Array]:
        """Triangulate chosen loops (m,): faces (n, 3) and the loop (n,) that each of them fills."""
        vertices = np.ascontiguousarray(self.vertices[np.repeat(chosen, self.sizes)])
        triangles, owners, _ = cut_polygons(points, vertices, self.sizes[chosen])
        return vertices[triangles], np.flatnonzero(chosen)[owners]

    def fanned(self, points: FloatArray, chosen: BoolArray) -> tuple[FloatArray, IntArray]:
        """Fill small loops with fans around their means: points (V + n, 3), faces (m, 3)."""
        sizes, edges = self.sizes[chosen], self.edges[np.repeat(chosen, self.sizes)]
        if len(sizes) == 0:
            return points, edges.reshape(0, 3)
        means = np.add.reduceat(points[edges[:, 0]], np.cumsum(sizes) - sizes, axis=0)
        centers = len(points) + np.repeat(np.arange(len(sizes)), sizes)
        faces = np.column_stack([edges, centers]).astype(np.int32)
        return np.concatenate([points, means / sizes[:, None]]), faces


NO_LOOPS = Loops(
    np.zeros(0, np.int32), np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int32)
)


def _traced(edges: list[list[int]]) -> list[list[int]]:
    """The loops of undirected edges, of which an even number meet at each vertex."""
    neighbors: dict[int, list[int]] = {}
    for a, b in edges:
        neighbors.setdefault(a, []).append(b)
        neighbors.setdefault(b, []).append(a)
    loops = []
    for start, others in neighbors.items():
        path, places = [start], {start: 0}
        while others or len(path) > 1:
            vertex = path[-1]
            after = neighbors[vertex].pop()
            neighbors[after].remove(vertex)
            if after not in places:
                places[after] = len(path)
                path.append(after)
                continue
            loops.append(path[places[after] :])
            for passed in path[places[after] + 1 :]:
                del places[passed]
            del path[places[after] + 1 :]
    return loops


def with_own_fans(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Give each fan of faces around a vertex its own vertex, and leave out unused ones."""
    pairs = edge_neighbors(faces)
    corners = faces.ravel()
    tails, heads = [], []
    for k in range(3):
        for j in range(3):
            one, other = 3 * pairs.first + k, 3 * pairs.second + j
            same = corners[one] == corners[other]
            tails.append(one[same])
            heads.append(other[same])
    labels = np.arange(len(corners), dtype=np.int32)
    core.merge_labels(
        labels, np.concatenate(tails).astype(np.int32), np.concatenate(heads).astype(np.int32)
    )
    firsts = np.unique(labels, return_index=True)[1]
    return points[corners[firsts]], labels.reshape(-1, 3)


# Faces whose winding numbers are measured, faces summed up for them, and how far off, in voxels.
_SAMPLES, _MOST_WORK, _OFF = 512, 1e7, 1e-3
# How much of all directions open surfaces show their own other side through their holes, at least;
# on average over their faces. It is 0.17 for half a sphere, and 0.5 for a sheet.
_OPEN = 0.1
# Surfaces are open if what would close them has at least this share of their area.
_WIDE_OPEN = 1.0 / 3.0
# Sheets narrower than this, in voxels, as area over boundary, have no boundary to keep. Edges with
# three faces, or whose two faces cannot agree, as a share of all.
_NARROW, _TORN = 2.0, 0.001
# Holes up to this share of the diagonal are filled smoothly, and others by a flat net.
_SMALL = 0.1

_CLOSED = "it has no boundary"


@dataclass(frozen=True)
class _EdgeFigures:
    """What the edges of a surface tell about it."""

    n_torn: int  # edges of more than two faces, or of two that do not wind alike
    n_misoriented: int  # the latter
    euler: int  # vertices - edges + faces

    @classmethod
    def of(cls, faces: IntArray, edges: MeshEdges) -> _EdgeFigures:
        """Count them."""
        misoriented = edges.misoriented
        return cls(
            n_torn=int(np.count_nonzero(edges.non_manifold | misoriented)),
            n_misoriented=int(np.count_nonzero(misoriented)),
            euler=euler_characteristic(faces, edges),
        )


@dataclass(frozen=True, eq=False)
class Kind:
    """A surface whose vertices at one place are one."""

    # (F, 3) int32; neighbors wind alike where that is possible. Those with repeated vertices are
    # left out.
    faces: IntArray
    loops: Loops  # of its boundary
    open_parts: BoolArray  # which separate parts are open surfaces
    is_open: bool  # whether most of its area is of open surfaces
    is_one_sided: bool  # whether neighbors cannot wind alike everywhere, as on a Möbius strip
    reason: str  # why, as the end of a sentence
    figures: _EdgeFigures | None = None  # None: not counted yet


# Of a surface that is wrapped without being examined.
AS_IT_IS = Kind(np.zeros((0, 3), np.int32), NO_LOOPS, np.zeros(0, np.bool_), False, False, "")


def kind_of(points: FloatArray, faces: IntArray, *, threads: int | None = None) -> Kind:
    """Decide whether a surface, with points in voxels, is open or that of a body."""
    is_closed = surface_side(Mesh(positions=points, faces=faces), threads=threads) != "both"
    faces = weld_rows(points, threads=threads)[faces]
    if is_closed:
        return Kind(faces, NO_LOOPS, np.zeros(1, dtype=np.bool_), False, False, _CLOSED)
    faces = np.ascontiguousarray(faces[~repeated_vertices(faces)], dtype=np.int32)
    parts, n_parts = face_components(faces, len(points))
    edges = find_edges(faces)
    loops = Loops.of(points, faces, edges)
    none = np.zeros(n_parts, dtype=np.bool_)
    if len(loops.sizes) == 0:
        return Kind(faces, loops, none, False, False, _CLOSED)
    alike = oriented(points, faces)
    if alike is not faces:
        faces, edges = alike, find_edges(alike)
    figures, n_edges = _EdgeFigures.of(faces, edges), len(edges.vertices)
    least = _area_that_closes(points, edges)
    del edges
    areas = face_areas(points, faces, threads=threads)
    length, area = float(loops.lengths.sum()), float(areas.sum())
    open_parts = np.bincount(loops.parts, minlength=n_parts) > 0
    if least > _WIDE_OPEN * area:
        share = f"closing it would add at least {100.0 * least / area:.0f} % to its area"
    else:
        looked_at, seen = _seen_through_holes(points, faces, areas, threads)
        n_seen = np.bincount(parts[looked_at], minlength=n_parts)
        shares = np.bincount(parts[looked_at], seen, n_parts) / np.maximum(n_seen, 1)
        open_parts &= np.where(n_seen > 0, shares, seen.mean()) > _OPEN
        share = f"from its back, {100.0 * float(seen.mean()):.0f} % of all directions lead outside"
    is_open = 2.0 * float(areas[open_parts[parts]].sum()) > area
    is_one_sided = figures.n_misoriented > _TORN * n_edges
    if figures.n_torn > _TORN * n_edges:
        is_open, share = False, f"its two sides cannot be told apart at {figures.n_torn:,} edges"
    elif is_open and area < _NARROW * length:
        is_open, share = False, "its sheets are too narrow for these voxels"
    return Kind(faces, loops, open_parts, is_open, is_one_sided, share, figures)


def _area_that_closes(points: FloatArray, edges: MeshEdges) -> float:
    """Return a lower bound of the area that closes a surface: the length of its vector area."""
    walks = 2 * edges.n_forward - edges.n_faces  # upwards, less those downwards
    ends = points[edges.vertices[walks != 0]]
    sums = (walks[walks != 0][:, None] * np.cross(ends[:, 0], ends[:, 1])).sum(axis=0)
    return 0.5 * float(pm.norm(sums))


def oriented(points: FloatArray, faces: IntArray) -> IntArray:
    """Faces that wind like their neighbors, where that is possible; those given if they do."""
    turned = misoriented(Mesh(positions=points, faces=faces))
    if not turned.any():
        return faces
    turned = turned[:, None]
    return np.ascontiguousarray(np.where(turned, faces[:, ::-1], faces), dtype=np.int32)


def count_loops(faces: IntArray) -> int:
    """Two for each handle, and the loops of the boundary, of all separate parts together."""
    n_parts = face_components(faces, int(faces.max()) + 1)[1]
    return 2 * n_parts - euler_characteristic(faces, find_edges(faces))


def _seen_through_holes(
    points: FloatArray, faces: IntArray, areas: FloatArray, threads: int | None
) -> tuple[Int64Array, FloatArray]:
    """Share of directions in which some faces, evenly by area, see the other side."""
    sums = np.cumsum(areas)
    # A large odd step puts them in no order, since the last ones may not be measured.
    steps = (np.arange(_SAMPLES) * 197 % _SAMPLES + 0.5) / _SAMPLES
    chosen = np.minimum(np.searchsorted(sums, steps * sums[-1]), len(faces) - 1)
    places = points[faces[chosen]].mean(axis=1) - _OFF * unit_normals(points, faces[chosen])
    windings = winding_numbers(points, faces, places, most_work=_MOST_WORK, threads=threads)
    known = ~np.isnan(windings)
    return chosen[known], np.maximum(0.5 - np.abs(windings[known] - 0.5), 0.0)


@dataclass(frozen=True, eq=False)
class Filled:
    """A surface with the triangles that fill its holes."""

    # (F, 3) int32; those of the surface, then those that fill holes; neighbors wind alike.
    faces: IntArray
    # (F,) bool; which of them fill small holes; None if no hole is filled.
    smooth: BoolArray | None
    n_given: int  # faces of the surface
    n_holes: int  # holes that are filled
    rim: IntArray  # (n, 2) int32; edges of the boundary that is left

    @classmethod
    def of(cls, faces: IntArray, rim: IntArray = NO_LOOPS.edges) -> Filled:
        """Return a surface with no hole filled."""
        return cls(faces, None, len(faces), 0, rim)


def fill_holes(points: FloatArray, kind: Kind, gap: float, *, whole: bool) -> Filled:
    """Fill the holes of an open surface up to a width, or those of a body."""
    loops = kind.loops
    if kind.is_open:
        chosen = (loops.widths <= gap) & ~loops.outer
    else:
        chosen = np.full(len(loops.sizes), whole) | ~kind.open_parts[loops.parts]
    if not chosen.any():
        return Filled.of(kind.faces, loops.edges)
    more, owners = loops.filled(points, chosen)
    is_small = loops.widths[owners] <= _SMALL * pm.norm(np.ptp(points, axis=0))
    smooth = np.concatenate([np.zeros(len(kind.faces), dtype=np.bool_), is_small])
    faces = np.concatenate([kind.faces, more])
    if kind.is_open:
        faces = oriented(points, faces)
    rim = loops.edges[np.repeat(~chosen, loops.sizes)]
    return Filled(faces, smooth, len(kind.faces), int(np.count_nonzero(chosen)), rim)


def require_topology(
    name: str,
    kind: Kind,
    n_parts: int,
    n_components: int,
    n_handles: int,
    n_boundaries: int,
    *,
    may_be_pierced: bool,
) -> int:
    """Refuse a result with more parts, or a sheet with more holes; return further handles."""
    advice = "use a greater `resolution`"
    if n_components > n_parts:
        raise MeshError(
            f"{name}: the result has {n_components:,} separate parts and the mesh "
            f"{n_parts:,}; {advice}, or keep the largest with `components={n_parts}`"
        )
    if not kind.is_open and (n_parts > 1 or n_handles == 0):
        return 0
    figures = kind.figures or _EdgeFigures.of(kind.faces, find_edges(kind.faces))
    if not kind.is_open and figures.n_torn:
        return 0
    n_given = len(kind.loops.sizes)
    loops = max(2 * n_parts - figures.euler, n_given)
    n_made = n_handles - (loops - n_given) // 2
    if kind.is_open:
        # Parts that cross are joined, maybe at several places.
        loops += 2 * (n_parts - n_components)
        excess = 2 * n_handles + n_boundaries - loops
        n_holes = n_boundaries - n_given
        n_made = (excess - n_holes + 1) // 2
    else:
        excess, n_holes = n_handles - loops if may_be_pierced else 0, 0
    if excess > 0:
        made = [counted(n, what) for n, what in ((n_holes, "hole"), (n_made, "handle")) if n > 0]
        what, other = ("sheet", CLOSED) if kind.is_open else ("closed surface", OPEN)
        advice += "" if kind.is_open else ", a smaller `close`"
        raise MeshError(
            f"{name}: the {what} has {' and '.join(made)} that the mesh does not have; {advice}"
            + (f", or `surface={other}`" if n_given else "")
        )
    return 0 if kind.is_open else max(n_made, 0)
