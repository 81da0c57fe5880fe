"""Meshes of many triangles that share too much, or nothing, for trees, charts and rays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texbake.mesh.mesh import Mesh

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def _unshared(corners: np.ndarray) -> Mesh:
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return Mesh(positions=corners.reshape(-1, 3), faces=faces)


def stack(n: int) -> Mesh:
    """One triangle n times, each with vertices of its own."""
    return _unshared(np.broadcast_to(TRIANGLE, (n, 3, 3)).copy())


def same(n: int) -> Mesh:
    """One triangle n times, all with the same vertices."""
    return Mesh(positions=TRIANGLE, faces=np.tile(np.arange(3, dtype=np.int32), (n, 1)))


def stacks(n: int) -> Mesh:
    """A hundred triangles, each many times."""
    corners = np.random.default_rng(1).random((100, 3, 3))
    return _unshared(corners[np.arange(n) % 100])


def nearly(n: int) -> Mesh:
    """One triangle n times, each corner moved by up to 8 units in the last place of 1."""
    moves = np.random.default_rng(2).integers(-8, 9, (n, 3, 3)) * 2.0**-52
    return _unshared(1.0 + TRIANGLE + moves)


def loose(n: int) -> Mesh:
    """Triangles scattered through a cube, as large as the distances between them."""
    rng = np.random.default_rng(3)
    size = 2.0 * n ** (-1.0 / 3.0)
    return _unshared(rng.random((n, 1, 3)) + size * rng.random((n, 3, 3)))


def crossing(n: int) -> Mesh:
    """Triangles as large as the cube that they are scattered through."""
    return _unshared(np.random.default_rng(4).random((n, 3, 3)))


def fan(n: int) -> Mesh:
    """A cone: all triangles share its tip, and neighbors an edge."""
    angles = 2.0 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(n)], axis=1)
    around = np.arange(n, dtype=np.int32)
    faces = np.stack([np.full(n, n, dtype=np.int32), around, np.roll(around, -1)], axis=1)
    return Mesh(positions=np.concatenate([ring, [[0.0, 0.0, 1.0]]]), faces=faces)


def star(n: int) -> Mesh:
    """Triangles in all directions that share one vertex and no edge."""
    ends = np.random.default_rng(5).normal(size=(n, 2, 3))
    ends[:, 1] = ends[:, 0] + 0.01 * ends[:, 1]
    ring = np.arange(2 * n, dtype=np.int32).reshape(-1, 2)
    faces = np.concatenate([np.full((n, 1), 2 * n, dtype=np.int32), ring], axis=1)
    return Mesh(positions=np.concatenate([ends.reshape(-1, 3), np.zeros((1, 3))]), faces=faces)


def book(n: int) -> Mesh:
    """Triangles that all share one edge."""
    angles = 2.0 * np.pi * np.arange(n) / n
    ends = np.stack([np.cos(angles), np.full(n, 0.5), np.sin(angles)], axis=1)
    spine = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    faces = np.stack([np.full(n, n), np.full(n, n + 1), np.arange(n)], axis=1)
    return Mesh(positions=np.concatenate([ends, spine]), faces=faces.astype(np.int32))


def point(n: int) -> Mesh:
    """Triangles without extent, all at one point."""
    return _unshared(np.ones((n, 3, 3)))


SOUPS: dict[str, Callable[[int], Mesh]] = {
    make.__name__: make
    for make in (stack, same, stacks, nearly, loose, crossing, fan, star, book, point)
}


def with_uvs(mesh: Mesh) -> Mesh:
    """Give each triangle a cell of its own in the texture."""
    side = int(np.ceil(np.sqrt(mesh.n_faces)))
    cells = np.stack(np.divmod(np.arange(mesh.n_faces), side)[::-1], axis=1)
    uvs = (cells[:, None] + 0.9 * TRIANGLE[:, :2]) / side
    corners = np.arange(3 * mesh.n_faces, dtype=np.int32).reshape(-1, 3)
    return mesh.replace(uvs=uvs.reshape(-1, 2), uv_faces=corners)


def with_stacked_uvs(mesh: Mesh) -> Mesh:
    """Give all triangles the same place in the texture."""
    return mesh.replace(
        uvs=TRIANGLE[:, :2], uv_faces=np.tile(np.arange(3, dtype=np.int32), (mesh.n_faces, 1))
    )
