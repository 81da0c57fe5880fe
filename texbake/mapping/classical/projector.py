"""Projector mapping: an image cast onto the mesh as by a slide projector.

A 4 x 4 matrix M gives (s, t, r, q) = M P, and the texture coordinates are s / q and t / q. With
q = 1 everywhere the rays are parallel. Only what the projector sees should carry the image, so
faces that look away from it, are hidden by others or lie behind it are told apart.

The convention of the camera is that of previews (`texbake.rendering.camera`), so that an image of a
preview lands where it was taken: +y is up; the projector looks at the center of the bounding box;
azimuth 0 looks at the front, from +z, and grows counter-clockwise seen from above; the default
distance is 1.03 R / sin(fov / 2), which fits the sphere of radius R about that center into the
image. The image is square and fills the unit square.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992 (projective textures). It departs in deciding what is in shadow by
rays, face by face, instead of by a depth map, pixel by pixel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.kernels.ray_occlusion import mostly_hidden_kernel
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.checks import Matrix
from texbake.mesh.files.number_lines import parse_row, read_lines
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands

BoolArray = npt.NDArray[np.bool_]

# Room about the bounding sphere, as in previews.
_MARGIN = 1.03

# Of the greatest |q|: what lies nearer to the projector counts as behind it, and is divided by this
# much instead, so that every coordinate is finite.
_LEAST_Q = 2.0**-20

# Rows that are this near to depending on one another, of unit length each, are dependent: they come
# from matrices with six digits at the least, and leave a picture that is a line.
_DEPENDENT = 1e-9

# Rounding of the null vector of such rows, of unit length: a projector further away than its
# inverse, in sizes of the mesh, is at infinity.
_AT_INFINITY = 1e-13

_BAND = 1 << 12

# Weights of a face's corners in the points that stand for it: its centroid, and the middles
# between that and its corners. All lie inside, where no neighbor can touch.
_SAMPLES = frozen(np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0)


def camera_matrix(
    mesh: Mesh,
    camera: tuple[float, float] | tuple[float, float, float | None] | None = None,
    fov: float = 35.0,
) -> FloatArray:
    """Matrix of a projector that stands where a preview is taken from.

    Parameters
    ----------
    mesh : Mesh
        What it looks at.
    camera : (azimuth, elevation) or (azimuth, elevation, distance), optional
        In degrees and model units; None for (0, 0).
    fov : float
        Vertical field of view in degrees.

    Returns
    -------
    (4, 4) float64
        Takes (x, y, z, 1) in model space to (s, t, r, q): q is the depth along the view in model
        units, r the same; (s / q, t / q) has (0, 0) and (1, 1) at the lower left and upper right
        corner of the picture.
    """
    azimuth, elevation, *rest = camera or (0.0, 0.0)
    assert azimuth is not None and elevation is not None
    axes = _axes(math.radians(azimuth), math.radians(elevation))
    center, radius = _bounding_sphere(mesh)
    distance = rest[0] if rest and rest[0] is not None else None
    half = math.radians(fov) / 2.0
    if distance is None:
        distance = _MARGIN * radius / math.sin(half)
    right, up, back = axes
    focal = 1.0 / math.tan(half)
    rows = np.stack([0.5 * (focal * right - back), 0.5 * (focal * up - back), -back, -back])
    eye = center + distance * back
    return np.column_stack([rows, -rows @ eye])


def projector(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Cast the unit square of the texture onto a mesh.

    Parameters
    ----------
    mesh : Mesh
    options : UnwrapOptions
        `camera` and `fov`, or `matrix`; and `unseen`. Of a matrix with constant q only r says from
        which side the light comes: r grows with the distance from the projector. Where r does not
        change along the light, it comes from where the picture is not mirrored.

    Returns
    -------
    Projected
        Coordinates are s / q and t / q; a corner with q of less than a millionth of the greatest
        |q| gets that q. Tallies, of which a face is in the first that fits:

        - "faces behind the projector": a corner has such a q, or is behind.
        - "faces turned away": the light strikes their back, or passes along them; so do all faces
          without area.
        - "faces hidden": other faces stand before more than half of their samples, which are the
          centroid and the three points midway between it and the corners.

        With `unseen="aside"` all of these are moved into the next tile to the left: their
        coordinates are brought into the unit square and s is made less by 1.

    Raises
    ------
    OptionError
        The matrix flattens the picture to a line or a point.
    """
    local = LocalFrame.around(mesh)
    matrix = projector_matrix(mesh, options, local)
    seen_from = seen_from_of(matrix)
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[mesh.faces.ravel()] = True
    positions = np.zeros((mesh.n_vertices, 3))
    positions[used] = local.to_local(mesh.positions[used])

    corners, behind = _cast(positions, mesh.faces, used, matrix)
    away = ~behind & ~_turned_to(positions, mesh.faces, seen_from)
    hidden = _hidden(positions, mesh.faces, ~behind & ~away, seen_from)
    if options.unseen == "aside":
        unseen = behind | away | hidden
        corners[unseen] = np.clip(corners[unseen], 0.0, 1.0) - (1.0, 0.0)
    counts = {
        "faces behind the projector": behind,
        "faces turned away": away,
        "faces hidden": hidden,
    }
    tallies = {name: int(met.sum()) for name, met in counts.items() if met.any()}
    return Projected(corners=corners, tallies=tallies)


