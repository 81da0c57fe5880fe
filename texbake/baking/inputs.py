"""What maps are made from beside the hits; each part is computed when a map first asks for it.

Of the dense mesh only what belongs to its faces, corner by corner, may be asked for here, but for
its normals and curvatures, so that the part of it that was hit is enough to make maps again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.baking.options import BakeOptions
from texbake.baking.rays import ray_normals
from texbake.mapping.seams import chart_ids
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import flat_normals, shading_normals, smooth_normals, vertex_curvatures
from texbake.mesh.tangents import corner_tangents
from texbake.texture.encoding import decode_srgb


@dataclass(frozen=True, eq=False)
class BakeInputs:
    """The two meshes of a bake with their normals and tangents, in model space.

    Attributes
    ----------
    high, low : Mesh
    options : BakeOptions
    materials : Materials, optional
        Of the dense mesh.
    known_curvatures : (V, 1) float32, optional
        What `high_curvatures` is, where the dense mesh is only a part of itself.
    known_bounds : (2, 3) float64, optional
        What `bounds` is, where it is.
    """

    high: Mesh
    low: Mesh
    options: BakeOptions
    materials: Materials | None = None
    known_curvatures: npt.NDArray[np.float32] | None = None
    known_bounds: FloatArray | None = None

    def with_options(self, options: BakeOptions) -> BakeInputs:
        """Return the same with other options; parts that these leave as they are stay computed."""
        inputs = BakeInputs(self.high, self.low, options)
        kept = {**self.__dict__, "options": options}
        if options.high_shading != self.options.high_shading:
            kept.pop("high_normals", None)
        if options.vertex_colors != self.options.vertex_colors:
            kept.pop("high_colors", None)
        inputs.__dict__.update(kept)
        return inputs

    def with_low(self, low: Mesh) -> BakeInputs:
        """Return the same with another light mesh; what is of the dense mesh stays computed."""
        inputs = replace(self, low=low)
        of_high = {name: value for name, value in self.__dict__.items() if "high_" in name}
        inputs.__dict__.update(of_high)
        return inputs

    @cached_property
    def high_normals(self) -> tuple[npt.NDArray[np.float32], IntArray]:
        """(N, 3) float32 shading normals of the dense mesh and (F, 3) indices."""
        high, threads = self.high, self.options.threads
        if self.options.high_shading == "flat":
            normals, corners = flat_normals(high, threads=threads)
        elif high.normals is None:
            normals, corners = self._high_smooth_normals, high.faces
        else:
            normals, corners = shading_normals(high, threads=threads)
        return frozen(normals.astype(np.float32)), frozen(corners)

    @cached_property
    def _high_smooth_normals(self) -> FloatArray:
        return smooth_normals(self.high, threads=self.options.threads)

    @cached_property
    def high_curvatures(self) -> npt.NDArray[np.float32]:
        """(V, 1) float32 mean curvature of the dense mesh at its vertices, one by model units."""
        if self.known_curvatures is not None:
            return frozen(self.known_curvatures)
        curvatures = vertex_curvatures(
            self.high, normals=self._high_smooth_normals, threads=self.options.threads
        )
        return frozen(curvatures.astype(np.float32)[:, np.newaxis])

    @cached_property
    def high_colors(self) -> npt.NDArray[np.float32]:
        """(V, 3) float32 linear vertex colors of the dense mesh; white where it has none."""
        if self.high.colors is None:
            return frozen(np.ones((self.high.n_vertices, 3), dtype=np.float32))
        colors = self.high.colors[:, :3]
        if self.options.colors_are_srgb(self.high.name):
            colors = decode_srgb(np.clip(colors, 0.0, 1.0)).astype(np.float32)
        return frozen(np.ascontiguousarray(colors))

    @cached_property
    def high_images(self) -> dict[str, npt.NDArray[np.float32]]:
        """Images of the dense mesh's materials by name, (H, W, 3) float32 and linear."""
        images: dict[str, npt.NDArray[np.float32]] = {}
        for color in () if self.materials is None else self.materials.base_colors:
            if color is not None and color.image is not None and color.image_name not in images:
                images[color.image_name] = _decoded(color.image, color.image_name)
        return images

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: the box around both meshes."""
        if self.known_bounds is not None:
            return frozen(self.known_bounds)
        low, high = self.low.bounds, self.high.bounds
        return frozen(np.stack([np.minimum(low[0], high[0]), np.maximum(low[1], high[1])]))

    @cached_property
    def low_normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 shading normals of the light mesh and (F, 3) indices."""
        normals, corners = shading_normals(self.low, threads=self.options.threads)
        return frozen(normals), frozen(corners)

    @cached_property
    def low_tangents(self) -> npt.NDArray[np.float32]:
        """(F, 3, 4) float32 corner tangents of the light mesh: the file's, else MikkTSpace's."""
        tangents = self.low.tangents
        return frozen(corner_tangents(self.low) if tangents is None else tangents)

    @cached_property
    def low_charts(self) -> IntArray:
        """(F,) int32 chart of each face of the light mesh."""
        return chart_ids(self.low)

    @cached_property
    def displacement_normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 directions that a displaced light mesh moves along and (F, 3) indices."""
        normals, corners = ray_normals(self.low, "smooth")
        return frozen(normals), frozen(corners)


def _decoded(data: bytes, name: str) -> npt.NDArray[np.float32]:
    """(H, W, 3) linear float32 image; gray becomes three equal channels, alpha is left out."""
    from texbake.texture.image import decode_image

    pixels = decode_image(data, name, color=True).pixels
    pixels = pixels[:, :, :3] if pixels.shape[2] >= 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    return np.ascontiguousarray(pixels)
