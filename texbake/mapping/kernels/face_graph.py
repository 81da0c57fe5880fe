"""Kernels over the graph of a mesh's faces: connecting, flooding, growing and finding neighbors.

- `merge_labels_kernel` numbers connected groups of items (union-find).
- `flood_kernel`, `seed_kernel` and `trim_kernel` divide a mesh into parts: every face gets the
  label of the nearest seed.
- `grow_kernel` grows charts over faces whose normals lie in one cone.
- `neighbors_kernel` and `loops_kernel` find the neighbors of each vertex of a patch, and the
  boundary loops.

Based on: R. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975; Robert Dial,
"Algorithm 360: Shortest-path forest with topological ordering", 1969 (the queue of the flood).
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

LONGEST_STEP = 63

FAR = np.iinfo(np.int32).max
OPEN, CLOSED = np.int32(-1), np.int32(-2)  # labels of faces that await a label, or take none

_CONE = math.cos(math.radians(60.0))
_TINY = np.finfo(np.float64).tiny


@kernel
def merge_labels_kernel(labels, firsts, seconds):  # type: ignore[no-untyped-def]
    """Union-find with path halving; roots are least items, so that one pass numbers the groups."""
    for i in range(len(firsts)):
        one, other = firsts[i], seconds[i]
        while labels[one] != one:
            labels[one] = labels[labels[one]]
            one = labels[one]
        while labels[other] != other:
            labels[other] = labels[labels[other]]
            other = labels[other]
        if one < other:
            labels[other] = one
        else:
            labels[one] = other
    n_labels = 0
    for item in range(len(labels)):
        if labels[item] == item:
            labels[item] = n_labels
            n_labels += 1
        else:
            labels[item] = labels[labels[item]]


@kernel
def flood_kernel(  # type: ignore[no-untyped-def]
    neighbors, steps, labels, sources, source_labels, within, most, distances, sizes, queue
):
    """Label every open face by its nearest source, with Dial's algorithm.

    Waiting faces are kept in one list for each possible distance ahead; one list is due at a time.
    A row of `queue` is a face, the label offered to it, and the next row of its list.
    """
    heads = np.full(LONGEST_STEP + 1, -1, dtype=np.int32)
    for row in range(len(sources)):
        queue[row, 0], queue[row, 1], queue[row, 2] = sources[row], source_labels[row], heads[0]
        heads[0] = row
    n_rows, n_waiting, distance = len(sources), len(sources), 0
    while n_waiting > 0:
        slot = distance % len(heads)
        while heads[slot] >= 0:
            face, label = queue[heads[slot], 0], queue[heads[slot], 1]
            heads[slot] = queue[heads[slot], 2]
            n_waiting -= 1
            if labels[face] != OPEN:
                continue
            if sizes[label] >= most:
                distances[face] = FAR  # another label may take it
                continue
            labels[face], distances[face] = label, distance
            sizes[label] += 1
            for side in range(3):
                other = neighbors[face, side]
                if other < 0 or labels[other] != OPEN or within[other] != within[face]:
                    continue
                reach = distance + steps[face, side]
                if reach < distances[other]:
                    distances[other] = reach
                    due = reach % len(heads)
                    queue[n_rows, 0], queue[n_rows, 1], queue[n_rows, 2] = other, label, heads[due]
                    heads[due] = n_rows
                    n_rows += 1
                    n_waiting += 1
        distance += 1


@kernel
def seed_kernel(neighbors, steps, labels, part_faces, distances, queue):  # type: ignore[no-untyped-def]
    """Give every open face a new label, in patches of at most `part_faces` faces."""
    n_labels = labels.max() + 1
    sizes = np.zeros(n_labels + len(labels), dtype=np.int32)
    source, source_label = np.empty(1, dtype=np.int32), np.empty(1, dtype=np.int32)
    everywhere = np.zeros(len(labels), dtype=np.int32)
    for face in range(len(labels)):
        if labels[face] == OPEN:
            source[0], source_label[0] = face, n_labels
            flood_kernel(
                neighbors,
                steps,
                labels,
                source,
                source_label,
                everywhere,
                part_faces,
                distances,
                sizes,
                queue,
            )
            n_labels += 1


@kernel
def trim_kernel(neighbors, labels):  # type: ignore[no-untyped-def]
    """Give every face that borders its own part on one side only to the part on the other two.

    Without such teeth, borders are less likely to overlap when the parts are flattened.
    """
    for _ in range(2):
        for face in range(len(labels)):
            one, two, three = neighbors[face]
            if one < 0 or two < 0 or three < 0:
                continue
            if labels[one] == labels[two] or labels[one] == labels[three]:
                labels[face] = labels[one]
            elif labels[two] == labels[three]:
                labels[face] = labels[two]


@kernel
def grow_kernel(neighbors, normals, charts, axes):  # type: ignore[no-untyped-def]
    """Grow a chart from each face that has none yet; return the number of charts.

    Each grows twice: first about the normal of its first face, to find the mean normal of the
    neighborhood; then about that mean.
    """
    n_charts = 0
    stack = np.empty(len(charts), dtype=np.int32)
    seen = np.full(len(charts), -1, dtype=np.int64)
    for first in range(len(charts)):
        if charts[first] >= 0:
            continue
        axis = normals[first].copy()
        for growth in range(2):
            axis /= max(math.sqrt((axis * axis).sum()), _TINY)
            mean = np.zeros(3)
            stack[0], height = first, 1
            seen[first] = 2 * n_charts + growth
            while height > 0:
                height -= 1
                face = stack[height]
                if growth == 0:
                    mean += normals[face]
                else:
                    charts[face] = n_charts
                for side in range(3):
                    other = neighbors[face, side]
                    if other < 0 or charts[other] >= 0 or seen[other] == 2 * n_charts + growth:
                        continue
                    normal = normals[other]
                    length = math.sqrt((normal * normal).sum())
                    if length > 0.0 and (normal * axis).sum() >= _CONE * length:
                        seen[other] = 2 * n_charts + growth
                        stack[height] = other
                        height += 1
            if growth == 0:
                axis = mean
        axes[n_charts] = axis
        n_charts += 1
    return n_charts


@kernel
def neighbors_kernel(faces, n_vertices):  # type: ignore[no-untyped-def]
    """Find the rows of neighbors, the entry of each pair of corners, and the boundary edges."""
    loose_starts = np.zeros(n_vertices + 1, dtype=np.int64)
    for face in range(len(faces)):
        for i in range(3):
            loose_starts[faces[face, i] + 1] += 2
    for vertex in range(n_vertices):
        loose_starts[vertex + 1] += loose_starts[vertex] + 1
    loose = np.empty(loose_starts[n_vertices], dtype=np.int32)
    leaving = np.zeros(len(loose), dtype=np.int32)  # triangle edges from row to column
    arriving = np.zeros(len(loose), dtype=np.int32)
    lengths = np.ones(n_vertices, dtype=np.int32)
    for vertex in range(n_vertices):
        loose[loose_starts[vertex]] = vertex
    entries = np.zeros((len(faces), 3, 3), dtype=np.int32)
    is_surface = True
    for face in range(len(faces)):
        for i in range(3):
            row = faces[face, i]
            start = loose_starts[row]
            for j in range(3):
                column = faces[face, j]
                at = 0
                while at < lengths[row] and loose[start + at] != column:
                    at += 1
                if at == lengths[row]:
                    loose[start + at] = column
                    lengths[row] += 1
                entries[face, i, j] = at
                if j == (i + 1) % 3:
                    leaving[start + at] += 1
                elif j != i:
                    arriving[start + at] += 1
                if j != i and (at == 0 or leaving[start + at] > 1 or arriving[start + at] > 1):
                    is_surface = False

    row_starts = np.zeros(n_vertices + 1, dtype=np.int32)
    n_boundary = 0
    for row in range(n_vertices):
        row_starts[row + 1] = row_starts[row] + lengths[row]
        for at in range(loose_starts[row] + 1, loose_starts[row] + lengths[row]):
            n_boundary += leaving[at] > arriving[at]
    columns = np.empty(row_starts[n_vertices], dtype=np.int32)
    boundary = np.empty((n_boundary, 2), dtype=np.int32)
    n_boundary = 0
    for row in range(n_vertices):
        for at in range(lengths[row]):
            loose_at = loose_starts[row] + at
            columns[row_starts[row] + at] = loose[loose_at]
            if at > 0 and leaving[loose_at] > arriving[loose_at]:
                boundary[n_boundary, 0], boundary[n_boundary, 1] = row, loose[loose_at]
                n_boundary += 1
    for face in range(len(faces)):
        for i in range(3):
            for j in range(3):
                entries[face, i, j] += row_starts[faces[face, i]]
    return row_starts, columns, entries, boundary, is_surface


@kernel
def loops_kernel(following):  # type: ignore[no-untyped-def]
    """Return the vertices in the order of the loops, and where each loop starts."""
    seen = np.zeros(len(following), dtype=np.bool_)
    order = np.empty(len(following), dtype=np.int32)
    starts = np.empty(len(following), dtype=np.int32)
    n_ordered, n_loops = 0, 0
    for first in range(len(following)):
        if following[first] < 0 or seen[first]:
            continue
        starts[n_loops] = n_ordered
        n_loops += 1
        vertex = first
        while not seen[vertex]:
            seen[vertex] = True
            order[n_ordered] = vertex
            n_ordered += 1
            vertex = following[vertex]
    return order[:n_ordered], starts[:n_loops]