def _axes(azimuth: float, elevation: float) -> FloatArray:
    """Rows right, up, back (against the view) of the projector, in radians."""
    sin_a, cos_a = math.sin(azimuth), math.cos(azimuth)
    sin_e, cos_e = math.sin(elevation), math.cos(elevation)
    right = (cos_a, 0.0, -sin_a)
    back = (sin_a * cos_e, sin_e, cos_a * cos_e)
    return np.stack([right, np.cross(back, right), back])


def _bounding_sphere(mesh: Mesh) -> tuple[FloatArray, float]:
    """Middle of the bounding box, and radius about it; 1 for a mesh without extent."""
    local = LocalFrame.around(mesh)
    points = local.to_local(mesh.positions[mesh.faces.ravel()])
    radius = math.sqrt(float(np.einsum("ij,ij->i", points, points).max()))
    return local.center, radius / local.scale if radius > 0.0 else 1.0


def projector_matrix(mesh: Mesh, options: UnwrapOptions, local: LocalFrame) -> FloatArray:
    """(4, 4) float64: local (x, y, z, 1) to (s, t, r, q); q is 1 where it is constant."""
    if options.matrix is None:
        matrix = camera_matrix(mesh, options.camera, options.fov)
    else:
        matrix = np.array(options.matrix, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = np.column_stack([matrix[:, :3] / local.scale, matrix @ [*local.center, 1.0]])
        if not matrix[3, :3].any() and matrix[3, 3] != 0.0:
            matrix /= matrix[3, 3]
    if not np.isfinite(matrix).all():
        raise OptionError("matrix: it makes coordinates that are not finite")
    return matrix


def seen_from_of(matrix: FloatArray) -> FloatArray:
    """(4,) float64: where the light comes from: (x, y, z, 1), or a direction (x, y, z, 0).

    It is the one point that has no picture: s, t and q are 0 there.
    """
    rows = matrix[[0, 1, 3]]
    lengths = np.abs(rows).max(axis=1)
    if not lengths.all():
        raise OptionError("matrix: one of its rows s, t and q is 0; there is no picture")
    rows = rows / lengths[:, None]
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, directions = np.linalg.svd(rows)
    if sizes[2] < _DEPENDENT:
        raise OptionError("matrix: its rows s, t and q flatten the picture to a line")
    point = directions[3]
    if abs(point[3]) > _AT_INFINITY:
        return np.asarray(point / point[3])
    # Seen from there, s to the right and t upward, the picture is not mirrored ...
    if np.linalg.det(np.stack([*rows, point])) > 0.0:
        point = -point
    # ... but where r changes along the light, it knows better.
    r, towards = matrix[2, :3], point[:3]
    if r @ towards > _DEPENDENT * np.linalg.norm(r):
        towards = -towards
    return np.array([*towards / np.linalg.norm(towards), 0.0])


def _cast(
    positions: FloatArray, faces: IntArray, used: BoolArray, matrix: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """(F, 3, 2) float64 of s / q and t / q, and (F,) bool: faces with a corner behind."""
    x, y, z = positions.T
    # Term by term, so that points at one place get equal bits.
    s, t, q = (a * x + b * y + c * z + d for a, b, c, d in matrix[[0, 1, 3]])
    least = _LEAST_Q * (float(np.abs(q[used]).max()) or 1.0)
    behind = (q < least)[faces].any(axis=1)
    q = np.maximum(q, least)
    with np.errstate(over="ignore"):
        points = np.stack([s / q, t / q], axis=-1)
    if not np.isfinite(points[used]).all():
        raise OptionError("matrix: it makes coordinates that are not finite")
    return points[faces], behind


def _turned_to(positions: FloatArray, faces: IntArray, seen_from: FloatArray) -> BoolArray:
    """(F,) bool: faces that show their front to a point, (x, y, z, 1), or direction."""
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    towards = seen_from[:3] - seen_from[3] * a
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), towards) > 0.0)


