"""Kernels of displacement: measuring edges, subdividing triangles and moving vertices.

Based on: the sources given in `texbake.rendering.tessellation` and `texbake.rendering.displaced`.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel


@kernel
def take_middles(values, ends, out):  # type: ignore[no-untyped-def]
    """Write the mean of the values at both ends of each edge."""
    for i in range(len(ends)):
        for k in range(3):
            out[i, k] = 0.5 * (values[ends[i, 0], k] + values[ends[i, 1], k])


@kernel
def move_vertices(vertices, values, points, normals, linear, out):  # type: ignore[no-untyped-def]
    """Write points displaced by the mean of their values, along the normal or by vectors."""
    n_channels = values.shape[1]
    counts, way = np.zeros(len(points), np.int32), np.empty(3)
    out[:] = 0.0
    for i in range(len(vertices)):
        counts[vertices[i]] += 1
        for k in range(n_channels):
            out[vertices[i], k] += values[i, k]
    for i in range(len(points)):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        for k in range(3):
            if n_channels == 3:
                way[k] = out[i, k] / counts[i]
            else:
                way[k] = out[i, 0] / counts[i] * (normals[i, k] / length if length > 0.0 else 0.0)
        for k in range(3):
            turned = linear[k, 0] * way[0] + linear[k, 1] * way[1] + linear[k, 2] * way[2]
            out[i, k] = points[i, k] + turned


@kernel
def measure_texel_lengths(faces, face_edges, base_faces, weights, corners, outside, lengths):  # type: ignore[no-untyped-def]
    """Raise the length of each edge, in texels, to the maximum over triangles not outside."""
    for i in range(len(faces)):
        if outside[faces[i, 0]] & outside[faces[i, 1]] & outside[faces[i, 2]]:
            continue
        for k in range(3):
            length, edge, after = np.inf, face_edges[i, k], (k + 1) % 3
            if len(corners) > 0:
                a, b, c = corners[base_faces[i]]
                along = np.float64(weights[i, after, 0] - weights[i, k, 0])
                up = np.float64(weights[i, after, 1] - weights[i, k, 1])
                x = along * (b[0] - a[0]) + up * (c[0] - a[0])
                y = along * (b[1] - a[1]) + up * (c[1] - a[1])
                length = np.sqrt(x * x + y * y)
            lengths[edge] = max(lengths[edge], length)


@kernel
def view_vertices(  # type: ignore[no-untyped-def]
    points, positions, eye, back, near, steepest, sides, margins, outside, nearest, slants,
    start, stop,
):  # fmt: skip
    """Write on which sides each vertex is outside the picture, its least depth, and its slant."""
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
def measure_excess(ends, points, positions, nearest, slants, texels, scale, out, start, stop):  # type: ignore[no-untyped-def]
    """Write the ratio of each edge's length to the allowed length."""
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


# How a triangle is divided, by the number of its cut edges, which come first; with two cut edges
# there are two variants. Points: corners 0, 1, 2 and midpoints 3, 4, 5 of the edges 01, 12, 20.
# Edges: 0 and 1 are the halves of 01 at corners 0 and 1, 2 and 3 those of 12, 4 and 5 those of 20
# (both are the edge itself if it is not cut); 6, 7, 8 are new inner edges.
_NO = (0, 0, 0, 0, 0, 0)
PIECES = np.array(
    [  # three points, then the edges from each to the next
        [(0, 1, 2, 0, 2, 4), _NO, _NO, _NO],
        [(0, 3, 2, 0, 6, 4), (3, 1, 2, 1, 2, 6), _NO, _NO],
        [(3, 1, 4, 1, 2, 6), (0, 3, 4, 0, 6, 7), (0, 4, 2, 7, 3, 4), _NO],
        [(0, 3, 5, 0, 6, 5), (3, 1, 4, 1, 2, 7), (5, 4, 2, 8, 3, 4), (3, 4, 5, 7, 8, 6)],
        [(3, 1, 4, 1, 2, 6), (0, 3, 2, 0, 7, 4), (3, 4, 2, 6, 3, 7), _NO],
    ]
)

# Ends of the new edges 6, 7 and 8.
INNER = np.array(
    [
        [(0, 0), (0, 0), (0, 0)],
        [(3, 2), (0, 0), (0, 0)],
        [(3, 4), (0, 4), (0, 0)],
        [(3, 5), (3, 4), (4, 5)],
        [(3, 4), (3, 2), (0, 0)],
    ]
)

OTHER_DIAGONAL = 4


