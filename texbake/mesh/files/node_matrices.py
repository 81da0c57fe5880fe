"""Matrices of nodes: composed of translation, rotation and scale, decomposed, and inverted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray

# Least determinant of a map with columns of length 1 that is inverted: float64 leaves four digits.
_LEAST_DETERMINANT = 1e-12


def rotation_matrices(quaternions: FloatArray) -> FloatArray:
    """(n, 3, 3) matrices of quaternions; one of length 0 is the identity."""
    lengths = np.sqrt(pm.matmul(quaternions[:, None], quaternions[:, :, None]))[:, :, 0]
    units = np.tile([0.0, 0.0, 0.0, 1.0], (len(quaternions), 1))
    np.divide(quaternions, lengths, out=units, where=lengths > 0.0)
    x, y, z, w = units.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).reshape(3, 3, -1).transpose(2, 0, 1)


def decomposed(matrices: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Translations, rotations and scales; each quaternion has the sign nearer to the one before."""
    linear = matrices[:, :3, :3]
    scales = np.sqrt((linear * linear).sum(axis=1))
    scales[pm.det(linear) < 0.0, 0] *= -1.0
    units = np.divide(linear, scales[:, None], out=np.tile(np.eye(3), (len(linear), 1, 1)),
                      where=scales[:, None] != 0.0)  # fmt: skip
    trace = units[:, 0, 0] + units[:, 1, 1] + units[:, 2, 2]
    table = np.empty((len(units), 4, 4))  # each row a multiple of the quaternion
    m = units
    table[:, 3, 3] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        table[:, i, i] = 1.0 + 2.0 * m[:, i, i] - trace
        table[:, i, j] = table[:, j, i] = m[:, i, j] + m[:, j, i]
        table[:, i, 3] = table[:, 3, i] = m[:, k, j] - m[:, j, k]
    best = np.argmax(table[:, range(4), range(4)], axis=1)
    rows = table[np.arange(len(table)), best]
    rows /= np.sqrt((rows * rows).sum(axis=1, keepdims=True))
    signs = np.sign((rows[1:] * rows[:-1]).sum(axis=1))
    rows[1:] *= np.cumprod(np.where(signs < 0.0, -1.0, 1.0))[:, None]
    return matrices[:, :3, 3], rows, scales


def node_fields(matrix: FloatArray) -> dict[str, list[float]]:
    """Translation, rotation and scale of a node with a (4, 4) matrix; shear is lost."""
    rows = (values[0].tolist() for values in decomposed(matrix[None]))
    return dict(zip(("translation", "rotation", "scale"), rows, strict=True))


def matrix_field(matrix: FloatArray) -> dict[str, list[float]]:
    """A (4, 4) matrix as a field of a node, column after column."""
    return {"matrix": matrix.T.ravel().tolist()}


def node_matrix(node: Mapping[str, Any]) -> FloatArray:
    """(4, 4) matrix of a node in its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    rotation = np.array([node.get("rotation", (0.0, 0.0, 0.0, 1.0))], np.float64)
    matrix[:3, :3] = rotation_matrices(rotation)[0] * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def inverse(matrix: FloatArray) -> FloatArray | None:
    """Inverse of a (4, 4) matrix; None where it flattens what it moves."""
    with np.errstate(all="ignore"):
        lengths = pm.norm(matrix[:3, :3], axis=0)
        if not ((lengths > 0.0) & np.isfinite(lengths)).all():
            return None
        if not abs(pm.det(matrix[:3, :3] / lengths)) > _LEAST_DETERMINANT:
            return None
        found = np.asarray(pm.inv(matrix), np.float64)
    return found if np.isfinite(found).all() else None


def inverse_or_identity(matrix: FloatArray) -> FloatArray:
    """Inverse of a (4, 4) matrix; the identity where it has none."""
    found = inverse(matrix)
    return np.eye(4) if found is None else found
