"""Kernels that decide whether a ray from a face to the viewer hits another face.

They work in float64 throughout: they serve a few rays per face, not pictures.

Based on: Möller, Trumbore, "Fast, minimum storage ray/triangle intersection", Journal of Graphics
Tools 2(1), 1997; Kay, Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986 (boxes as slabs). The
boxes are those of `TriangleTree`.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel

STACK_SIZE = 63 + 31 + 2  # see core/triangle_tree.h


@kernel
def point_at(values, row):  # type: ignore[no-untyped-def]
    """A row of an (n, 3) array."""
    return values[row, 0], values[row, 1], values[row, 2]


@kernel
def minus(a, b):  # type: ignore[no-untyped-def]
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


# In units of the tree's frame, whose size is 1. A hit nearer than this, such as on a duplicate
# face, is contact and does not hide the point. Rounding errors stay far below it.
_CONTACT = 2.0**-36

# Replaces 0 in a direction, so that its inverse is finite and 0 times the inverse is 0.
_LEAST = 1e-300


@kernel
def _meets_box(boxes, node, start, inverse, length):  # type: ignore[no-untyped-def]
    """Whether a ray enters a box within `length`; `inverse` holds 1 / direction."""
    near, far = 0.0, length
    for axis in range(3):
        a = (boxes[node, axis] - start[axis]) * inverse[axis]
        b = (boxes[node, axis + 3] - start[axis]) * inverse[axis]
        if a > b:
            a, b = b, a
        if a > near:
            near = a
        if b < far:
            far = b
    return near <= far


@kernel
def _meets_triangle(a, ab, ac, start, along, length):  # type: ignore[no-untyped-def]
    """Whether a ray of unit direction hits a triangle within `length`, contact left out."""
    p = (
        along[1] * ac[2] - along[2] * ac[1],
        along[2] * ac[0] - along[0] * ac[2],
        along[0] * ac[1] - along[1] * ac[0],
    )
    determinant = dot(ab, p)
    if determinant == 0.0:
        return False
    offset = minus(start, a)
    v = dot(offset, p) / determinant
    if not 0.0 <= v <= 1.0:
        return False
    q = (
        offset[1] * ab[2] - offset[2] * ab[1],
        offset[2] * ab[0] - offset[0] * ab[2],
        offset[0] * ab[1] - offset[1] * ab[0],
    )
    w = dot(along, q) / determinant
    if w < 0.0 or v + w > 1.0:
        return False
    return _CONTACT < dot(ac, q) / determinant < length - _CONTACT


@kernel
def _is_blocked(tree, own, start, along, length, stack):  # type: ignore[no-untyped-def]
    """Whether a ray hits any face other than `own`."""
    positions, faces, order, boxes, nodes = tree
    inverse = (
        1.0 / (along[0] if along[0] != 0.0 else _LEAST),
        1.0 / (along[1] if along[1] != 0.0 else _LEAST),
        1.0 / (along[2] if along[2] != 0.0 else _LEAST),
    )
    stack[0], size = 0, 1
    while size > 0:
        size -= 1
        first, count = nodes[stack[size], 0], nodes[stack[size], 1]
        if count == 0:
            for child in range(first, first + 2):
                if _meets_box(boxes, child, start, inverse, length):
                    stack[size] = child
                    size += 1
        for slot in range(first, first + count):
            face = order[slot]
            if face == own:
                continue
            a = point_at(positions, faces[face, 0])
            ab = minus(point_at(positions, faces[face, 1]), a)
            ac = minus(point_at(positions, faces[face, 2]), a)
            if _meets_triangle(a, ab, ac, start, along, length):
                return True
    return False


@kernel
def mostly_hidden_kernel(tree, face_ids, samples, eye, start, stop, hidden):  # type: ignore[no-untyped-def]
    """Write which faces have more than half of their samples hidden from `eye`."""
    positions, faces = tree[0], tree[1]
    stack = np.empty(STACK_SIZE, dtype=np.int32)
    for k in range(start, stop):
        a = point_at(positions, faces[face_ids[k], 0])
        b = point_at(positions, faces[face_ids[k], 1])
        c = point_at(positions, faces[face_ids[k], 2])
        n_blocked, n_left = 0, len(samples)
        # Stop as soon as the remaining samples cannot change the answer.
        while 2 * n_blocked <= len(samples) < 2 * (n_blocked + n_left):
            n_left -= 1
            u, v, w = samples[n_left, 0], samples[n_left, 1], samples[n_left, 2]
            point = (
                u * a[0] + v * b[0] + w * c[0],
                u * a[1] + v * b[1] + w * c[1],
                u * a[2] + v * b[2] + w * c[2],
            )
            towards = (
                eye[0] - eye[3] * point[0],
                eye[1] - eye[3] * point[1],
                eye[2] - eye[3] * point[2],
            )
            distance = np.sqrt(dot(towards, towards))
            if distance == 0.0:
                continue
            along = (towards[0] / distance, towards[1] / distance, towards[2] / distance)
            length = distance if eye[3] != 0.0 else np.inf
            if _is_blocked(tree, face_ids[k], point, along, length, stack):
                n_blocked += 1
        hidden[k] = 2 * n_blocked > len(samples)
