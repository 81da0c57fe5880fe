"""Cube maps: six square images that hold a value for every direction, and their smaller levels.

A direction belongs to the face of its largest component. Its other two components, divided by that
one, run from -1 to 1 over the face and become s and t from 0 to 1, s to the right and t down from
the top row of the image.

Lookups know no edges: every face is held with a border of one texel that repeats the texels beyond
its edges, so that interpolation near an edge or a corner reads what lies there on the neighboring
face and gives the same value from either side. In a corner, where only three texels meet, the
fourth is their mean.

Based on: the OpenGL 4.6 specification, table 8.19 and sections 8.13 and 8.14 (seamless cube maps),
which Vulkan, Direct3D, KTX and glTF's image-based lighting share: a shader that looks up a
direction of the world reads the same texel. That table is left-handed: seen from inside a
right-handed world, every face is mirrored left to right (`CubeMap.from_views` turns what a camera
saw into faces). For the solid angle of a texel: Ström, "Solid angle of a cubemap texel", 2011. A
smaller level is the mean over the texels it covers, weighted by their solid angles, so that no
level gains or loses energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.parallel import run_bands
from texbake.texture.cube_kernels import FACE_AXES, shrink_cube_kernel

FACES = ("px", "nx", "py", "ny", "pz", "nz")


@dataclass(frozen=True, eq=False)
class CubeMap:
    """Six square images about a point.

    Attributes
    ----------
    faces : (6, S, S, C) float32
        Of the directions +x, -x, +y, -y, +z and -z, linear, row 0 at the top (t = 0). Read-only.
        Values that are not finite are held as 0, so that no filter can spread them.

    Raises
    ------
    OptionError
        The array has another shape, or no texel.
    """

    faces: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        faces = np.asarray(self.faces, np.float32)
        if faces.ndim != 4 or faces.shape[0] != 6 or faces.shape[1] != faces.shape[2]:
            raise OptionError(f"faces: the shape {faces.shape} is not (6, size, size, channels)")
        if faces.size == 0:
            raise OptionError(f"faces: the shape {faces.shape} has no texel; give at least one")
        faces = without_gaps(faces).view()
        faces.flags.writeable = False
        object.__setattr__(self, "faces", faces)

    @property
    def size(self) -> int:
        """Texels along one side of a face."""
        return int(self.faces.shape[1])

    @property
    def n_channels(self) -> int:
        """Channels of a texel."""
        return int(self.faces.shape[3])

    @cached_property
    def bordered(self) -> npt.NDArray[np.float32]:
        """Faces with a border of one texel, (6, S + 2, S + 2, C): what lookups read. Made once."""
        side = self.size + 2
        bordered = np.empty((6, side, side, self.n_channels), np.float32)
        fill_bordered(self.faces, bordered)
        bordered.flags.writeable = False
        return bordered

    @classmethod
    def from_views(cls, views: npt.NDArray[Any]) -> CubeMap:
        """Cube map of the six pictures that cameras with `cube_face_axes` took.

        Parameters
        ----------
        views : (6, S, S, C) float32
            As seen from the point, row 0 at the top.
        """
        return cls(np.asarray(views, np.float32)[:, :, ::-1])


def without_gaps(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the values with 0 for those that are not finite; the same array where all are."""
    finite = np.isfinite(values)
    return values if finite.all() else np.where(finite, values, np.float32(0.0))


