"""The base color of the dense mesh's materials, looked up with its own texture coordinates."""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.maps.vertex_color import black
from texbake.errors import MeshError
from texbake.kernels import kernel
from texbake.mesh.materials import BaseColor
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands
from texbake.texture.lookup import lookup

_BAND = 1 << 15
_WHITE = (1.0, 1.0, 1.0)


def texture_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Linear base color at each hit: (n, 3) float32.

    White for a material of which nothing is known. Images are interpolated bilinearly, in linear
    light, at each sample.
    """
    assert inputs.materials is not None
    colors = inputs.materials.base_colors
    if len(colors) == 1:
        return _base_colors(hits.high_faces, hits.high_barycentrics, inputs, colors[0])
    values = np.empty((len(hits), 3), dtype=np.float32)
    ids = inputs.materials.face_materials[hits.high_faces]
    for i, color in enumerate(colors):
        rows = np.flatnonzero(ids == i)
        values[rows] = _base_colors(
            hits.high_faces[rows], hits.high_barycentrics[rows], inputs, color
        )
    return values


def _base_colors(
    faces: IntArray, barycentrics: Float32Array, inputs: BakeInputs, color: BaseColor | None
) -> Float32Array:
    """(n, 3) float32: a material's color at points of faces that have it."""
    factor = np.array(_WHITE if color is None else color.factor, dtype=np.float32)
    if color is None or color.image is None:
        return np.tile(factor, (len(faces), 1))
    places = _image_places(faces, barycentrics, inputs, color)
    image = inputs.high_images[color.image_name]
    found = lookup(image, places, wrap=color.wrap, threads=inputs.options.threads)
    return found if color.factor == _WHITE else found * factor


def _image_places(
    faces: IntArray, barycentrics: Float32Array, inputs: BakeInputs, color: BaseColor
) -> FloatArray:
    """(n, 2) float64: places in a material's image."""
    places = np.empty((len(faces), 2))
    placing = np.array(color.placing)
    uvs, corners = inputs.high.uvs, inputs.high.uv_faces

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _places_kernel(faces[band], barycentrics[band], uvs, corners, placing, places[band])

    run_bands(work, len(faces), band=_BAND, threads=inputs.options.threads)
    return places


def _require_materials(inputs: BakeInputs) -> None:
    high, materials = inputs.high, inputs.materials
    colors = () if materials is None else materials.base_colors
    if not any(color is not None for color in colors):
        raise MeshError(
            f"{high.name}: its file names no base color to carry over; give the bake its image "
            "with --high-texture, or leave the map texture out"
        )
    if high.uvs is None and any(color is not None and color.image for color in colors):
        raise MeshError(
            f"{high.name}: it has no texture coordinates, so that nothing says where its image "
            "lies; leave the map texture out"
        )


TEXTURE = MapKind("texture", 3, "color", texture_values, black, require=_require_materials)


@kernel
def _places_kernel(faces, barycentrics, uvs, corners, placing, places):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        u = (1.0 - b - c) * uvs[p, 0] + b * uvs[q, 0] + c * uvs[r, 0]
        v = (1.0 - b - c) * uvs[p, 1] + b * uvs[q, 1] + c * uvs[r, 1]
        for row in range(2):
            places[i, row] = placing[row, 0] * u + placing[row, 1] * v + placing[row, 2]
