"""A cube map with its smaller levels, laid out so that lookups know no edges.

Every face of every level is held with a border of one texel, which repeats the texels beyond its
edges, so that interpolating near an edge or a corner reads what lies there on the neighboring face
and comes to the same value from either side. In a corner, where only three texels meet, the fourth
is their mean.

Based on: the OpenGL 4.6 specification, section 8.14 (seamless cube maps). A smaller level is the
mean over the texels it covers, weighted by their solid angles, so that no level gains or loses
energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.texture.cube_map import CubeMap, fill_bordered, solid_angles

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


@kernel
def _reduce_kernel(faces, weights, out, start, stop):  # type: ignore[no-untyped-def]
    size = faces.shape[1]
    small = out.shape[1]
    n_channels = faces.shape[3]
    sums = np.zeros(n_channels)
    ratio = size / small
    for row in range(start, stop):
        face = row // small
        top = (row % small) * ratio
        for column in range(small):
            left = column * ratio
            sums[:] = 0.0
            total = 0.0
            for y in range(int(top), min(int(np.ceil(top + ratio)), size)):
                height = min(y + 1.0, top + ratio) - max(np.float64(y), top)
                for x in range(int(left), min(int(np.ceil(left + ratio)), size)):
                    width = min(x + 1.0, left + ratio) - max(np.float64(x), left)
                    weight = max(width, 0.0) * max(height, 0.0) * weights[y, x]
                    total += weight
                    for channel in range(n_channels):
                        sums[channel] += weight * faces[face, y, x, channel]
            for channel in range(n_channels):
                out[face, row % small, column, channel] = sums[channel] / total


def reduced(cube: CubeMap, size: int, *, threads: int | None = None) -> CubeMap:
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
        _reduce_kernel(faces, weights, out, start, stop)

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
        levels.append(reduced(levels[-1], levels[-1].size // 2, threads=threads))
    return CubeChain.of(levels)