def cube_face_axes(face: int) -> npt.NDArray[np.float64]:
    """Axes of the camera of 90 degrees that takes a face from the middle of the cube.

    Parameters
    ----------
    face
        0 to 5: +x, -x, +y, -y, +z, -z.

    Returns
    -------
    (3, 3) float64
        Rows right, up and back (away from what it sees) in world space: a rotation. The picture it
        takes, mirrored left to right, is the face; see `CubeMap.from_views`.

    Raises
    ------
    OptionError
        There is no such face.

    Examples
    --------
    >>> (cube_face_axes(5) + 0.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if not 0 <= face < 6:
        raise OptionError(f"face: {face} is no face of a cube; they are 0 to 5")
    axes: npt.NDArray[np.float64] = -FACE_AXES[face]
    return axes


def face_directions(size: int) -> npt.NDArray[np.float64]:
    """Directions through the centers of all texels.

    Returns
    -------
    (6, size, size, 3) float64
        Not normalized: their largest component is 1 or -1.
    """
    along = (2.0 * np.arange(size) + 1.0) / size - 1.0
    t, s = np.meshgrid(along, along, indexing="ij")
    directions: npt.NDArray[np.float64] = np.stack([s, t, np.ones_like(s)], 2) @ FACE_AXES[:, None]
    return directions


@lru_cache(maxsize=16)
def texel_directions(size: int) -> npt.NDArray[np.float32]:
    """Unit directions through the centers of all texels, (6, size, size, 3) float32, read-only."""
    directions = face_directions(size)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    unit = directions.astype(np.float32)
    unit.flags.writeable = False
    return unit


@lru_cache(maxsize=16)
def solid_angles(size: int) -> npt.NDArray[np.float64]:
    """Solid angle of each texel of a face in steradians; those of six faces sum to 4 pi.

    Returns
    -------
    (size, size) float64
        Exact, by the integral over each texel. Read-only.
    """
    edges = np.linspace(-1.0, 1.0, size + 1)
    x, y = np.meshgrid(edges, edges)
    # Solid angle from the middle of the face to a point on it, and so of any rectangle.
    corner = np.arctan2(x * y, np.sqrt(x * x + y * y + 1.0))
    angles = np.diff(np.diff(corner, axis=0), axis=1)
    angles.flags.writeable = False
    return angles


def locate_directions(
    directions: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[Any], npt.NDArray[np.float64]]:
    """Face, s and t of directions that are not 0.

    Parameters
    ----------
    directions : (..., 3) float64
        Of any length.

    Returns
    -------
    faces : (...) int64
        Of the largest component; of the first, where several are equally large.
    st : (..., 2) float64
        In [0, 1], s to the right and t down.
    """
    heights = directions @ FACE_AXES[:, 2].T
    faces = np.argmax(heights, axis=-1)
    largest = np.take_along_axis(heights, faces[..., None], axis=-1)
    across = np.einsum("...ij,...j->...i", FACE_AXES[faces, :2], directions)
    return faces, (across / largest + 1.0) / 2.0


def fill_bordered(faces: npt.NDArray[np.float32], out: npt.NDArray[np.float32]) -> None:
    """Copy faces into the middle of `out`, and into its border what lies beyond their edges.

    Parameters
    ----------
    faces : (6, S, S, C) float32
    out : (6, S + 2, S + 2, C) float32
        Written. In a corner, where only three texels meet, the fourth is their mean.
    """
    out[:, 1:-1, 1:-1] = faces
    for side, (neighbors, rows, columns) in zip(
        (out[:, 1:-1, 0], out[:, 1:-1, -1], out[:, 0, 1:-1], out[:, -1, 1:-1]),
        _beyond_edges(faces.shape[1]),
        strict=True,
    ):
        side[:] = faces[neighbors, rows, columns]
    for row, inner_row in (0, 1), (-1, -2):
        for column, inner_column in (0, 1), (-1, -2):
            own = out[:, inner_row, inner_column].astype(np.float64)
            out[:, row, column] = (own + out[:, inner_row, column] + out[:, row, inner_column]) / 3


@lru_cache(maxsize=32)
def _beyond_edges(size: int) -> tuple[tuple[npt.NDArray[Any], ...], ...]:
    """Texels beyond the left, right, top and bottom edges, each as faces, rows and columns (6, S).

    They are found by walking around the edge of the cube: half a texel down on the other side.
    """
    along = (2.0 * np.arange(size) + 1.0) / size - 1.0
    right, down, middle = (FACE_AXES[:, None, axis] for axis in range(3))
    inward = (1.0 - 1.0 / size) * middle
    found = []
    for outward, other in (-right, down), (right, down), (-down, right), (down, right):
        faces, st = locate_directions(outward + inward + along[None, :, None] * other)
        # Centers of texels exactly, but for rounding.
        columns, rows = np.moveaxis(np.floor(st * size).astype(np.int64), -1, 0)
        found.append((faces, rows, columns))
    return tuple(found)


# Rows of faces a band.
_BAND = 64


@dataclass(frozen=True, eq=False)
class CubeChain:
    """Levels of a cube map, the finest first.

    Attributes
    ----------
    texels : (N, C) float32
        All levels one after another; of each the six faces, of each face its rows from the top,
        with the border of one texel. Read-only.
    offsets : (L,) int64
        Index of the first texel of each level.
    sizes : (L,) int64
        Texels along one side of a face of each level, without the border.
    """

    texels: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        for name in "texels", "offsets", "sizes":
            array = getattr(self, name).view()
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def of(cls, levels: Sequence[CubeMap]) -> CubeChain:
        """Chain of cube maps of any sizes, in this order, with equally many channels.

        Raises
        ------
        OptionError
            There is none, or their channels differ.
        """
        channels = {level.n_channels for level in levels}
        if len(channels) != 1:
            raise OptionError(
                f"levels: {len(levels)} cube maps with {sorted(channels)} channels; give at least "
                "one, and all with equally many"
            )
        sizes = np.array([level.size for level in levels], np.int64)
        lengths = 6 * (sizes + 2) ** 2
        offsets = np.cumsum(lengths) - lengths
        texels = np.empty((int(lengths.sum()), channels.pop()), np.float32)
        for level, offset, length in zip(levels, offsets, lengths, strict=True):
            side = level.size + 2
            fill_bordered(level.faces, texels[offset : offset + length].reshape(6, side, side, -1))
        return cls(texels, offsets, sizes)

    @property
    def n_levels(self) -> int:
        """Number of levels."""
        return len(self.sizes)

    @property
    def n_channels(self) -> int:
        """Channels of a texel."""
        return int(self.texels.shape[1])

    @property
    def size(self) -> int:
        """Texels along one side of a face of the finest level."""
        return int(self.sizes[0])

    def level(self, index: int) -> CubeMap:
        """Return one level, without its borders; it shares the chain's memory."""
        side = int(self.sizes[index]) + 2
        offset = int(self.offsets[index])
        bordered = self.texels[offset : offset + 6 * side * side].reshape(6, side, side, -1)
        return CubeMap(bordered[:, 1:-1, 1:-1])


