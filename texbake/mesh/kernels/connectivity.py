"""How triangles hang together: components by union-find, fans around a vertex, paired edges.

Based on:
    H. Edelsbrunner, J. Harer, "Computational Topology", American Mathematical Society, 2010
        (union-find);
    Morten S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", master's thesis, University of
        Copenhagen, 2008 (the fans of MikkTSpace, which `tangents` describes).
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel


@kernel
def _root_kernel(parents, vertex):  # type: ignore[no-untyped-def]
    while parents[vertex] != vertex:
        parents[vertex] = parents[parents[vertex]]
        vertex = parents[vertex]
    return vertex


@kernel
def components_kernel(faces, parents, components):  # type: ignore[no-untyped-def]
    """Join the vertices of each face under the least of them, then number the sets in order."""
    for face in range(len(faces)):
        a = _root_kernel(parents, faces[face, 0])
        for corner in range(1, 3):
            b = _root_kernel(parents, faces[face, corner])
            if a < b:
                parents[b] = a
            else:
                parents[a] = b
                a = b
    numbers = np.full(len(parents), -1, dtype=np.int32)
    n_components = 0
    for face in range(len(faces)):
        root = _root_kernel(parents, faces[face, 0])
        if numbers[root] < 0:
            numbers[root] = n_components
            n_components += 1
        components[face] = numbers[root]
    return n_components


@kernel
def has_pinched_vertex_kernel(faces, n_vertices):  # type: ignore[no-untyped-def]
    """Whether some vertex has more than one fan of faces, in a closed and oriented mesh.

    Around a vertex each face leads from its next corner to the one after. In such a mesh each of
    those is led to once, so that the faces form rings; there must be one ring.
    """
    starts = np.zeros(n_vertices + 1, dtype=np.int64)
    for face in range(len(faces)):
        for corner in range(3):
            starts[faces[face, corner] + 1] += 1
    for vertex in range(n_vertices):
        starts[vertex + 1] += starts[vertex]
    fill = starts[:-1].copy()
    corners = np.empty(3 * len(faces), dtype=np.int64)
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            corners[fill[vertex]] = 3 * face + corner
            fill[vertex] += 1
    leads_to = np.zeros(n_vertices, dtype=np.int32)
    for vertex in range(n_vertices):
        n_faces = starts[vertex + 1] - starts[vertex]
        first = -1
        for slot in range(starts[vertex], starts[vertex + 1]):
            face, corner = corners[slot] // 3, corners[slot] % 3
            first = faces[face, (corner + 1) % 3]
            leads_to[first] = faces[face, (corner + 2) % 3]
        at, n_steps = first, 0
        while n_steps < n_faces:
            at = leads_to[at]
            n_steps += 1
            if at == first:
                break
        if n_steps < n_faces:
            return True
    return False


@kernel
def pair_edges_kernel(keys, edges, starts, neighbors):  # type: ignore[no-untyped-def]
    """Pair edges of one key, first come, first served; `edges` lists them sorted by key."""
    waiting = 0  # the first edge of this key that may still be free; all free ones run its way
    for i in range(len(edges)):
        edge = edges[i]
        if keys[edge] != keys[edges[waiting]]:
            waiting = i
        while waiting < i and neighbors[edges[waiting]] >= 0:
            waiting += 1
        other = edges[waiting]
        if starts[other] != starts[edge]:
            neighbors[edge] = other // 3
            neighbors[other] = edge // 3


@kernel
def fans_kernel(vertices, neighbors, unmapped, preserving, fans, fan_preserving):  # type: ignore[no-untyped-def]
    """Number the fans: write each corner's fan and each fan's orientation; return how many.

    An unmapped face takes its orientation in `preserving` from the first fan that it joins.
    A fan is a path around its vertex: from the corner it starts at, first across the edge that
    leaves the vertex, then across the one that arrives.
    """
    n_fans = 0
    for start in range(len(vertices)):
        for corner in range(3):
            if unmapped[start] or fans[start, corner] >= 0:
                continue
            fans[start, corner] = n_fans
            fan_preserving[n_fans] = preserving[start]
            for side in range(0, 3, 2):
                face = neighbors[start, (corner + side) % 3]
                while face >= 0:
                    at = 0
                    while vertices[face, at] != vertices[start, corner]:
                        at += 1
                    if fans[face, at] >= 0:
                        break
                    is_free = fans[face, 0] < 0 and fans[face, 1] < 0 and fans[face, 2] < 0
                    if unmapped[face] and is_free:
                        preserving[face] = preserving[start]
                    if preserving[face] != preserving[start]:
                        break
                    fans[face, at] = n_fans
                    face = neighbors[face, (at + side) % 3]
            n_fans += 1
    return n_fans