@kernel
def squared_distance(a, b):  # type: ignore[no-untyped-def]
    """Squared distance between two points."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@kernel
def close_marks(faces, face_edges, points, marked):  # type: ignore[no-untyped-def]
    """Mark the longest edge of every triangle with a marked edge; return the number of cuts."""
    changed, n_cuts = True, 0
    while changed:
        changed, n_cuts = False, 0
        for i in range(len(faces)):
            n = 0
            for k in range(3):
                n += marked[face_edges[i, k]]
            if 0 < n < 3:
                longest, length = 0, -1.0
                for k in range(3):
                    squared = squared_distance(points[faces[i, k]], points[faces[i, (k + 1) % 3]])
                    if squared > length:
                        longest, length = face_edges[i, k], squared
                if not marked[longest]:
                    marked[longest] = True
                    changed = True
                    n += 1
            n_cuts += n
    return n_cuts


@kernel
def count_pieces(face_edges, marked, added):  # type: ignore[no-untyped-def]
    """Write the number of triangles added by all triangles before each one."""
    added[0] = 0
    for i in range(len(face_edges)):
        n = np.int64(marked[face_edges[i, 0]]) + marked[face_edges[i, 1]]
        added[i + 1] = added[i] + n + marked[face_edges[i, 2]]


@kernel
def halve_edges(ends, marked, halves, middles, out):  # type: ignore[no-untyped-def]
    """Write both halves of marked edges, and copy the other edges."""
    for edge in range(len(ends)):
        half = halves[edge]
        out[half, 0], out[half, 1] = ends[edge, 0], ends[edge, 1]
        if marked[edge]:
            out[half, 1] = middles[edge]
            out[half + 1, 0], out[half + 1, 1] = middles[edge], ends[edge, 1]


@kernel
def gather_piece(i, first, whole, edges, n_vertices, vertex, weight, edge, places, place):  # type: ignore[no-untyped-def]
    """Write the points and outer edges of a triangle, starting at its corner `first`.

    Each of its cut edges adds a row to the places of new vertices, starting at row `place`.
    """
    faces, face_edges, base_faces, weights = whole
    ends, marked, halves, middles = edges
    for k in range(3):
        corner, after = (first + k) % 3, (first + k + 1) % 3
        e = face_edges[i, corner]
        vertex[k] = faces[i, corner]
        for c in range(2):
            weight[k, c] = weights[i, corner, c]
            weight[3 + k, c] = np.float32(0.5) * (weights[i, corner, c] + weights[i, after, c])
        edge[2 * k], edge[2 * k + 1] = halves[e], halves[e]
        if marked[e]:
            vertex[3 + k] = middles[e]
            edge[2 * k + (ends[e, 0] == faces[i, corner])] += 1
            places[0][place] = middles[e] - n_vertices
            places[1][place] = base_faces[i]
            places[2][place, 0], places[2][place, 1] = weight[3 + k, 0], weight[3 + k, 1]
            place += 1


@kernel
def keep_edge(i, piece, whole, halves, out):  # type: ignore[no-untyped-def]
    """Copy a triangle without cut edges, the most common case in the last rounds."""
    out[2][piece] = whole[2][i]
    for k in range(3):
        out[0][piece, k] = whole[0][i, k]
        out[1][piece, k] = halves[whole[1][i, k]]
        out[3][piece, k, 0], out[3][piece, k, 1] = whole[3][i, k, 0], whole[3][i, k, 1]


@kernel
def cut_triangles(  # type: ignore[no-untyped-def]
    whole, edges, points, added, n_halves, n_vertices, out, ends_out, places, start, stop
):
    """Write the pieces of triangles whose edges were halved."""
    face_edges, marked = whole[1], edges[1]
    vertex, weight = np.zeros(6, np.int32), np.empty((6, 2), np.float32)
    edge, middle = np.empty(9, np.int32), np.empty((2, 3))
    for i in range(start, stop):
        case, first = added[i + 1] - added[i], 0
        if case == 0:
            keep_edge(i, i + added[i], whole, edges[2], out)
            continue
        if case == 1:
            while not marked[face_edges[i, first]]:
                first += 1
        elif case == 2:
            while marked[face_edges[i, (first + 2) % 3]]:
                first += 1
        gather_piece(i, first, whole, edges, n_vertices, vertex, weight, edge, places, added[i])
        if case == 2:
            a, b, c = points[vertex[0]], points[vertex[1]], points[vertex[2]]
            for k in range(3):
                middle[0, k], middle[1, k] = 0.5 * (a[k] + b[k]), 0.5 * (b[k] + c[k])
            if squared_distance(middle[0], c) < squared_distance(a, middle[1]):
                case = OTHER_DIAGONAL
        n_inner = added[i + 1] - added[i]
        for k in range(n_inner):
            edge[6 + k] = n_halves + added[i] + k
            ends_out[edge[6 + k], 0] = vertex[INNER[case, k, 0]]
            ends_out[edge[6 + k], 1] = vertex[INNER[case, k, 1]]
        for k in range(n_inner + 1):
            piece = i + added[i] + k
            out[2][piece] = whole[2][i]
            for corner in range(3):
                point = PIECES[case, k, corner]
                out[0][piece, corner] = vertex[point]
                out[1][piece, corner] = edge[PIECES[case, k, 3 + corner]]
                out[3][piece, corner, 0] = weight[point, 0]
                out[3][piece, corner, 1] = weight[point, 1]