def shrink_cube(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
    """Cube map of fewer texels: means over what each covers, weighted by solid angle.

    Parameters
    ----------
    cube
        Returned as it is if it has that size.
    size
        Texels along one side; at most as many as the cube map has.

    Raises
    ------
    OptionError
        The size is below 1 or too large.

    The integral over all directions stays as it was, exactly where the old size is a multiple of
    the new; a constant stays exactly as it is.
    """
    if not 1 <= size <= cube.size:
        raise OptionError(f"size: {size} is not from 1 to {cube.size}, the size of the cube map")
    if size == cube.size:
        return cube
    faces = np.ascontiguousarray(cube.faces)
    faces.flags.writeable = False
    out = np.empty((6, size, size, cube.n_channels), np.float32)
    weights = solid_angles(cube.size)

    def work(start: int, stop: int) -> None:
        shrink_cube_kernel(faces, weights, out, start, stop)

    run_bands(work, 6 * size, band=_BAND, threads=threads)
    return CubeMap(out)


def cube_chain(cube: CubeMap, *, threads: int | None = None) -> CubeChain:
    """Chain of a cube map and its smaller levels, each half as large, down to one texel a face.

    Parameters
    ----------
    cube
        Of any size; an odd one is halved rounding down.

    Returns
    -------
    CubeChain
    """
    levels = [cube]
    while levels[-1].size > 1:
        levels.append(shrink_cube(levels[-1], levels[-1].size // 2, threads=threads))
    return CubeChain.of(levels)
