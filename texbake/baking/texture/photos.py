"""Photographs baked into the texture of a mesh, blended by how well each shows a texel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texels import SampleGrid, Samples
from texbake.baking.texture.canvas import TextureCanvas
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo import Photo, PhotoCamera, PhotoPixels
from texbake.baking.texture.photo_mappings import (
    CameraMapping,
    CameraOcclusion,
    PhotoMapping,
    PhotoPoints,
    UvMapping,
)
from texbake.baking.texture.result import PhotoShare, TextureBake
from texbake.errors import OptionError, counted
from texbake.mapping.classical.projector import projector_matrix
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.shared import Matrix
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.progress import ProgressSink


def bake_photos(
    mesh: MeshLike,
    photos: Sequence[Photo],
    options: PhotoOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> TextureBake:
    """Blend photographs into the texture of a mesh.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> camera = PhotoCamera(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 0.0))
    >>> red = Photo(image=np.full((4, 4, 3), (0.5, 0.0, 0.0), np.float32), camera=camera)
    >>> bake_photos(plane(), [red], PhotoOptions(size=16)).values[8, 8].tolist()
    [0.5, 0.0, 0.0]
    """
    mesh = as_mesh(mesh)
    options = options or PhotoOptions()
    if not photos:
        raise OptionError("photos: there are none; give at least one")
    canvas = TextureCanvas(mesh, options, 3, progress)
    stages = canvas.stages
    frame = LocalFrame.around(mesh)
    # Rays of length 0 start on the surface; their directions are its smooth normals, reversed.
    field = RayField(mesh, frame, kind="smooth", front=0.0, back=0.0, threads=options.threads)
    with stages.stage("read photographs"):
        pixels = [PhotoPixels(photo, i, threads=options.threads) for i, photo in enumerate(photos)]
    tally = _Tally([photo.name for photo in pixels])
    with ExitStack() as opened:
        mappings = list(_mappings(mesh, photos, pixels, frame, canvas.grid, options, opened))
        for band in canvas.bands():
            with stages.part("project photographs"):
                points = _points(field, band.samples)
                sums = []
                for photo, mapping in zip(pixels, mappings, strict=True):
                    lookups = mapping.look_up(points)
                    sums.append(band.sums(photo.weighted_colors(lookups), lookups.ids))
                total = np.sum(sums, axis=0)
                seen = total[:, 3] > 0.0
                canvas.put(band, total[:, :3] / np.where(seen, total[:, 3], 1.0)[:, None], seen)
                tally.add([weighted[:, 3] for weighted in sums], total[:, 3])
    return canvas.finish(counted(len(photos), "photograph"), photos=tally.shares())


def _mappings(
    mesh: Mesh,
    photos: Sequence[Photo],
    pixels: Sequence[PhotoPixels],
    frame: LocalFrame,
    grid: SampleGrid,
    options: PhotoOptions,
    opened: ExitStack,
) -> Iterator[PhotoMapping]:
    """Yield the mapping into each photograph; `opened` frees what they share."""
    occlusion = None
    if options.occlusion and any(photo.camera is not None for photo in photos):
        occlusion = CameraOcclusion(mesh, frame, threads=options.threads)
        opened.callback(occlusion.close)
    for photo, image in zip(photos, pixels, strict=True):
        if photo.mapped is not None:
            yield UvMapping(mesh, photo.mapped, grid, options)
            continue
        camera = photo.camera
        try:
            matrix = (
                camera.matrix(image.width / image.height, frame)
                if isinstance(camera, PhotoCamera)
                else _local_matrix(mesh, camera, frame)
            )
            margins = options.margin / image.width, options.margin / image.height
            yield CameraMapping(mesh, matrix, frame, grid, options, occlusion, margins)
        except OptionError as error:
            raise OptionError(f"{image.name}: {error}") from error


def _local_matrix(mesh: Mesh, camera: Matrix | None, frame: LocalFrame) -> FloatArray:
    """(4, 4) float64: local space to (s, t, r, q), by a camera's matrix."""
    a, b, c, d = (tuple(float(value) for value in row) for row in np.array(camera, np.float64))
    given = UnwrapOptions(method="projector", matrix=(a, b, c, d))  # type: ignore[arg-type]
    return projector_matrix(mesh, given, frame)


def _points(field: RayField, samples: Samples) -> PhotoPoints:
    rays = field.rays(samples)
    return PhotoPoints(samples.faces, samples.barycentrics, rays.origins, -rays.directions)


class _Tally:
    """Sums up, band by band, how much each photograph contributes."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._seen = [0] * len(names)
        self._shares = [0.0] * len(names)

    def add(self, weights: Sequence[FloatArray], total: FloatArray) -> None:
        """Add the weights of some texels in each photograph, given their totals."""
        divisors = np.where(total > 0.0, total, 1.0)
        for i, weight in enumerate(weights):
            self._seen[i] += int(np.count_nonzero(weight > 0.0))
            self._shares[i] += float((weight / divisors).sum())

    def shares(self) -> tuple[PhotoShare, ...]:
        """Return the figures of each photograph."""
        whole = sum(self._shares) or 1.0
        rows = zip(self._names, self._seen, self._shares, strict=True)
        return tuple(PhotoShare(name, seen, 100.0 * share / whole) for name, seen, share in rows)
