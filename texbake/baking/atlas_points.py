"""The point of the surface at each texel of an atlas, for programs that fill the texels themselves.

Like `finish`, a program evaluates a field, a network or photographs at the points, puts the values
into an image, and fills the other texels with `texbake.fill`.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.channel_images import surface_points
from texbake.baking.texels import NO_FACE, SampleGrid, owned_bands, snap_uvs
from texbake.mapping.options.shared import TextureOptions
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IntArray
from texbake.mesh.normals import shading_normals
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.schema import Size


@dataclass(frozen=True, eq=False, repr=False)
class AtlasPoints:
    """Points of a mesh at the centers of texels; row 0 is at the top of the image."""

    positions: FloatArray  # (H, W, 3) float64: points in the space of the mesh; 0 outside
    normals: Float32Array  # (H, W, 3): unit shading normals; 0 outside
    faces: IntArray  # (H, W): face that covers the center of each texel, -1 for none
    barycentrics: Float32Array  # (H, W, 3): weights of its corners; 0 outside

    def __repr__(self) -> str:
        height, width = self.faces.shape
        return f"<AtlasPoints: {width} x {height}, {self.mask.mean():.0%} covered>"

    @property
    def mask(self) -> BoolArray:
        """(H, W) bool: texels whose center a face covers."""
        return np.asarray(self.faces != NO_FACE)


def atlas_points(
    mesh: MeshLike, size: Size, *, threads: int | None = None, progress: Progress = None
) -> AtlasPoints:
    """Find the point of a mesh at the center of each texel of its texture.

    Parameters
    ----------
    mesh
        With texture coordinates. Two faces that share an edge own each texel on it once; where
        faces overlap in the texture, the first one owns the texel.
    size
        Width and height of the texture in texels, or a number for both.

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or they cover nothing.
    OptionError
        The size is not a number of texels, or two.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> points = atlas_points(plane(), 4)
    >>> points.positions[0, 0].tolist(), points.mask.all()
    ([0.125, 0.875, 0.0], np.True_)
    """
    mesh = as_mesh(mesh)
    texture = TextureOptions(size=size)
    width, height = texture.width_px, texture.height_px
    grid = SampleGrid(width, height, 1)
    faces = np.full(width * height, NO_FACE, dtype=np.int32)
    positions = np.zeros((width * height, 3))
    normals, barycentrics = np.zeros((2, width * height, 3), np.float32)
    exact, corners = shading_normals(mesh, threads=threads)
    vectors = exact.astype(np.float32)
    for band in owned_bands(
        snap_uvs(mesh, grid), grid, Stages(progress), name="find points", threads=threads
    ):
        samples = band.samples
        texels, owners, weights = samples.texel_ids, samples.faces, samples.barycentrics
        of_corners = np.column_stack([1.0 - weights.sum(axis=1), weights])
        faces[texels], barycentrics[texels] = owners, of_corners
        positions[texels], normals[texels] = surface_points(mesh, vectors, corners, owners, weights)
    shape = height, width
    return AtlasPoints(
        positions.reshape(*shape, 3),
        normals.reshape(*shape, 3),
        faces.reshape(shape),
        barycentrics.reshape(*shape, 3),
    )
