"""Cube maps: six square images with a value for every direction, and their mip levels.

A direction belongs to the face of its largest component. Its other two components, divided by the
largest, run from -1 to 1 over the face and become s and t from 0 to 1, s to the right and t down
from the top row of the image.

Lookups are seamless: every face is stored with a border of one texel that repeats the texels of the
neighboring faces, so interpolation near an edge or a corner gives the same value from either side.
At a corner, where only three texels meet, the fourth is their mean.

Based on: the OpenGL 4.6 specification, table 8.19 and sections 8.13 and 8.14 (seamless cube maps),
which Vulkan, Direct3D, KTX and glTF's image-based lighting share: a shader that looks up a
direction in world space reads the same texel. That table is left-handed: seen from inside a
right-handed world, every face is mirrored left to right (`CubeMap.from_views` converts camera
images into faces). For the solid angle of a texel: Ström, "Solid angle of a cubemap texel", 2011.
Each texel of a smaller level is the mean of the texels it covers, weighted by their solid angles,
so that no level gains or loses energy. Kernel: `core/cube_maps.c`.

The center of a latitude-longitude image looks along -z, +x is to the right of it and +y is up. With
u from 0 at the left edge to 1 and v from 0 at the bottom to 1,

    u = atan2(x, -z) / 2 pi + 1/2,    v = asin(y) / pi + 1/2.

Each texel of a converted image is the mean of the area that it covers, weighted by solid angle.
Lookups are at most half a texel of the source apart. Toward the poles of a latitude-longitude
image, each row is first averaged over the texels that lie between two lookups. Directions that are
zero or not finite give 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache, partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, require_known, require_least
from texbake.mesh.mesh import AnyArray, Float32Array, FloatArray, Int64Array
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.lookup import require_image

# Of each face: the directions in which s and t grow, and the direction of its middle.
FACE_AXES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    np.float64,
)


@dataclass(frozen=True, eq=False)
class CubeMap:
    """Six square images of the surroundings of a point."""

    # (6, S, S, C) float32: faces +x, -x, +y, -y, +z and -z, linear, row 0 at the top (t = 0).
    # Read-only. Values that are not finite are replaced by 0, so that no filter can spread them.
    faces: Float32Array

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
        """Side of a face in texels."""
        return int(self.faces.shape[1])

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return int(self.faces.shape[3])

    @cached_property
    def bordered(self) -> Float32Array:
        """Faces with a border of one texel, (6, S + 2, S + 2, C), for lookups; computed once."""
        side = self.size + 2
        bordered = np.empty((6, side, side, self.n_channels), np.float32)
        fill_bordered(self.faces, bordered)
        bordered.flags.writeable = False
        return bordered

    @classmethod
    def from_views(cls, views: AnyArray) -> CubeMap:
        """Cube map of views (6, S, S, C) by cameras with `cube_face_axes`, row 0 at the top."""
        return cls(np.asarray(views, np.float32)[:, :, ::-1])


def without_gaps(values: Float32Array) -> Float32Array:
    """Replace NaN and infinities, which filters would spread, by 0; copy only if there are any."""
    finite = np.isfinite(values)
    return values if finite.all() else np.where(finite, values, np.float32(0.0))


def cube_face_axes(face: int) -> FloatArray:
    """(3, 3) axes of the 90 degree camera that renders a face from the center of the cube."""
    if not 0 <= face < 6:
        raise OptionError(f"face: {face} is not a face of a cube; the faces are 0 to 5")
    axes: FloatArray = -FACE_AXES[face]
    return axes


def face_directions(size: int) -> FloatArray:
    """(6, size, size, 3) directions through texel centers, their largest component 1 or -1."""
    along = (2.0 * np.arange(size) + 1.0) / size - 1.0
    t, s = np.meshgrid(along, along, indexing="ij")
    directions: FloatArray = pm.matmul(np.stack([s, t, np.ones_like(s)], 2), FACE_AXES[:, None])
    return directions


@lru_cache(maxsize=16)
def texel_directions(size: int) -> Float32Array:
    """Return unit directions through all texel centers, (6, size, size, 3) float32, read-only."""
    directions = face_directions(size)
    directions /= pm.norm(directions, axis=-1, keepdims=True)
    unit = directions.astype(np.float32)
    unit.flags.writeable = False
    return unit


@lru_cache(maxsize=16)
def solid_angles(size: int) -> FloatArray:
    """(size, size) exact steradians of the texels of a face; six faces sum to 4 pi."""
    edges = np.linspace(-1.0, 1.0, size + 1)
    x, y = np.meshgrid(edges, edges)
    # Solid angle of the rectangle from the center of the face to a point on it; differences of
    # these give any other rectangle.
    corner = pm.arctan2(x * y, np.sqrt(x * x + y * y + 1.0))
    angles = np.diff(np.diff(corner, axis=0), axis=1)
    angles.flags.writeable = False
    return angles


def locate_directions(directions: FloatArray) -> tuple[AnyArray, FloatArray]:
    """Face (...) int64, of the first largest component, and (s, t) right and down, (..., 2)."""
    heights = pm.matmul(directions, FACE_AXES[:, 2].T)
    faces = np.argmax(heights, axis=-1)
    largest = np.take_along_axis(heights, faces[..., None], axis=-1)
    across = pm.matvec(FACE_AXES[faces, :2], directions)
    return faces, (across / largest + 1.0) / 2.0


def fill_bordered(faces: Float32Array, out: Float32Array) -> None:
    """Copy faces (6, S, S, C) into `out`, (6, S + 2, S + 2, C), with neighbors as border."""
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
def _beyond_edges(size: int) -> tuple[tuple[AnyArray, ...], ...]:
    """Faces, rows and columns (6, S) of texels beyond the left, right, top and bottom edges."""
    along = (2.0 * np.arange(size) + 1.0) / size - 1.0
    right, down, middle = (FACE_AXES[:, None, axis] for axis in range(3))
    inward = (1.0 - 1.0 / size) * middle
    found = []
    for outward, other in (-right, down), (right, down), (-down, right), (down, right):
        faces, st = locate_directions(outward + inward + along[None, :, None] * other)
        # Texel centers, up to rounding.
        columns, rows = np.moveaxis(np.floor(st * size).astype(np.int64), -1, 0)
        found.append((faces, rows, columns))
    return tuple(found)


# Rows of faces per band.
_BAND = 64


@dataclass(frozen=True, eq=False)
class CubeChain:
    """A cube map and its mip levels, finest first."""

    # (N, C) float32; all levels one after another, each as six faces with a border of one texel,
    # rows from top to bottom. Read-only.
    texels: Float32Array
    offsets: Int64Array  # (L,) int64; index of the first texel of each level
    # (L,) int64; side of a face of each level in texels, without the border.
    sizes: Int64Array

    def __post_init__(self) -> None:
        for name in "texels", "offsets", "sizes":
            array = getattr(self, name).view()
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def of(cls, levels: Sequence[CubeMap]) -> CubeChain:
        """Return a chain of cube maps of any sizes, in this order, with the same channels."""
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
        """Number of channels."""
        return int(self.texels.shape[1])

    @property
    def size(self) -> int:
        """Side of a face of the finest level in texels."""
        return int(self.sizes[0])

    def level(self, index: int) -> CubeMap:
        """Return one level without its borders, a view of the chain's memory."""
        side = int(self.sizes[index]) + 2
        offset = int(self.offsets[index])
        bordered = self.texels[offset : offset + 6 * side * side].reshape(6, side, side, -1)
        return CubeMap(bordered[:, 1:-1, 1:-1])


