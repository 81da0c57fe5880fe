"""Faces that pass through one another.

Two triangles in different planes do where each has corners on both sides of the other's plane, and
the pieces that they cut out of the line common to both planes overlap. Candidates come from a tree
of boxes. To know that a face is crossed, one other is enough, so that a thousand sheets through one
another cost no more than two.

What counts must be deeper and longer than the rounding of files, so that parts that stand on one
another do not, nor neighbors that share a corner; then float64 decides it with digits to spare.

Based on: Tomas Möller, "A fast triangle-triangle intersection test", Journal of Graphics Tools
2(2), 1997.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.checks.finding import Finding, found
from texbake.checks.subject import Subject
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.kernels.triangle_tree import STACK_SIZE, dot, minus, point_at
from texbake.mesh.mesh import FloatArray, IntArray, frozen
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands

# Depth and length of a crossing that is none, as a share of the diagonal: what six decimals of a
# text file leave of parts that touch; ...
_DEPTH = 1e-6
# ... and of the farthest coordinate: 4 units in the last place of a float32.
_RELATIVE_DEPTH = 2.0**-22
_BAND = 4096  # faces looked at by one thread at a time
# Faces that one is compared with before it is given up: all of them in meshes of up to 23,000
# faces, and never fewer than 512. A common mesh takes about 15 a face.
_MOST_PAIRS = 1 << 29
_LEAST_PAIRS_OF_A_FACE = 512


def self_intersections(subject: Subject) -> Finding | None:
    """Find faces that pass through another, or may; the largest are the worst."""
    crossed, unsure = crossed_by(subject)
    faces, undecided = np.flatnonzero(crossed >= 0), np.flatnonzero(unsure)
    if len(faces) == 0:
        return found(
            "undecided-intersections",
            subject.role,
            len(undecided),
            undecided,
            subject.areas[undecided],
        )
    largest = int(faces[subject.areas[faces].argmax()])
    more = ""
    if len(undecided):
        more = f" Of {len(undecided):,} more faces it was not told, for the many faces near them."
    return found(
        "self-intersections",
        subject.role,
        len(faces),
        faces,
        subject.areas[faces],
        one=largest,
        other=int(crossed[largest]),
        unsure=more,
    )


def crossed_by(subject: Subject) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    """Look for a face that passes through each.

    Parameters
    ----------
    subject

    Returns
    -------
    others : (F,) int32
        A face that crosses each, the same on every run, or -1.
    unsure : (F,) bool
        Faces of which it is not known, since thousands of others are near them.
    """
    mesh, threads = subject.mesh, subject.options.threads
    frame = LocalFrame.around(mesh)
    positions = frozen(np.ascontiguousarray(frame.to_local(mesh.positions)))
    low, high = mesh.bounds * frame.scale
    depth = max(
        _DEPTH * float(np.linalg.norm(high - low)),
        _RELATIVE_DEPTH * float(np.abs([low, high]).max()),
    )
    normals = _normals_of_thick_faces(positions[mesh.faces], subject.normals, depth)
    tree = TriangleTree.build(positions, mesh.faces, threads=threads)
    parts = (tree.positions, tree.faces, tree.order, tree.boxes, tree.nodes)
    others = np.full(mesh.n_faces, -1, dtype=np.int32)
    unsure = np.zeros(mesh.n_faces, dtype=np.bool_)
    most = max(_LEAST_PAIRS_OF_A_FACE, _MOST_PAIRS // mesh.n_faces)

    def look(start: int, stop: int) -> None:
        _crossings_kernel(parts, normals, depth, most, start, stop, others, unsure)

    run_bands(look, mesh.n_faces, band=_BAND, threads=threads)
    return others, unsure


def _normals_of_thick_faces(corners: FloatArray, normals: FloatArray, depth: float) -> FloatArray:
    """(F, 3) float64: unit normals, zero for faces that are no wider than `depth`."""
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.sqrt(np.einsum("fci,fci->fc", edges, edges).max(axis=1))
    doubles = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    thick = doubles > depth * longest
    return frozen(np.ascontiguousarray(np.where(thick[:, None], normals, 0.0)))


@kernel
def _reach(n, corner, a, b, c):  # type: ignore[no-untyped-def]
    """Heights of three points over the plane through a corner."""
    return dot(n, minus(a, corner)), dot(n, minus(b, corner)), dot(n, minus(c, corner))


@kernel
def _piece(along, a, b, c, heights):  # type: ignore[no-untyped-def]
    """Ends, along a direction, of what a plane cuts out of a triangle that it passes through."""
    places = dot(along, a), dot(along, b), dot(along, c)
    low, high = np.inf, -np.inf
    for i in range(3):
        j = (i + 1) % 3
        if (heights[i] < 0.0) != (heights[j] < 0.0):
            place = places[i] + (places[j] - places[i]) * (heights[i] / (heights[i] - heights[j]))
            low, high = min(low, place), max(high, place)
    return low, high


@kernel
def _crossings_kernel(tree, normals, depth, most, start, stop, others, unsure):  # type: ignore[no-untyped-def]
    """Look for one face that crosses each of those at some places in the tree's order."""
    positions, faces, order, boxes, nodes = tree
    stack = np.empty(STACK_SIZE, dtype=np.int32)
    for slot in range(start, stop):
        face = order[slot]
        n = point_at(normals, face)
        if dot(n, n) == 0.0:
            continue
        a, b, c = (
            point_at(positions, faces[face, 0]),
            point_at(positions, faces[face, 1]),
            point_at(positions, faces[face, 2]),
        )
        x0, x1 = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
        y0, y1 = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        z0, z1 = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        stack[0], size, n_pairs = 0, 1, 0
        while size > 0 and others[face] < 0:
            size -= 1
            node = stack[size]
            if (
                boxes[node, 0] > x1 or boxes[node, 3] < x0
                or boxes[node, 1] > y1 or boxes[node, 4] < y0
                or boxes[node, 2] > z1 or boxes[node, 5] < z0
            ):  # fmt: skip
                continue
            first, count = nodes[node, 0], nodes[node, 1]
            if count == 0:
                stack[size], stack[size + 1] = first, first + 1
                size += 2
                continue
            if n_pairs >= most:
                unsure[face] = True
                break
            n_pairs += count
            for other in order[first : first + count]:
                m = point_at(normals, other)
                if other == face or dot(m, m) == 0.0:
                    continue
                p, q, r = (
                    point_at(positions, faces[other, 0]),
                    point_at(positions, faces[other, 1]),
                    point_at(positions, faces[other, 2]),
                )
                theirs = _reach(n, a, p, q, r)
                if min(theirs) >= -depth or max(theirs) <= depth:
                    continue
                ours = _reach(m, p, a, b, c)
                if min(ours) >= -depth or max(ours) <= depth:
                    continue
                along = (
                    n[1] * m[2] - n[2] * m[1],
                    n[2] * m[0] - n[0] * m[2],
                    n[0] * m[1] - n[1] * m[0],
                )
                low, high = _piece(along, a, b, c, ours)
                their_low, their_high = _piece(along, p, q, r, theirs)
                common = min(high, their_high) - max(low, their_low)
                if common > depth * np.sqrt(dot(along, along)):
                    others[face] = other
                    break
