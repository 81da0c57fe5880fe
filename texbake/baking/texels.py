"""Which face of the low-poly mesh owns each sample of a texture, and the loop over all of them.

Texture coordinates are snapped to a fixed-point grid, and coverage is decided with 64-bit integer
edge functions and the top-left rule. So two faces that share an edge own each sample on it exactly
once, whatever the size of the texture or the number of threads. Kernel: `core/pineda.c`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.errors import UvError
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.weld import later_copies
from texbake.parallel import run_bands
from texbake.progress import Stages
from texbake.raycast.rays import Rows
from texbake.records import dataclass
from texbake.texture.lookup import texel_coordinates

# Units of the fixed-point grid, as in `core/edge_functions.h`.
FRACTION_BITS = 11  # a sample is 2048 units wide
UNIT = 1 << FRACTION_BITS
TILE = 16  # rows and columns of samples cast together; a multiple of the samples per texel side
NO_FACE = -1

# Faces that cover the texture more often than this, all together, may be copies of one another.
_MOST_LAYERS = 8

# Coordinates up to 2^18 samples from the origin: a product of two differences is at most 2^60.
_MAX_COORDINATE = 1 << (18 + FRACTION_BITS)


@dataclass(frozen=True)
class SampleGrid:
    """A texture of `width` x `height` texels, each a square of `per_side` x `per_side` samples."""

    width: int
    height: int
    per_side: int

    @property
    def n_columns(self) -> int:
        """Samples in a row of samples."""
        return self.width * self.per_side

    @property
    def n_rows(self) -> int:
        """Rows of samples."""
        return self.height * self.per_side


@dataclass(frozen=True)
class SnappedFaces:
    """The faces of a mesh on the fixed-point grid of a `SampleGrid`."""

    corners: Int64Array  # (F, 3, 2) int64; x to the right and y down, `UNIT` per sample
    # first_rows, last_rows: (F,) int32; rows of samples whose centers a face can own; the last is
    # below the first if there are none, as for most copies of faces that lie on one another.
    first_rows: IntArray
    last_rows: IntArray
    # Faces with a corner outside the unit square; what lies outside is not baked.
    n_outside_tile: int
    n_zero_area: int  # faces without area on the grid, which own no sample


@dataclass(frozen=True, eq=False)
class Samples(Rows):
    """Owned samples, in the order in which they are cast."""

    # (n,) int32; row times width plus column of the texel, row 0 at the top.
    texel_ids: IntArray
    faces: IntArray  # (n,) int32; face of the mesh
    # (n, 2) float64; weights of the face's second and third corner at the sample.
    barycentrics: FloatArray


def snap_uvs(mesh: Mesh, grid: SampleGrid) -> SnappedFaces:
    """Snap uvs of faces within 2^18 samples of the origin to the fixed-point grid."""
    uvs = mesh.corner_uvs()
    with np.errstate(over="ignore"):  # too far in any case
        snapped = np.rint(texel_coordinates(uvs, grid.n_columns, grid.n_rows) * UNIT)
    too_far = np.asarray((np.abs(snapped) > _MAX_COORDINATE).any(axis=(1, 2)))
    snapped[too_far] = 0.0
    corners = snapped.astype(np.int64)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    zero_area = (a[:, 0] * b[:, 1] == a[:, 1] * b[:, 0]) & ~too_far
    # The center of a sample lies half a unit into it: the first center at or below the top corner.
    first = -((UNIT // 2 - corners[:, :, 1].min(axis=1)) // UNIT)
    last = (corners[:, :, 1].max(axis=1) - UNIT // 2) // UNIT
    first = np.maximum(first, 0)
    last = np.minimum(last, grid.n_rows - 1)
    last[zero_area | too_far] = -1
    doubled = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).astype(np.float64)
    if doubled.sum() > 2.0 * _MOST_LAYERS * UNIT**2 * grid.n_columns * grid.n_rows:
        # The first face owns the samples, and the second one makes them overlap.
        last[later_copies(corners.reshape(-1, 6).astype(np.int32), n_kept=2)] = -1
    # Coordinates on the border that a float32 file has rounded are no reason to warn.
    outside = np.asarray((np.abs(uvs - 0.5) > 0.5 + 1e-6).any(axis=(1, 2)))
    if not (first <= last).any():
        why = "they are smaller than any texel"
        if zero_area.all():
            why = "all of them have no area"
        elif outside.any():
            why = "none of them lies in the unit square"
        raise UvError(
            f"{mesh.name}: its texture coordinates cover nothing: {why}; "
            f"make new ones with: texbake unwrap {mesh.name} -o OUT"
        )
    return SnappedFaces(
        corners=corners,
        first_rows=first.astype(np.int32),
        last_rows=last.astype(np.int32),
        n_outside_tile=int(outside.sum()),
        n_zero_area=int(zero_area.sum()),
    )


def rasterize_uv(
    faces: SnappedFaces, grid: SampleGrid, rows: range | None = None, *, threads: int | None = None
) -> tuple[IntArray, int]:
    """Find the first face that covers each sample in some rows of texels, or `NO_FACE`.

    Returns `owners` (len(rows) * per_side, width * per_side) int32, and the number of overlaps.
    """
    rows = range(grid.height) if rows is None else rows
    first = rows.start * grid.per_side
    n_rows = len(rows) * grid.per_side
    owners = np.full((n_rows, grid.n_columns), NO_FACE, dtype=np.int32)
    overlapped = np.zeros((n_rows, grid.n_columns), dtype=np.bool_)

    def rasterize(start: int, stop: int) -> None:
        core.rasterize_uvs(
            faces.corners,
            faces.first_rows,
            faces.last_rows,
            first + start,
            first + stop,
            owners[start:stop],
            overlapped[start:stop],
        )

    run_bands(rasterize, n_rows, band=64, threads=threads)
    return owners, int(np.count_nonzero(overlapped))


def owned_samples(
    owners: IntArray,
    faces: SnappedFaces,
    grid: SampleGrid,
    first_texel_row: int,
    *,
    threads: int | None = None,
) -> Samples:
    """List the owned samples of `rasterize_uv` tile by tile, with their barycentrics."""
    n_bands = -(-len(owners) // TILE)
    counts = np.array(
        [np.count_nonzero(owners[i * TILE : (i + 1) * TILE] != NO_FACE) for i in range(n_bands)],
        dtype=np.int64,
    )
    offsets = np.concatenate([[0], np.cumsum(counts)])
    n_samples = int(offsets[-1])
    texel_ids = np.empty(n_samples, dtype=np.int32)
    sample_faces = np.empty(n_samples, dtype=np.int32)
    barycentrics = np.empty((n_samples, 2), dtype=np.float64)

    def list_tiles(start: int, stop: int) -> None:
        for band in range(start, stop):
            core.list_tiles(
                owners,
                faces.corners,
                TILE,
                band * TILE,
                first_texel_row * grid.per_side,
                grid.per_side,
                int(offsets[band]),
                texel_ids,
                sample_faces,
                barycentrics,
            )

    run_bands(list_tiles, n_bands, band=8, threads=threads)
    return Samples(texel_ids, sample_faces, barycentrics)


@dataclass(frozen=True, eq=False)
class TexelBand:
    """Some rows of texels with the samples that the mesh owns in them."""

    rows: range
    width: int  # texels per row
    # (len(rows) * per_side, width * per_side) int32; face that owns each sample, `NO_FACE` for
    # none.
    owners: IntArray
    samples: Samples
    n_overlaps: int  # samples that more than one face covers

    def note_faces(self, texel_faces: IntArray) -> None:
        """Write the face of the first owned sample into `texel_faces` (H, W) without one."""
        per_side = self.owners.shape[1] // self.width
        cells = self.owners.reshape(len(self.rows), per_side, self.width, per_side)
        texels = texel_faces[self.rows.start : self.rows.stop]
        for i in range(per_side):
            for j in range(per_side):
                np.copyto(texels, cells[:, i, :, j], where=texels == NO_FACE)

    def sums(
        self, values: npt.NDArray[np.floating], chosen: Int64Array | None = None
    ) -> FloatArray:
        """(len(rows) * width, C) sums of (n, C) values of `chosen` samples, or all, by texel."""
        ids = self.samples.texel_ids if chosen is None else self.samples.texel_ids[chosen]
        places = ids - self.rows.start * self.width
        n_texels = len(self.rows) * self.width
        columns = [np.bincount(places, column, minlength=n_texels) for column in values.T]
        return np.stack(columns, axis=1)

    def counts(self) -> Int64Array:
        """(len(rows) * width,) int64: samples of each texel."""
        places = self.samples.texel_ids - self.rows.start * self.width
        return np.bincount(places, minlength=len(self.rows) * self.width)


def owned_bands(
    faces: SnappedFaces,
    grid: SampleGrid,
    stages: Stages,
    *,
    name: str = "bake",
    samples_at_once: int = 1 << 20,
    edit: Callable[[IntArray, range], None] | None = None,
    threads: int | None = None,
) -> Iterator[TexelBand]:
    """Yield owned texels band by band from the top, as a stage, after `edit` of their owners."""
    least = TILE // grid.per_side
    step = max(samples_at_once // (grid.n_columns * grid.per_side) // least, 1) * least
    n_texels = grid.height * grid.width
    with stages.stage(name, total=n_texels, unit="texels", recorded=False) as advance:
        for first in range(0, grid.height, step):
            here = range(first, min(first + step, grid.height))
            with stages.part("rasterize"):
                owners, n_overlaps = rasterize_uv(faces, grid, here, threads=threads)
                if edit is not None:
                    edit(owners, here)
                samples = owned_samples(owners, faces, grid, first, threads=threads)
            yield TexelBand(here, grid.width, owners, samples, n_overlaps)
            advance(len(here) * grid.width)


def texel_charts_of(face_charts: IntArray, texel_faces: IntArray, threads: int | None) -> IntArray:
    """(H, W) int32: chart that covers each texel, of those of the faces; `NO_FACE` for none."""
    # NO_FACE is -1, the last entry, which has no chart.
    charts = np.append(face_charts, NO_FACE).astype(np.int32)
    texel_charts = np.empty_like(texel_faces)

    def look_up(start: int, stop: int) -> None:
        np.take(charts, texel_faces[start:stop], mode="wrap", out=texel_charts[start:stop])

    run_bands(look_up, len(texel_faces), band=128, threads=threads)
    return texel_charts