def shrink_cube(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
    """Scale a cube map down, with means by solid angle that keep constants and the integral."""
    if not 1 <= size <= cube.size:
        raise OptionError(f"size: {size} is not from 1 to {cube.size}, the size of the cube map")
    if size == cube.size:
        return cube
    faces = np.ascontiguousarray(cube.faces)
    out = np.empty((6, size, size, cube.n_channels), np.float32)
    work = partial(core.shrink_cube_rows, faces, solid_angles(cube.size), out)
    run_bands(work, 6 * size, band=_BAND, threads=threads)
    return CubeMap(out)


def cube_chain(cube: CubeMap, *, threads: int | None = None) -> CubeChain:
    """Compute the mip levels of a cube map, each half as large, down to one texel per face."""
    levels = [cube]
    while levels[-1].size > 1:
        levels.append(shrink_cube(levels[-1], levels[-1].size // 2, threads=threads))
    return CubeChain.of(levels)


# As in `core/cube_maps.c`.
CUBE_FILTER_CODES = {"nearest": 0, "bilinear": 1, "trilinear": 2}
CUBE_FILTERS = tuple(CUBE_FILTER_CODES)

# Directions per band: a few milliseconds of work.
_LOOKUP_BAND = 1 << 16


def sample_cube(
    cube: CubeMap | CubeChain,
    directions: AnyArray,
    levels: AnyArray | None = None,
    *,
    filter: str = "bilinear",  # noqa: A002  # what the field calls it
    threads: int | None = None,
) -> Float32Array:
    """(n, C) values of a cube map in directions (n, 3), without seams, at levels (n,)."""
    require_known("filter", filter, CUBE_FILTERS)
    if isinstance(cube, CubeMap):
        texels = cube.bordered.reshape(-1, cube.n_channels)
        offsets, sizes = np.zeros(1, np.int64), np.full(1, cube.size, np.int64)
    else:
        texels, offsets, sizes = cube.texels, cube.offsets, cube.sizes
    directions = np.require(directions, np.float32, ["C", "A"])
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise OptionError(f"directions: the shape {directions.shape} is not (n, 3)")
    wanted = None if levels is None else np.require(levels, np.float32, ["C", "A"])
    if wanted is not None and wanted.shape != directions.shape[:1]:
        raise OptionError(f"levels: the shape {wanted.shape} is not ({len(directions)},)")
    out = np.empty((len(directions), cube.n_channels), np.float32)
    mode = CUBE_FILTER_CODES[filter]
    work = partial(core.sample_cube, texels, offsets, sizes, directions, wanted, mode, out)
    run_bands(work, len(directions), band=_LOOKUP_BAND, threads=threads)
    return out


def resize_cube(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
    """Resize a cube map: with `shrink_cube` to fewer texels, by interpolation to more."""
    if size <= cube.size:
        return shrink_cube(cube, size, threads=threads)
    directions = texel_directions(size).reshape(-1, 3)
    return CubeMap(sample_cube(cube, directions, threads=threads).reshape(6, size, size, -1))


# Lookups per band: a few milliseconds of work.
_LATITUDE_BAND = 1 << 17


def from_latitude_longitude(
    image: AnyArray, *, size: int | None = None, threads: int | None = None
) -> CubeMap:
    """Cube map with faces of `size` texels of a linear (H, W, C) image, row 0 at the top."""
    pixels = require_image(image)
    height, width, n_channels = pixels.shape
    size = max(width // 4, 1) if size is None else size
    require_least("size", size)
    # Texels at the center of a face are the widest: 2 / size radians.
    finest = min(2 * math.pi / width, math.pi / height)
    n_lookups = max(1, math.ceil(2.0 / size / (finest / 2)))
    rows = _with_wide_texels(without_gaps(pixels), 2.0 / size / n_lookups)
    out = np.empty((6, size, size, n_channels), np.float32)
    work = partial(core.convert_to_cube, rows, n_lookups, out)
    run_bands(work, 6 * size, band=max(1, _LATITUDE_BAND // (size * n_lookups**2)), threads=threads)
    return CubeMap(out)


def to_latitude_longitude(
    cube: CubeMap, *, height: int | None = None, threads: int | None = None
) -> Float32Array:
    """(height, 2 height, C) latitude-longitude image of a cube map."""
    height = 2 * cube.size if height is None else height
    require_least("height", height)
    texels = cube.bordered.reshape(-1, cube.n_channels)
    # Texels in the middle of an edge of a face are 1 / size radians wide.
    n_lookups = max(1, math.ceil(math.pi / height / (0.5 / cube.size)))
    out = np.empty((height, 2 * height, cube.n_channels), np.float32)
    work = partial(core.convert_from_cube, texels, cube.size, n_lookups, out)
    run_bands(
        work, height, band=max(1, _LATITUDE_BAND // (2 * height * n_lookups**2)), threads=threads
    )
    return out


def _with_wide_texels(image: Float32Array, width_rad: float) -> Float32Array:
    """Average rows over at least `width_rad` along their circle of latitude, keeping means."""
    height, width, _ = image.shape
    out = image.copy()
    latitudes = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    widths = np.minimum(width_rad / pm.cos(latitudes) * width / (2 * np.pi), width)
    centers = np.arange(width) + 0.5
    for row in np.flatnonzero(widths > 1.0):
        # The integral from the left edge over two turns, so that windows can cross the right edge.
        whole = np.concatenate([image[row]] * 3).astype(np.float64)
        integral = np.concatenate([np.zeros((1, whole.shape[1])), np.cumsum(whole, axis=0)])
        ends = np.stack([centers - widths[row] / 2, centers + widths[row] / 2]) + width
        left = ends.astype(np.int64)
        at_ends = integral[left] + (ends - left)[..., None] * whole[left]
        out[row] = (at_ends[1] - at_ends[0]) / widths[row]
        # Differences of sums have a rounding error, which a constant row must not show.
        np.clip(out[row], image[row].min(axis=0), image[row].max(axis=0), out=out[row])
    return out