def _hidden(
    positions: FloatArray, faces: IntArray, asked: BoolArray, seen_from: FloatArray
) -> BoolArray:
    """(F,) bool: which of the faces asked for other faces hide."""
    hidden = np.zeros(len(faces), dtype=bool)
    ids = np.flatnonzero(asked)
    if len(ids):
        tree = TriangleTree.build(positions, faces)
        hidden[ids] = mostly_hidden(tree, ids, seen_from)
    return hidden


def mostly_hidden(
    tree: TriangleTree,
    face_ids: npt.NDArray[np.integer[Any]],
    seen_from: FloatArray,
    *,
    threads: int | None = None,
) -> npt.NDArray[np.bool_]:
    """Tell which faces have other faces before more than half of their four sample points.

    Parameters
    ----------
    tree : TriangleTree
        In a frame in which the mesh has about unit size.
    face_ids : (n,) int
        Faces asked for.
    seen_from : (4,) float64
        A point as (x, y, z, 1), or the direction towards one at infinity as (x, y, z, 0).
    threads
        None for every processor.

    Returns
    -------
    (n,) bool
        Faces hide from either side; a face never hides itself, nor does one without area hide
        anything.
    """
    hidden = np.zeros(len(face_ids), dtype=bool)
    nodes = (tree.positions, tree.faces, tree.order, tree.boxes, tree.nodes)
    ids = frozen(np.ascontiguousarray(face_ids, dtype=np.int32))
    eye = frozen(np.ascontiguousarray(seen_from, dtype=np.float64))

    def work(start: int, stop: int) -> None:
        mostly_hidden_kernel(nodes, ids, _SAMPLES, eye, start, stop, hidden)

    run_bands(work, len(face_ids), band=_BAND, threads=threads)
    return hidden


def read_matrix(path: PathLike) -> Matrix:
    """Read sixteen numbers, row by row, with blanks, commas or line breaks between them.

    Parameters
    ----------
    path
        Text; what stands after `#` in a line is left out.

    Returns
    -------
    4 tuples of 4 floats
        The rows.

    Raises
    ------
    FileError
        The file cannot be read.
    FileFormatError
        It holds something else than sixteen finite numbers.
    """
    lines = read_lines(path, "a matrix")
    n_words = sum(len(line.words) for line in lines)
    if n_words != 16:
        raise FileFormatError(
            f"{path}: it has {n_words} words; a matrix needs 16 numbers, row by row"
        )
    values = [v for line in lines for v in parse_row(path, line, len(line.words), "a matrix")]
    a, b, c, d = ((v[0], v[1], v[2], v[3]) for v in (values[i : i + 4] for i in range(0, 16, 4)))
    return a, b, c, d
